"""A replay in a process that cannot import the simulator."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

from msrr_bullet.replay.comparison import ReplayError
from msrr_bullet.replay.isolation import SimulatorBarrier, replay_isolated


def test_the_simulator_cannot_be_imported_by_any_module(tmp_path: Path) -> None:
    (tmp_path / "indirect.py").write_text("def load():\n    import pybullet\n")
    code = """
import sys
from msrr_bullet.replay.isolation import SimulatorBarrier
assert not [m for m in sys.modules if m.startswith("pybullet")], "importing replay imports the simulator"
SimulatorBarrier.install()
import indirect
import importlib
names = ("pybullet_data", "pybullet_utils.bullet_client")
for attempt in (indirect.load, *(lambda name=name: importlib.import_module(name) for name in names)):
    try:
        attempt()
    except ImportError as error:
        assert "without the simulator; keep what imports it in a module that no replay needs" in str(error)
    else:
        raise AssertionError("imported")
"""
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def test_the_barrier_is_refused_where_the_simulator_was_imported_before(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "pybullet", ModuleType("pybullet"))
    monkeypatch.delitem(sys.modules, "pybullet_data", raising=False)
    monkeypatch.setattr(sys, "meta_path", [*sys.meta_path])
    with pytest.raises(ReplayError, match="pybullet was imported before"):
        SimulatorBarrier.install()


def test_no_module_in_the_current_folder_runs_in_a_replay(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Python puts the current folder first on the path unless it is told not to.

    What the other process says of a log that is not there is the error here.
    """
    for name in ("json", "pydantic", "mcap"):
        (tmp_path / f"{name}.py").write_text("print('taken over', flush=True)\nraise SystemExit(0)\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [path for path in sys.path if path])
    gone = tmp_path / "gone"
    with pytest.raises(
        ReplayError, match=f"^{gone}: cannot read the log: No such file or directory; name a "
    ):
        replay_isolated(gone)
