"""A reader who follows a page of the documentation from top to bottom gets what the page says.

Blocks are carried out in their order and in one folder: one with a title is a file to save, ``msrr`` commands
of a block ``sh`` are run and end with 0 unless a comment behind them says otherwise, Python is one session.
A block ``text`` is what was printed above it or, with a title, what was written into that file.
"""

from __future__ import annotations

import re
import shlex
import sys
from collections.abc import Iterator
from pathlib import Path

import matplotlib as mpl
import pytest
import yaml

from msrr_bullet.cli.app import run
from msrr_scenes.loading.load import load_scene

DOCS = Path(__file__).resolve().parents[1] / "docs"

#: Pages that begin with pictures, which tests of their own have: ``test_tutorial``, those of the recordings.
WITH_PICTURES = {"own_camera.md", "recordings.md"}

PAGES = sorted(
    page
    for page in (DOCS / "index.md", *DOCS.glob("tutorials/*.md"), *DOCS.glob("how-to/*.md"))
    if page.name not in WITH_PICTURES
)

BLOCK = re.compile(
    r'^```(?P<language>\w+)(?: title="(?P<title>[^"]+)")?\n(?P<text>.*?)^```$', re.DOTALL | re.MULTILINE
)
_COMMAND = re.compile(r"^msrr (?P<arguments>[^#\n]*)(?:#.*exit code (?P<code>\d+))?", re.MULTILINE)
#: The lines that a table is drawn with, which pages leave out.
_RULES = re.compile("[\u2500-\u257f]")


def blocks(page: Path) -> Iterator[re.Match[str]]:
    yield from BLOCK.finditer(page.read_text(encoding="utf-8"))


def words_of_lines(text: str) -> set[str]:
    """Return the lines of a text without the rules of tables, their words one space apart."""
    return {" ".join(line.split()) for line in _RULES.sub(" ", text).splitlines()}


def follow(page: Path, capfd: pytest.CaptureFixture[str]) -> int:
    """Carry out a page in the current folder; return the number of programs and commands that were run."""
    ran, session = 0, {"__name__": "__main__"}
    printed: set[str] = set()
    for block in blocks(page):
        line = page.read_text()[: block.start()].count("\n") + 1
        if block["language"] == "text":
            if not re.match(r"(msrr|make) ", block["text"]):  # commands that take too long, or set up
                there = words_of_lines(Path(block["title"]).read_text()) if block["title"] else printed
                assert words_of_lines(block["text"]) <= there, f"{page.name}:{line}"
        elif block["title"]:
            Path(block["title"]).parent.mkdir(parents=True, exist_ok=True)
            Path(block["title"]).write_text(block["text"], encoding="utf-8")
        elif block["language"] == "sh":
            for command in _COMMAND.finditer(block["text"]):
                code = run(shlex.split(command["arguments"]))
                assert code == int(command["code"] or 0), f"{page.name}:{line}: msrr {command['arguments']}"
                ran += 1
        elif block["language"] == "python":
            exec(compile(block["text"], f"{page.name}:{line}", "exec"), session)
            ran += 1
        printed |= words_of_lines("".join(capfd.readouterr()))
    return ran


@pytest.mark.nightly
@pytest.mark.timeout(900)  # some pages hold ten trials with images
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_page_does_what_it_says(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path, str(tmp_path)])
    monkeypatch.setenv("PYTHONPATH", f"{tmp_path}:{':'.join(sys.path)}")  # of the processes of a sweep
    monkeypatch.setenv("COLUMNS", "80")  # of the tables
    monkeypatch.delenv("PYTEST_ADDOPTS", raising=False)  # is for these tests, not for those of a page
    mpl.use("Agg")
    shown = any(block["language"] in ("sh", "python") for block in blocks(page))
    assert bool(follow(page, capfd)) == shown


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_scenes_and_programs_of_a_page_are_good_as_they_stand(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Quickly: scenes load, unless the page is about their mistakes, and programs are Python."""
    monkeypatch.chdir(tmp_path)
    for block in blocks(page):
        if block["language"] == "python":
            compile(block["text"], str(page), "exec")
        if block["language"] == "yaml":
            document = yaml.safe_load(block["text"])
            file = Path(block["title"] or "scene.yaml")
            if "plan" in document and "mistake" not in file.name:
                file.write_text(block["text"], encoding="utf-8")
                load_scene(file)
