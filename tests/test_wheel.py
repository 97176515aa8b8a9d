"""The wheel: what is in it, and that it docks in a fresh environment that knows nothing of the checkout."""

from __future__ import annotations

import os
import subprocess
import sys
import venv
import zipfile
from collections.abc import Mapping
from email.parser import HeaderParser
from pathlib import Path

import pytest

from msrr_bullet.trial.result import TrialResult
from msrr_scenes.loading.load import shipped_scenes
from msrr_scenes.outcome import Outcome

ROOT = Path(__file__).resolve().parents[1]


def run(*command: str | Path, cwd: Path, environment: Mapping[str, str] | None = None) -> str:
    done = subprocess.run(
        [str(part) for part in command],
        cwd=cwd,
        env=None if environment is None else dict(environment),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
        timeout=240,
    )
    assert done.returncode == 0, f"{command} ended with {done.returncode}:\n{done.stdout}"
    return done.stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("dist")
    # The build backend is a dependency of the tests; an environment of its own would only take longer.
    run(sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", out, ROOT, cwd=out)
    (built,) = out.glob("*.whl")
    return built


def test_the_wheel_holds_everything_a_trial_needs_and_nothing_else(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
        metadata = HeaderParser().parsestr(
            archive.read(next(n for n in names if n.endswith(".dist-info/METADATA"))).decode()
        )
    packages = ("msrr_scenes", "msrr_perception", "msrr_control", "msrr_bullet")
    assert {name.partition("/")[0] for name in names if ".dist-info/" not in name} == set(packages)
    assert {f"{package}/py.typed" for package in packages} <= names
    assert {f"msrr_scenes/library/{scene}.yaml" for scene in shipped_scenes()} <= names
    assert {
        "msrr_scenes/urdf/unit.urdf",
        "msrr_bullet/viewer/page.html",
        "msrr_bullet/reproduce/report/report.html.j2",
    } <= names
    sources = {
        p.relative_to(room).as_posix()
        for room in (ROOT, ROOT / "scenes", ROOT / "perception", ROOT / "control")
        for package in packages
        for p in (room / package).rglob("*.py")
    }
    shipped_data = "msrr_scenes/urdf/"
    assert {n for n in names if n.endswith(".py") and not n.startswith(shipped_data)} == sources
    assert not [name for name in names if "__pycache__" in name or name.startswith("tests")]
    assert metadata["Requires-Python"] == "<3.12,>=3.11"
    for requirement in metadata.get_all("Requires-Dist", []):
        assert ">=" in requirement, f"{requirement}: every dependency is bounded from below and above"
        assert "<" in requirement, f"{requirement}: every dependency is bounded from below and above"


def test_an_installed_wheel_docks(wheel: Path, tmp_path: Path) -> None:
    fresh, work = tmp_path / "environment", tmp_path / "work"
    work.mkdir()
    venv.create(fresh, with_pip=True, symlinks=True)
    programs = fresh / "bin"
    # Whatever leads Python to the checkout stays outside.
    environment = {k: v for k, v in os.environ.items() if not k.startswith(("PYTHON", "VIRTUAL_ENV"))}
    quiet = ("--quiet", "--disable-pip-version-check", "--no-compile")
    constraints = ("--constraint", ROOT / "constraints.txt")
    run(
        programs / "python",
        "-m",
        "pip",
        "install",
        *quiet,
        *constraints,
        wheel,
        cwd=work,
        environment=environment,
    )

    where = (
        "import msrr_bullet, msrr_scenes.geometry.unit_geometry as a\n"
        "print(msrr_bullet.__file__, a.urdf_folder(), sep='\\n')"
    )
    for path in run(programs / "python", "-c", where, cwd=work, environment=environment).split():
        assert Path(path).is_relative_to(fresh), path

    dock = ("dock", "close_range", "--seed", "1", "--out", "docking")
    said = run(programs / "msrr", *dock, cwd=work, environment=environment)
    assert "docked" in said
    assert {p.name for p in (work / "docking").iterdir()} == {
        "trial.mcap",
        "result.json",
        "replay.html",
        "picture.png",
    }
    result = TrialResult.from_json((work / "docking" / "result.json").read_text())
    assert result.outcome is Outcome.DOCKED
    assert result.steps[0].pull_test_passed
