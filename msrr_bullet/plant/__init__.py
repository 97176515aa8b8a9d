"""The interface of the physics that moves and locks the units, and the plant without contact.

This package does not import PyBullet; the plant with contact is in :mod:`msrr_bullet.simulation`.
"""

from msrr_bullet.plant.kinematic_plant import KinematicPlant, Scenery
from msrr_bullet.plant.kinematic_port import CaptureRange, KinematicPort
from msrr_bullet.plant.limited_drive import LimitedDrive, wheel_speeds
from msrr_bullet.plant.lock_actuator import LockActuator, PullResult
from msrr_bullet.plant.plant import NoDockError, Plant, PortMechanism, tick_ns

__all__ = [
    "CaptureRange",
    "KinematicPlant",
    "KinematicPort",
    "LimitedDrive",
    "LockActuator",
    "NoDockError",
    "Plant",
    "PortMechanism",
    "PullResult",
    "Scenery",
    "tick_ns",
    "wheel_speeds",
]
