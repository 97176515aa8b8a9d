"""What tests of several packages share: shipped scenes, programs, a user's photographs."""

from __future__ import annotations

import gc
import importlib.util
import math
import os
import resource
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import TypeVar

import pytest
from hypothesis import settings
from xdist.remote import Producer
from xdist.scheduler.loadfile import LoadFileScheduling

from msrr_bullet.sensors.preparation import prepare_cameras
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se2 import SE2, wrap_angle
from msrr_scenes.loading.load import load_scene
from msrr_scenes.specs.scene import Scene

#: Robots of the tests are as designed, unless a test is about how they were built: what a test sees has no
#: other cause than what it changes, and rendered trials take less time.
CALIBRATION: Mapping[str, str] = {"as_built": "perfect"}

#: Ideal unicycles and the true pose with errors: a trial in a fraction of a second, for what needs no pixels.
BLIND: Mapping[str, str] = {"plant": "unicycle", "perception": "parametric"}

#: Time of the loop of :func:`_reference` on a core for which the budgets of the tests are meant [s].
REFERENCE_S = 1.2e-4

ShippedScene = Callable[..., Scene]

T = TypeVar("T")

#: Examples are the same in every run, on every machine: a test fails for what was changed, never by chance.
settings.register_profile("fixed", derandomize=True, deadline=None)
settings.load_profile("fixed")


def pytest_configure(config: pytest.Config) -> None:
    """Compile all kernels once, before several workers would each compile them for themselves."""
    # A process that has loaded everything holds 140,000 objects that stay. To look for garbage among them for
    # every 700 new ones takes a fifth of the time of the tests.
    gc.set_threshold(50_000)
    if config.getoption("numprocesses", None) and not hasattr(config, "workerinput"):
        for grade in ("careful", "perfect"):  # lenses that distort, and ideal ones
            prepare_cameras(load_scene("close_range", {"as_built": grade}), print)


@pytest.fixture(scope="session")
def cost_s() -> Callable[[Callable[[], object]], float]:
    """Measure what a call costs on a core of a known speed [s], in times of a loop that does not change.

    Whatever else runs on a machine slows down both; the best of many short rounds is what the code costs.
    """

    def measure(work: Callable[[], object]) -> float:
        best = reference = math.inf
        for _ in range(300):
            times = [time.thread_time()]
            for _ in range(5):
                work()
            times.append(time.thread_time())
            _reference()
            times.append(time.thread_time())
            best, reference = min(best, (times[1] - times[0]) / 5), min(reference, times[2] - times[1])
        return best * REFERENCE_S / reference

    return measure


def _reference() -> float:
    return sum(0.5 * math.sqrt(i) for i in range(2_000))


@pytest.fixture(scope="session")
def shipped() -> ShippedScene:
    """Load a shipped scene for a trial: ``shipped("weak_lock", {"lock.strength_n": "60"})``.

    Robots are as designed; ``blind=True`` replaces contact and pixels by their models.
    """

    def load(name: str, overrides: Mapping[str, str] | None = None, *, blind: bool = False) -> Scene:
        return load_scene(name, {**CALIBRATION, **(BLIND if blind else {}), **(overrides or {})})

    return load


@pytest.fixture
def room() -> Callable[[int], AbstractContextManager[None]]:
    """Bound the size of files [bytes] for the duration of a ``with`` block, as a disk that gets full does."""

    @contextmanager
    def bounded(size: int) -> Iterator[None]:
        before = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
        try:
            yield
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, before)

    return bounded


@cache
def shipped_as_is(name: str) -> Scene:
    """Return a shipped scene as its file has it, read once for all tests."""
    return load_scene(name)


def pose_error(found: SE2, true: SE2) -> Array:
    """Return by how much place and heading of a pose are off, shape (3,) [m, m, rad]."""
    off = found.as_array() - true.as_array()
    off[2] = wrap_angle(float(off[2]))
    return off


def not_none(value: T | None) -> T:
    """Return a value that has to be there."""
    assert value is not None
    return value


def load_script(path: Path) -> ModuleType:
    """Return a program that belongs to no package as a module."""
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def photographs() -> Path:
    """Folder of photographs: ``mapping`` with its ``tags.txt``, ``rotation``, ``chessboard``."""
    if "MSRR_PHOTOGRAPHS" not in os.environ:
        pytest.skip("MSRR_PHOTOGRAPHS names no folder")  # the photographs may not be shipped with the tests
    return Path(os.environ["MSRR_PHOTOGRAPHS"])


#: Files that use the same mission, which takes several seconds: one worker runs them, and the mission once.
TOGETHER = {
    "tests/bullet/figures/test_mission_figures.py": "four units",
    "tests/bullet/timeline/test_mission_snapshots.py": "four units",
    "tests/bullet/timeline/test_palette.py": "four units",
    "tests/bullet/viewer/test_mission_pages.py": "four units",
    "tests/bullet/export/test_csv_files.py": "line of three",
    "tests/bullet/replay/test_coordinated_replayer.py": "line of three",
}


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Producer) -> LoadFileScheduling | None:
    """Give a worker whole files, as ``--dist loadfile`` does, and those of one mission to the same worker."""
    return _ByMission(config, log) if config.getoption("dist") == "loadfile" else None


class _ByMission(LoadFileScheduling):
    def _split_scope(self, nodeid: str) -> str:
        file = super()._split_scope(nodeid)
        return TOGETHER.get(file, file)
