"""What encoders do not tell of the motion of a unit: random motion, and how its measured way is strained."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class MotionNoise:
    """Random motion that the encoders do not measure, and the strain of what measures poses.

    Attributes:
        slip: Motion along each wheel [m per square root of a metre driven].
        sideways: Motion across the wheels [m per square root of a metre driven].
        contact: Motion along each wheel in the contact zone, where one or both may spin while the unit stands
            [m per square root of a metre driven]. A wheel that spins at 5 cm/s is off by 2 mm within the
            40 ms between two exposures: as much as it turns.
        guidance: Motion sideways in the contact zone, where the holes guide the pins [m per square root of a
            metre driven].
        contact_zone: Gap between the tips of the pins and the face of the port below which the unit is in the
            contact zone [m].
        acceleration: Acceleration of each wheel, which moves it between two readings and after the newest one
            otherwise than they tell [m/s^2].
        drift: Motion of a unit at rest [m per square root of a second].
        turn_drift: Rotation of a unit at rest [rad per square root of a second].
        tilt_sigma: Standard deviation of pitch and roll [rad].
        tilt_time: Correlation time of pitch and roll [s].
        doubted: Speed by which each wheel, and the unit sideways, may be off where readings are doubted: one
            wheel spins on a smooth floor, or its encoder fails [m/s].
        pushed: Speed by which each wheel, and the unit sideways, may be off while another unit may push the
            target [m/s]. One that docked to it and tested its lock moved it by 12 mm/s and 1 deg/s.
        strain: Standard deviation of the error of lengths in what measures the pose, over their length. By as
            much [rad] the direction of a way is off.
    """

    slip: float = 0.0003
    sideways: float = 0.0002
    contact: float = 0.045
    guidance: float = 0.01
    contact_zone: float = 0.012
    acceleration: float = 0.2
    drift: float = 5e-5
    turn_drift: float = 3e-4
    tilt_sigma: float = math.radians(0.05)
    tilt_time: float = 1.0
    doubted: float = 0.2
    pushed: float = 0.03
    strain: float = 0.0


DEFAULT_NOISE = MotionNoise()
