"""The fingerprint of the code covers what a scene names by import path."""

from pathlib import Path

import pytest

from msrr_bullet.sweep.provenance import code_fingerprint
from msrr_scenes import load_scene


def test_the_code_of_an_own_controller_counts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module = tmp_path / "own_law.py"
    module.write_text("class Law: ...\n")
    monkeypatch.syspath_prepend(tmp_path)
    scene = load_scene("close_range", {"control.docking": "own_law:Law"})
    before = code_fingerprint(scene)
    assert code_fingerprint(scene) == before
    module.write_text("class Law: gain = 2\n")
    assert code_fingerprint(scene) != before
