"""The documentation site: nothing public is undocumented, and every page and link is there."""

from __future__ import annotations

import importlib
import re
import sys
import unicodedata
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
import yaml

from msrr_bullet.cli.app import run
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.scene import Scene

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def modules() -> Iterator[dict[str, ModuleType]]:
    """The modules that make the reference, which are scripts and no package."""
    names = ("scene_keys", "code_reference", "message_reference", "command_reference", "make_site")
    sys.path.insert(0, str(ROOT / "docs" / "site"))
    yield {name: importlib.import_module(name) for name in names}
    sys.path.remove(str(ROOT / "docs" / "site"))
    for name in (*names, "markdown_text"):
        del sys.modules[name]


@pytest.fixture(scope="module")
def site(modules: dict[str, ModuleType], tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    modules["make_site"].write_site(folder)
    return folder


def test_every_public_class_and_function_is_documented(modules: dict[str, ModuleType]) -> None:
    assert modules["code_reference"].undocumented() == []


def test_pages_are_read_without_a_network(site: Path) -> None:
    """Drawings in Mermaid are drawn by a program that the browser would fetch."""
    pages = sorted(site.rglob("*.md"))
    assert pages
    for page in pages:
        found = re.findall(r"^``` ?mermaid|<script[^>]*|!\[[^\]]*\]\(https?:", page.read_text(), re.MULTILINE)
        assert not found, page.name


def test_what_is_undocumented_is_found(
    modules: dict[str, ModuleType], tmp_path: Path, monkeypatch: Any
) -> None:
    (tmp_path / "bare.py").write_text('"""A module."""\n\nclass Thing:\n    def act(self):\n        ...\n')
    code = modules["code_reference"]
    code.load.cache_clear()
    monkeypatch.setattr(code, "PACKAGES", {"bare": tmp_path})
    assert code.undocumented() == ["bare.Thing", "bare.Thing.act"]
    code.load.cache_clear()


def test_every_key_has_a_meaning_and_a_row_of_its_own(modules: dict[str, ModuleType], site: Path) -> None:
    keys = modules["scene_keys"]
    page = (site / "reference" / "scene_keys.md").read_text()
    found = keys.scene_keys()
    assert len(found) > 300
    assert [key.path for key in found if not key.meaning] == []
    for key in found:
        assert f"| `{key.path}` |" in page
    assert "| `control.docking` | text or mapping |  | cbf |" in page
    assert "| `limits.w_max_radps` | number | 0.001 .. 20 | 1.5 (normal), 1 (tight) | rad/s |" in page
    tops = {key.path.partition(".")[0] for key in found}
    assert tops == Scene.model_fields.keys() - {"source"}


def test_every_parameter_of_a_registered_law_has_a_meaning(modules: dict[str, ModuleType]) -> None:
    keys = modules["scene_keys"]
    for point in ("control.docking", "control.assembly"):
        laws = keys.PARAMETERS[point]
        assert laws.keys() == set(keys.EXTENSION_POINTS[point])
        for name, kind in laws.items():
            bare = [key.path for key in keys.parameter_keys(kind()) if not key.meaning]
            assert bare == [], f"{point}: {name}"


def test_a_key_says_its_unit_as_its_meaning_does(modules: dict[str, ModuleType]) -> None:
    """By the end of the key and by the brackets of the docstring, where both are there."""
    for key in modules["scene_keys"].scene_keys():
        stated = re.search(r"\[(px|m|deg|rad|s|ms|1/s|%|m/s|N|Hz|N m|grey levels)\]", key.meaning)
        if stated:
            assert key.unit == stated[1], key.path


def test_every_outcome_and_fault_is_on_its_page(site: Path) -> None:
    page = (site / "reference" / "outcomes.md").read_text()
    for outcome in Outcome:
        assert re.search(rf"^\| `{outcome.value}` \| \w", page, re.MULTILINE), outcome
    faults = re.findall(
        r"kind: Literal\[\"(\w+)\"\]", (ROOT / "scenes/msrr_scenes/specs/faults.py").read_text()
    )
    assert len(faults) >= 7
    for fault in faults:
        assert f"| `{fault}` |" in page


def test_every_field_of_a_message_has_a_meaning(site: Path) -> None:
    page = (site / "reference" / "messages.md").read_text()
    rows = [line for line in page.splitlines() if line.startswith("| `")]
    assert len(rows) > 100
    assert [row for row in rows if row.endswith("|  |")] == []


def test_bars_of_types_are_shown_without_a_backslash(site: Path, modules: dict[str, ModuleType]) -> None:
    """Python-Markdown splits no cell at a bar in code, and prints a backslash there."""
    assert "| `Array | None` |" in (site / "reference" / "messages.md").read_text()
    assert modules["code_reference"].cell("``a | b`` or |c|") == r"`a | b` or \|c\|"


def test_a_colon_in_what_a_function_returns_makes_no_type_of_the_words_before_it(site: Path) -> None:
    pages = [page.read_text() for page in sorted((site / "reference" / "code").rglob("*.md"))]
    returned = [text for page in pages for text in re.findall(r"\*\*Returns\*\*\n\n- (.*)", page)]
    assert len(returned) > 50
    assert [text for text in returned if re.match(r"`[^`\[|]+ [^`\[|]+`: ", text)] == []


def test_every_command_is_on_the_page_with_its_help(
    modules: dict[str, ModuleType], site: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page = (site / "reference" / "command_line.md").read_text()
    names = modules["command_reference"].command_names()
    assert {"dock", "sweep", "schema", "replay"} <= set(names)
    for name in names:
        assert f"\n## msrr {name}\n" in page
    assert run(["dock", "--help"]) == 0
    for option in re.findall(r"--[a-z-]+", capsys.readouterr().out):
        assert option in page


def test_the_navigation_names_every_page_but_those_of_the_code(site: Path) -> None:
    named = set(_leaves(yaml.safe_load((ROOT / "mkdocs.yml").read_text())["nav"]))
    pages = {path.relative_to(site).as_posix() for path in site.rglob("*.md")}
    code = {page for page in pages if page.startswith("reference/code/") and not page.endswith("/index.md")}
    assert named == pages - code


def _leaves(nav: Any) -> Iterator[str]:
    if isinstance(nav, str):
        yield nav
    for part in nav.values() if isinstance(nav, dict) else nav if isinstance(nav, list) else ():
        yield from _leaves(part)


_FENCE = re.compile(r"^```.*?^```$", re.DOTALL | re.MULTILINE)
_LINK = re.compile(r"\]\((?P<file>[^)#\s]*)(?:#(?P<anchor>[^)\s]*))?\)")


def test_every_link_of_the_site_leads_to_a_page_and_its_heading(site: Path) -> None:
    checked = 0
    for page in site.rglob("*.md"):
        for link in _LINK.finditer(_FENCE.sub("", page.read_text())):
            if "://" in link["file"]:
                continue
            target = (page.parent / link["file"]).resolve() if link["file"] else page
            where = f"{page.relative_to(site)} links to {link[0][2:-1]}"
            assert target.is_file(), where
            assert target.is_relative_to(site.resolve()), f"{where}, which is not on the site"
            if link["anchor"]:
                assert link["anchor"] in _anchors(target.read_text()), where
            checked += 1
    assert checked > 150


def _anchors(text: str) -> set[str]:
    """Return the anchors of the headings of a page, as Python-Markdown names them."""
    headings = re.findall(r"^#+ (.*)$", _FENCE.sub("", text), re.MULTILINE)
    plain = (unicodedata.normalize("NFKD", re.sub(r"[`*]", "", heading)) for heading in headings)
    words = (
        re.sub(r"[^\w\s-]", "", text.encode("ascii", "ignore").decode()).strip().lower() for text in plain
    )
    return {re.sub(r"[-\s]+", "-", text) for text in words}
