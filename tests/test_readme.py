"""What the READMEs show works: programs run, scenes load, commands exist."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import typer

from msrr_bullet.cli import app
from msrr_bullet.run import run_trial
from msrr_scenes.load import load_scene
from msrr_scenes.scene import Scene

ROOT = Path(__file__).resolve().parents[1]
PAGES = (ROOT / "README.md", *sorted(ROOT.glob("*/README.md")), *sorted(ROOT.glob("docs/*.md")))

_BLOCK = re.compile(r"^```(?P<language>\w*)\n(?P<text>.*?)^```$", re.DOTALL | re.MULTILINE)
_COMMAND = re.compile(r"^\s*(?:\$ )?(?:\.venv/bin/)?msrr (?P<arguments>[a-z].*)$", re.MULTILINE)
_INLINE = re.compile(r"`(?:\.venv/bin/)?msrr (?P<arguments>[a-z][^`]*)`")


def blocks(language: str) -> Iterator[object]:
    for page in PAGES:
        for found in _BLOCK.finditer(page.read_text()):
            if found["language"] == language:
                line = page.read_text()[: found.start()].count("\n") + 1
                yield pytest.param(found["text"], id=f"{page.relative_to(ROOT)}:{line}")


def programs() -> list[object]:
    """Return the Python blocks that begin with an import; the others are sketches of a class."""
    return [b for b in blocks("python") if re.match(r"(from|import) ", b.values[0])]  # type: ignore[attr-defined]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, shipped: Callable[..., Scene]) -> Path:
    """A working folder with every run that the programs speak of: one short run under all their names."""
    work = tmp_path_factory.mktemp("readme")
    run_trial(shipped("close_range", {"time_limit_s": "1"}), 1, out=work / "run")
    (work / "runs").mkdir()
    for name in {n for b in programs() for n in re.findall(r"runs/(\w+)", b.values[0])}:  # type: ignore[attr-defined]
        (work / "runs" / name).symlink_to(work / "run")
    return work


def execute(*arguments: str, cwd: Path) -> str:
    done = subprocess.run(
        [sys.executable, *arguments], cwd=cwd, capture_output=True, text=True, check=False, timeout=200
    )
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr}"
    return done.stdout


@pytest.mark.parametrize("program", programs())
def test_a_program_runs(program: str, folder: Path) -> None:
    execute("-c", program, cwd=folder)


@pytest.mark.parametrize("sketch", list(blocks("python")))
def test_a_sketch_is_python(sketch: str) -> None:
    compile(sketch, "sketch", "exec")


def test_the_readme_has_a_program_of_ten_lines() -> None:
    (text, *_) = [b.values[0] for b in programs() if b.id.startswith("README.md")]  # type: ignore[attr-defined]
    assert "run_trial(" in text
    assert len([line for line in text.splitlines() if line.strip()]) <= 10


@pytest.mark.parametrize("text", [b for b in blocks("yaml") if "\nplan:" in b.values[0]])  # type: ignore[attr-defined]
def test_a_scene_loads(text: str, tmp_path: Path) -> None:
    file = tmp_path / "scene.yaml"
    file.write_text(text)
    assert load_scene(file).plan


def commands() -> list[object]:
    found = {
        match["arguments"].partition("#")[0].strip(): page.relative_to(ROOT)
        for page in PAGES
        for pattern in (_COMMAND, _INLINE)
        for match in pattern.finditer(page.read_text())
    }
    return [pytest.param(command, id=f"{page}: msrr {command}") for command, page in found.items()]


@pytest.mark.parametrize("command", commands())
def test_a_command_exists_with_these_options(command: str) -> None:
    """Parsed, not run. Names in capitals stand for something of the reader's."""
    program = typer.main.get_command(app)
    name, *arguments = (w for w in shlex.split(command) if not re.fullmatch(r"[][|.]+", w))
    with program.make_context("msrr", ["--help"], resilient_parsing=True) as context:
        chosen = program.get_command(context, name)  # type: ignore[attr-defined]
        assert chosen is not None, f"msrr has no command {name!r}"
        options = {o for parameter in chosen.params for o in parameter.opts}
        for word in arguments:
            if word.startswith("--"):
                assert word.partition("=")[0].rstrip("]") in options, f"msrr {name} has no option {word}"


def test_the_own_controller_is_an_example_of_forty_lines() -> None:
    assert len((ROOT / "examples" / "own_controller.py").read_text().splitlines()) <= 42


def test_the_own_controller_runs_as_a_program(tmp_path: Path) -> None:
    said = execute(str(ROOT / "examples" / "own_controller.py"), cwd=tmp_path)
    assert "docked" in said
