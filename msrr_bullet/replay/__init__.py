"""Recording of everything that a robot gets and does, and replay of a recording without the simulator."""

from msrr_bullet.replay.comparison import Mismatch, ReplayError, ReplayReport
from msrr_bullet.replay.isolation import replay_isolated
from msrr_bullet.replay.recorded_robot import RecordedRobot
from msrr_bullet.replay.replayer import RobotFactory, replay

__all__ = [
    "Mismatch",
    "RecordedRobot",
    "ReplayError",
    "ReplayReport",
    "RobotFactory",
    "replay",
    "replay_isolated",
]
