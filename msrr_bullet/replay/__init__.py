"""Recording of all that robots and a base station get and do, and replay of it without the simulator."""

from msrr_bullet.replay.comparison import Mismatch, ReplayError, ReplayReport
from msrr_bullet.replay.isolation import replay_isolated
from msrr_bullet.replay.log_replay import replay
from msrr_bullet.replay.planned_replayer import RobotFactory
from msrr_bullet.replay.recorded_robot import RecordedRobot

__all__ = [
    "Mismatch",
    "RecordedRobot",
    "ReplayError",
    "ReplayReport",
    "RobotFactory",
    "replay",
    "replay_isolated",
]
