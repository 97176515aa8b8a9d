"""The software of a docking unit: perception, control, collision monitor. It never imports the simulator."""

from msrr_bullet.robot.autonomy import Autonomy
from msrr_bullet.robot.collision_monitor import CollisionMonitor, MonitorDecision
from msrr_bullet.robot.interface import ObservableRobot, Robot

__all__ = [
    "Autonomy",
    "CollisionMonitor",
    "MonitorDecision",
    "ObservableRobot",
    "Robot",
]
