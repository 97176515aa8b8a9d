"""A replay runs the robot again from a log and compares everything that it does, bit for bit.

The robot gets what the log says that it got, in the same order: exposures with the pixels of the windows that
it asked for, sensor messages as they arrived, and the clock. Nothing else of the log reaches it. If its
decisions come out the same in a process that cannot import the simulator, it saw nothing else in the trial
either. The recording of a real robot would be replayed in the same way.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from msrr_bullet.log.reader import read_log
from msrr_bullet.replay.comparison import Comparison, ReplayReport, RobotFactory
from msrr_bullet.robot.autonomy import Autonomy


def replay(run: Path, robot: RobotFactory = Autonomy) -> ReplayReport:
    """Replay a run in this process.

    Args:
        run: Run folder or log file.
        robot: Builds the robot of a step of the plan.

    Raises:
        LogError: The log cannot be read.
        ReplayError: The log is not one of a trial.
    """
    log = read_log(run)
    with tempfile.TemporaryDirectory(prefix="msrr-replay-") as folder:
        return Comparison(log, log.header.unpacked(Path(folder)).scene, robot).run()
