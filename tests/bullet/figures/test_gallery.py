"""The gallery shows every shipped scene, in pictures that cost a reader little."""

from __future__ import annotations

import re
from pathlib import Path

from msrr_scenes.loading.load import shipped_scenes
from tests.conftest import load_script

DOCS = Path(__file__).resolve().parents[3] / "docs"
MEND = "run `python docs/make_gallery.py` with the names of the scenes that are new"


def test_every_shipped_scene_has_its_picture_and_every_picture_its_scene() -> None:
    shown = set(re.findall(r"!\[(\w+)\]\(gallery/\1\.png\)", (DOCS / "gallery.md").read_text()))
    pictures = {path.stem for path in (DOCS / "gallery").glob("*.png")}
    assert shown == set(shipped_scenes()), MEND
    assert pictures == shown, MEND


def test_the_page_says_of_every_run_what_its_picture_holds() -> None:
    """A sentence that was changed by hand told of 7 s beside the picture of a run of 4 s."""
    page = load_script(DOCS / "make_gallery.py").page(shipped_scenes())
    assert page == (DOCS / "gallery.md").read_text(encoding="utf-8"), MEND


def test_the_pictures_are_small() -> None:
    sizes = {path.name: path.stat().st_size for path in (DOCS / "gallery").glob("*.png")}
    assert max(sizes.values()) < 100_000, sizes
    assert sum(sizes.values()) < 3_000_000
