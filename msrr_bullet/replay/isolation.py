"""A replay in a new process that cannot import the simulator."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType

from msrr_bullet.replay.comparison import ReplayError, ReplayReport

#: Exit code of that process where a replay cannot be made, for the reason that it writes to standard error.
REFUSED = 2

#: Packages of the simulator.
SIMULATOR = ("pybullet", "pybullet_data", "pybullet_utils", "pybullet_envs")


def replay_isolated(run: Path, *, trust: bool = False) -> ReplayReport:
    """Replay a run in a new process that cannot import the simulator.

    ``trust`` is whether classes that the log names by import paths may be built, which runs their code.

    Raises:
        ReplayError: The replay cannot be made; the message gives the reason.
    """
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
    finished = subprocess.run(
        # -P: no module in the current folder can stand in for one of Python's or of ours.
        [sys.executable, "-P", "-m", "msrr_bullet.replay", str(run), *(["--trust"] if trust else [])],
        capture_output=True,
        text=True,
        env=environment,
        check=False,
    )
    said = finished.stderr.strip()
    if finished.returncode == REFUSED:
        raise ReplayError(said)  # an error of ours, which names the log
    if finished.returncode not in (0, 1) or not finished.stdout:
        # Of a traceback the last line says what went wrong.
        why = said.splitlines()[-1] if said else f"exit code {finished.returncode}"
        raise ReplayError(f"{run}: the log cannot be replayed: {why}")
    return ReplayReport.model_validate_json(finished.stdout)


class SimulatorBarrier(MetaPathFinder):
    """An import hook that refuses to import the simulator, whoever imports it."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Raise ImportError for the packages of the simulator, and leave all others to the usual finders."""
        if fullname.partition(".")[0] in SIMULATOR:
            raise ImportError(
                f"{fullname} is not available in a replay, which runs without the simulator; keep what "
                "imports it in a module that no replay needs, or import it inside a function"
            )
        return None

    @classmethod
    def install(cls) -> None:
        """Install the hook for the rest of this process.

        Raises:
            ReplayError: A package of the simulator has been imported already.
        """
        imported = [name for name in SIMULATOR if name in sys.modules]
        if imported:
            raise ReplayError(f"{', '.join(imported)} was imported before the replay began")
        sys.meta_path.insert(0, cls())
