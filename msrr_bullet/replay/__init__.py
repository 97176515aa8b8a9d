"""The record of a robot, and the proof that the robot does the same again from it."""

from msrr_bullet.replay.comparison import Mismatch, ReplayError, ReplayReport, RobotFactory
from msrr_bullet.replay.isolation import replay_isolated
from msrr_bullet.replay.recorded_robot import RecordedRobot
from msrr_bullet.replay.replayer import replay

__all__ = [
    "Mismatch",
    "RecordedRobot",
    "ReplayError",
    "ReplayReport",
    "RobotFactory",
    "replay",
    "replay_isolated",
]
