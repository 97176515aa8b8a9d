"""What READMEs and pages show works: programs run, scenes load, commands exist."""

from __future__ import annotations

import functools
import importlib
import re
import shlex
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

from msrr_bullet.cli.app import program
from msrr_bullet.log import LOG_NAME, LogHeader
from msrr_bullet.log.mcap_recorder import McapRecorder
from msrr_bullet.trial.trial import Trial
from msrr_scenes.loading.load import load_scene
from msrr_scenes.specs.scene import Scene

ROOT = Path(__file__).resolve().parents[1]
PAGES = (ROOT / "README.md", *sorted(ROOT.glob("[!.]*/README.md")), *sorted(ROOT.glob("docs/**/*.md")))
#: Pages that test_pages.py carries out from top to bottom.
FOLLOWED = ("docs/index.md", "docs/tutorials/", "docs/how-to/")

_BLOCK = re.compile(r"^```(?P<language>\w*)(?: title=[^\n]*)?\n(?P<text>.*?)^```$", re.DOTALL | re.MULTILINE)
_COMMAND = re.compile(r"^\s*(?:\$ )?(?:\.venv/bin/)?msrr (?P<arguments>[a-z].*)$", re.MULTILINE)
_INLINE = re.compile(r"`(?:\.venv/bin/)?msrr (?P<arguments>[a-z][^`]*)`")


@dataclass(frozen=True)
class Piece:
    """A piece of a page: what a reader would copy, and where it stands."""

    page: str
    line: int
    text: str

    def __str__(self) -> str:
        return f"{self.page}:{self.line}"


def pieces(pattern: re.Pattern[str], group: str, language: str | None = None) -> list[Piece]:
    found = []
    for page in PAGES:
        text = page.read_text()
        for match in pattern.finditer(text):
            if language is None or match["language"] == language:
                line = text[: match.start()].count("\n") + 1
                found.append(Piece(page.relative_to(ROOT).as_posix(), line, match[group]))
    return found


PYTHON = pieces(_BLOCK, "text", "python")
#: Blocks that begin with an import are whole programs; the others are sketches of a class.
PROGRAMS = [
    piece
    for piece in PYTHON
    if re.match(r"(from|import) ", piece.text) and not piece.page.startswith(FOLLOWED)
]
SCENES = [piece for piece in pieces(_BLOCK, "text", "yaml") if "\nplan:" in piece.text]
SCENES = [piece for piece in SCENES if not piece.page.startswith(FOLLOWED)]
COMMANDS = [*pieces(_COMMAND, "arguments"), *pieces(_INLINE, "arguments")]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, shipped: Callable[..., Scene]) -> Path:
    """A working folder with every run that the programs speak of: one short run under all their names."""
    work = tmp_path_factory.mktemp("readme")
    scene = shipped("close_range", {"time_limit_s": "1"})
    (work / "run").mkdir()
    with McapRecorder(work / "run" / LOG_NAME, LogHeader.of(scene, 1, {})) as recorder:
        Trial(scene, 1, recorder=recorder).run()
    (work / "runs").mkdir()
    for name in {n for piece in PROGRAMS for n in re.findall(r"runs/(\w+)", piece.text)}:
        (work / "runs" / name).symlink_to(work / "run")
    return work


def execute(*arguments: str, cwd: Path) -> str:
    done = subprocess.run(
        [sys.executable, *arguments], cwd=cwd, capture_output=True, text=True, check=False, timeout=200
    )
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr}"
    return done.stdout


@pytest.mark.parametrize(
    "program",
    # Those that run whole trials take as long as all others together.
    [pytest.param(p, marks=pytest.mark.nightly if "run_trial(" in p.text else ()) for p in PROGRAMS],
    ids=str,
)
def test_a_program_runs(program: Piece, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    exec(compile(program.text, str(program), "exec"), {"__name__": "__main__"})


@pytest.mark.parametrize("sketch", PYTHON, ids=str)
def test_a_sketch_is_python(sketch: Piece) -> None:
    compile(sketch.text, str(sketch), "exec")


def test_the_readme_has_a_program_of_ten_lines() -> None:
    texts = [program.text for program in PROGRAMS if program.page == "README.md"]
    assert texts, "README.md shows no Python program"
    assert "run_trial(" in texts[0]
    assert len([line for line in texts[0].splitlines() if line.strip()]) <= 10


@pytest.mark.parametrize("scene", SCENES, ids=str)
def test_a_scene_loads(scene: Piece, tmp_path: Path) -> None:
    file = tmp_path / "scene.yaml"
    file.write_text(scene.text)
    assert load_scene(file).plan


@pytest.mark.parametrize("command", COMMANDS, ids=lambda c: f"{c}-{c.text.split()[0]}")
def test_a_command_exists_with_these_options(command: Piece) -> None:
    """Looked up, not run: names in capitals stand for something of the reader's."""
    name, *words = shlex.split(command.text, comments=True)
    with program().make_context("msrr", ["--help"], resilient_parsing=True) as context:
        chosen = program().get_command(context, name)
        assert chosen is not None, f"{command}: msrr has no command {name!r}"
        options = {option for parameter in chosen.params for option in parameter.opts}
        for word in (w.strip("[]") for w in words):
            if word.startswith("--"):
                assert word.partition("=")[0] in options, f"{command}: msrr {name} has no option {word}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_every_name_of_ours_on_a_page_exists(page: Path) -> None:
    """Dotted names of modules, classes and functions, such as ``msrr_bullet.run.run_trial``."""
    for name in sorted(set(re.findall(r"`~?(msrr_[a-z]+(?:\.\w+)+)", page.read_text()))):
        assert _exists(name), f"{page.name} names {name}"


def _exists(name: str) -> bool:
    for split in range(name.count(".") + 1):
        module, *attributes = name.rsplit(".", split)
        try:
            found = importlib.import_module(module)
        except ModuleNotFoundError:
            continue
        return functools.reduce(lambda part, a: getattr(part, a, None), attributes, found) is not None
    return False


@pytest.mark.parametrize(
    "page",
    [page for page in PAGES if not page.is_relative_to(ROOT / "docs")],
    ids=lambda page: page.relative_to(ROOT).as_posix(),
)
def test_every_link_of_a_readme_leads_somewhere(page: Path) -> None:
    """Links between pages of the site are checked by test_site.py."""
    for target in re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", page.read_text()):
        assert (page.parent / target).exists(), f"{page.name} links to {target}"


def test_the_own_controller_is_an_example_of_forty_lines() -> None:
    assert len((ROOT / "examples" / "own_controller.py").read_text().splitlines()) <= 42


@pytest.mark.nightly
def test_the_own_controller_runs_as_a_program(tmp_path: Path) -> None:
    said = execute(str(ROOT / "examples" / "own_controller.py"), cwd=tmp_path)
    assert "docked" in said


def test_the_agent_that_is_trained_gets_the_reward_of_the_page() -> None:
    page = (ROOT / "docs" / "how-to" / "reinforcement_learning.md").read_text()
    reward = page[page.index("class Progress") : page.index("```\n\nMost algorithms")]
    assert reward in (ROOT / "examples" / "train_agent.py").read_text()
