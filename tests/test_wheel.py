"""The wheel: what is in it, and that it docks in a fresh environment that knows nothing of the checkout."""

from __future__ import annotations

import os
import subprocess
import sys
import sysconfig
import venv
import zipfile
from email.parser import HeaderParser
from pathlib import Path

import pytest

from msrr_bullet.trial.result import TrialResult
from msrr_scenes.loading.load import shipped_scenes
from msrr_scenes.outcome import Outcome

ROOT = Path(__file__).resolve().parents[1]

#: The drawing of the unit and what belongs to it, as it lies in the wheel.
URDF = "msrr_scenes/urdf/"
PIP_INSTALL = ("install", "--quiet", "--disable-pip-version-check", "--no-compile")


def run(*command: str | Path, cwd: Path, **environment: str) -> str:
    """Run a program without the variables that could lead Python to the checkout; return what it said."""
    inherited = {k: v for k, v in os.environ.items() if not k.startswith(("PYTHON", "VIRTUAL_ENV"))}
    done = subprocess.run(
        [str(part) for part in command],
        cwd=cwd,
        env=inherited | environment,
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
        code = {n: archive.read(n) for n in names if n.endswith(".py") and not n.startswith(URDF)}
    packages = ("msrr_scenes", "msrr_perception", "msrr_control", "msrr_bullet")
    assert {name.partition("/")[0] for name in names if ".dist-info/" not in name} == set(packages)
    assert {f"{package}/py.typed" for package in packages} <= names
    assert {f"msrr_scenes/library/{scene}.yaml" for scene in shipped_scenes()} <= names
    assert {
        "msrr_scenes/urdf/unit.urdf",
        "msrr_scenes/urdf/round.urdf",
        "msrr_bullet/viewer/web/page.html",
        "msrr_bullet/reproduce/report/report.html.j2",
        "msrr_bullet/tolerance/page.html.j2",
    } <= names
    sources = {
        p.relative_to(root).as_posix(): p.read_bytes()
        for root in (ROOT, ROOT / "scenes", ROOT / "perception", ROOT / "control")
        for package in packages
        for p in (root / package).rglob("*.py")
    }
    assert code == sources
    assert not [name for name in names if "__pycache__" in name or name.startswith("tests")]
    assert metadata["Requires-Python"] == "<3.12,>=3.11"
    for requirement in metadata.get_all("Requires-Dist", []):
        assert ">=" in requirement, f"{requirement}: every dependency is bounded from below and above"
        assert "<" in requirement, f"{requirement}: every dependency is bounded from below and above"


@pytest.mark.nightly
def test_an_installed_wheel_docks(wheel: Path, tmp_path: Path) -> None:
    """Its dependencies are those of the tests, and its kernels run as they are written, not compiled."""
    fresh = tmp_path / "environment"
    venv.create(fresh, symlinks=True)
    install = (sys.executable, "-m", "pip", "--python", fresh / "bin" / "python", *PIP_INSTALL)
    run(*install, "--no-deps", wheel, cwd=tmp_path)
    (folder,) = fresh.glob("lib/python*/site-packages")
    # A path in a .pth file adds that folder, but not what its own .pth files add: the checkout stays outside.
    lent = {sysconfig.get_path("purelib"), sysconfig.get_path("platlib")}
    (folder / "dependencies.pth").write_text("".join(f"{path}\n" for path in sorted(lent)))
    assert_docks(fresh, tmp_path, "--set", "perception=parametric", NUMBA_DISABLE_JIT="1")


@pytest.mark.nightly
def test_a_wheel_with_its_own_dependencies_docks_by_images(wheel: Path, tmp_path: Path) -> None:
    """The dependencies are downloaded, and the kernels are compiled."""
    fresh = tmp_path / "environment"
    venv.create(fresh, with_pip=True, symlinks=True)
    constraints = ("--constraint", ROOT / "constraints.txt")
    run(fresh / "bin" / "python", "-m", "pip", *PIP_INSTALL, *constraints, wheel, cwd=tmp_path)
    assert_docks(fresh, tmp_path)


def assert_docks(fresh: Path, folder: Path, *options: str, **environment: str) -> None:
    """Dock once with what is installed in an environment, in which nothing may come from the checkout."""
    work = folder / "work"
    work.mkdir()
    where = (
        "import msrr_bullet, msrr_scenes.geometry.unit_geometry as a\n"
        "print(msrr_bullet.__file__, a.urdf_folder(), sep='\\n')"
    )
    for path in run(fresh / "bin" / "python", "-c", where, cwd=work).split():
        assert Path(path).is_relative_to(fresh), path

    dock = ("dock", "close_range", "--seed", "1", "--out", "docking", *options)
    said = run(fresh / "bin" / "msrr", *dock, cwd=work, **environment)
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
