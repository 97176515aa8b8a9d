"""The shape of the project: imports run one way, packages explain themselves, no file names a machine."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterable, Iterator
from functools import cache
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]

#: Package -> the folder it is in, and what it may import of the project and of the simulator.
PACKAGES = {
    "msrr_scenes": (ROOT / "scenes", {"msrr_scenes"}),
    "msrr_perception": (ROOT / "perception", {"msrr_perception", "msrr_scenes"}),
    "msrr_control": (ROOT / "control", {"msrr_control", "msrr_scenes"}),
    "msrr_bullet": (
        ROOT,
        {"msrr_bullet", "msrr_perception", "msrr_control", "msrr_scenes", "pybullet", "pybullet_data"},
    ),
}
GUARDED = {
    "msrr_scenes",
    "msrr_perception",
    "msrr_control",
    "msrr_bullet",
    "pybullet",
    "pybullet_data",
    "tests",
}

#: The files that talk to whoever started the program.
COMMAND_LINE = {"app.py", "exit_codes.py"}


def sources(package: str) -> Iterator[Path]:
    yield from sorted((PACKAGES[package][0] / package).rglob("*.py"))


@cache
def nodes(path: Path) -> tuple[ast.AST, ...]:
    """Return what the code of a file is made of, read once for all tests."""
    return tuple(ast.walk(ast.parse(path.read_text())))


def imported(path: Path) -> Iterator[str]:
    """Yield the top-level name of everything imported, at any depth of the code."""
    for node in nodes(path):
        if isinstance(node, ast.Import):
            yield from (alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            yield (node.module or "").partition(".")[0]


def tracked() -> list[Path]:
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True)
    return [path for name in listed.stdout.split("\0") if name and (path := ROOT / name).is_file()]


def texts() -> Iterator[tuple[Path, str]]:
    for path in tracked():
        try:
            yield path, path.read_text(encoding="utf-8")
        except UnicodeDecodeError:
            continue  # a picture


@pytest.mark.parametrize("package", PACKAGES)
def test_imports_run_one_way(package: str) -> None:
    allowed = PACKAGES[package][1]
    for path in sources(package):
        foreign = set(imported(path)) & GUARDED - allowed
        assert not foreign, f"{path.relative_to(ROOT)} imports {', '.join(sorted(foreign))}"


def test_what_is_imported_is_a_dependency_and_nothing_else_is() -> None:
    def normal(name: str) -> str:
        return re.sub(r"[-_.]+", "-", name).lower()

    names = {name for package in PACKAGES for path in sources(package) for name in imported(path)}
    names.discard("pydantic_core")  # comes with pydantic, which pins it
    foreign = names - sys.stdlib_module_names - PACKAGES.keys()
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]

    def distributions(texts: Iterable[str]) -> set[str]:
        return {normal(re.split(r"[^\w.-]", text)[0]) for text in texts}

    # Extras need not be installed; they are imported by the names of their distributions, but for an ending.
    # The site is built by scripts, which are no packages.
    named = project["optional-dependencies"].items()
    extras = distributions(text for name, extra in named if name != "docs" for text in extra)
    extras = {extra.removesuffix("-sdk") for extra in extras}
    optional = {name for name in foreign if normal(name) in extras}
    assert {normal(name) for name in optional} == extras
    providers = packages_distributions()
    needed = {normal(provider) for name in foreign - optional for provider in providers[name]}
    assert needed == distributions(project["dependencies"])


def test_the_linters_contracts_are_kept() -> None:
    """Through any number of steps, which the test above does not follow."""
    done = subprocess.run(
        [Path(sys.executable).with_name("lint-imports"), "--no-cache"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout
    assert re.search(r"Contracts: [1-9]\d* kept, 0 broken", done.stdout), done.stdout


def test_the_robot_runs_where_there_is_no_simulator() -> None:
    """Not by what is written in the files, but in a process: nothing on the way loads PyBullet."""
    code = (
        "import importlib, pkgutil, sys; sys.modules['pybullet'] = None\n"
        "import msrr_bullet.replay.log_replay, msrr_bullet.recordings.run\n"
        "for name in ('msrr_scenes', 'msrr_perception', 'msrr_control', 'msrr_bullet.robot',"
        " 'msrr_bullet.plant', 'msrr_bullet.collision'):\n"
        "    path = importlib.import_module(name).__path__\n"
        "    for m in pkgutil.walk_packages(path, name + '.'): importlib.import_module(m.name)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_control_never_loads_a_library_for_images() -> None:
    code = (
        "import pkgutil, importlib, sys, msrr_control as package\n"
        "for m in pkgutil.walk_packages(package.__path__, 'msrr_control.'): importlib.import_module(m.name)\n"
        "print(sorted({'cv2', 'pupil_apriltags', 'pybullet', 'msrr_perception', 'fcl'} & set(sys.modules)))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.stdout.strip() == "[]", done.stdout + done.stderr


def test_a_trial_without_a_log_loads_neither_what_writes_one_nor_scipy() -> None:
    names = ("foxglove", "mcap.writer", "scipy")
    code = f"import sys, msrr_bullet.run; print(sorted(set({names}) & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.stdout.splitlines()[-1] == "[]", done.stdout + done.stderr


@pytest.mark.parametrize("folder", ["scenes", "perception", "control", "msrr_bullet", "urdf"])
def test_every_top_level_folder_explains_itself(folder: str) -> None:
    readme = ROOT / folder / "README.md"
    assert readme.is_file(), f"{folder} has no README.md"
    assert len(readme.read_text().splitlines()) >= 10


@pytest.mark.parametrize("package", PACKAGES)
def test_every_package_is_typed(package: str) -> None:
    assert (PACKAGES[package][0] / package / "py.typed").is_file()


def test_files_keep_a_readable_size() -> None:
    lengths = {p: len(p.read_text().splitlines()) for package in PACKAGES for p in sources(package)}
    long = {str(p.relative_to(ROOT)): n for p, n in lengths.items() if n > 300}
    assert not [n for n in long.values() if n > 400], long
    assert len(long) <= 0.05 * len(lengths), long


def test_no_drawer_for_odds_and_ends() -> None:
    names = {p.stem for package in PACKAGES for p in sources(package)}
    assert not names & {"utils", "util", "helpers", "common", "misc", "base"}


def test_libraries_print_nothing() -> None:
    """What they have to say they return, raise or log; only the command line speaks."""
    for package in PACKAGES:
        for path in sources(package):
            if path.name in COMMAND_LINE:
                continue
            calls = [
                node.lineno
                for node in nodes(path)
                if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "print"
            ]
            assert not calls, f"{path.relative_to(ROOT)} prints in line {calls[0]}"


#: Folder of tests -> the package whose tests it holds.
TESTED = {
    "scenes": "msrr_scenes",
    "perception": "msrr_perception",
    "control": "msrr_control",
    "bullet": "msrr_bullet",
}


def test_tests_stand_beside_the_packages_that_they_test() -> None:
    """``tests/<folder>/<package>/test_*.py`` for every package, and no folder that mirrors none."""
    for folder, package in TESTED.items():
        packages = {p.parent.name for p in (PACKAGES[package][0] / package).glob("*/__init__.py")}
        folders = {p.parent.name for p in (ROOT / "tests" / folder).glob("*/test_*.py")}
        assert packages - folders == set(), f"packages of {package} without tests of their own"
        assert folders - packages == set(), f"folders in tests/{folder} that mirror no package of {package}"


def test_nothing_of_one_machine_is_in_the_project() -> None:
    """No path of a home or of this checkout, no host of a package index, no address of a private network."""
    here = [re.escape(f"{path}/") for path in (ROOT, Path.home(), Path(sys.prefix))]
    forbidden = re.compile(
        "|".join(
            [
                *here,
                r"/(?:home|Users)/[a-z]",
                r"--?(?:extra-)?index[-]url|--trusted-host|--find-links",
                r"https?://[^\s/\"')]*/(?:simple|pypi|artifactory|nexus)\b",
                r"https?://[\w.-]+\.(?:internal|local|corp|lan|intranet)\b",
                r"(?<!==)\b(?:10|192\.168|172\.(?:1[6-9]|2\d|3[01]))\.\d{1,3}\.\d{1,3}\b(?!\.\d*[a-z])",
            ]
        )
    )
    for path, text in texts():
        if path != Path(__file__).resolve():
            found = forbidden.search(text)
            assert found is None, f"{path.relative_to(ROOT)} holds {found.group()!r}"


def test_constraints_are_versions_and_nothing_else() -> None:
    lines = (ROOT / "constraints.txt").read_text().splitlines()
    strange = [line for line in lines if not re.fullmatch(r"(#.*|[A-Za-z0-9_.-]+==[0-9][\w.+!]*|)", line)]
    assert not strange
    names = [line.partition("==")[0].lower().replace("_", "-") for line in lines if "==" in line]
    assert len(names) == len(set(names))
