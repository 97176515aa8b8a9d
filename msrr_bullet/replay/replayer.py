"""Runs the robot again from a log, and compares everything it does, bit for bit.

The robot is given what the log says it was given, in the same order: exposures with the pixels of the windows
that it asked for, sensor messages as they arrived, the clock. Nothing else of the log is shown to it. That
its decisions come out the same in a process that cannot import the simulator is the proof that it saw nothing
else in the trial either; a robot's real recording would be replayed in the same way.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType

from msrr_bullet.log.reader import read_log
from msrr_bullet.replay.comparison import Comparison, ReplayError, ReplayReport, RobotFactory
from msrr_bullet.robot.interface import Robot
from msrr_scenes.errors import MsrrError
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.scene import Scene

#: Packages of the simulator, which a replay does without.
SIMULATOR = ("pybullet", "pybullet_data", "pybullet_utils", "pybullet_envs")


def replay(run: Path, robot: RobotFactory | None = None) -> ReplayReport:
    """Replay a run in this process.

    Args:
        run: Run folder, or its log.
        robot: Builds the robot of a step; the default is :class:`msrr_bullet.robot.autonomy.Autonomy`.

    Raises:
        LogError: The log cannot be read.
        ReplayError: The log is not one of a trial.
    """
    log = read_log(run)
    with tempfile.TemporaryDirectory(prefix="msrr-replay-") as folder:
        scene = log.header.unpacked(Path(folder)).scene
        return Comparison(log, scene, robot or _autonomy).run()


def replay_isolated(run: Path) -> ReplayReport:
    """Replay a run in a new process that cannot import the simulator.

    Raises:
        ReplayError: The replay could not be made; says why.
    """
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
    done = subprocess.run(
        [sys.executable, "-m", "msrr_bullet.replay.replayer", str(run)],
        capture_output=True,
        text=True,
        env=environment,
        check=False,
    )
    if done.returncode not in (0, 1) or not done.stdout:
        raise ReplayError(f"{run}: the replay broke off: {done.stderr.strip()}")
    return ReplayReport.model_validate_json(done.stdout)


class SimulatorBarrier(MetaPathFinder):
    """Refuses to import the simulator, at any depth."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Raise ImportError for the simulator's packages, leave the others to the usual finders."""
        if fullname.partition(".")[0] in SIMULATOR:
            raise ImportError(f"{fullname} is not available in a replay, which runs without the simulator")
        return None

    @classmethod
    def install(cls) -> None:
        """Put the barrier up in this process, for good.

        Raises:
            ReplayError: Some simulator package was imported before.
        """
        there = [name for name in SIMULATOR if name in sys.modules]
        if there:
            raise ReplayError(f"{', '.join(there)} was imported before the replay began")
        sys.meta_path.insert(0, cls())


def _autonomy(scene: Scene, step: DockStep) -> Robot:
    from msrr_bullet.robot.autonomy import Autonomy

    return Autonomy(scene, step)


def _main(arguments: Sequence[str]) -> int:
    """Replay behind the barrier and write the report as JSON; for :func:`replay_isolated`."""
    try:
        SimulatorBarrier.install()
        report = replay(Path(arguments[0]))
    except MsrrError as error:
        sys.stderr.write(f"{error}\n")
        return 2
    sys.stdout.write(report.model_dump_json())
    return 0 if report.identical else 1


if __name__ == "__main__":
    sys.exit(_main(sys.argv[1:]))
