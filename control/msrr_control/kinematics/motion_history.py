"""The recent motion of a unit by its measured speeds, and the motion that commands under way will make."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from msrr_control.kinematics.elementwise import limit, number
from msrr_control.kinematics.unicycle import drive_components
from msrr_scenes.arrays import Array
from msrr_scenes.specs.vehicle import LimitsSpec

#: A remainder of a control period shorter than this is rounding [s].
_ROUNDING_S = 1e-9


class MotionInterval(NamedTuple):
    """A stretch of time [s] and the mean speeds in it [m/s, rad/s], floats or of shape (...)."""

    duration: float
    v: Any
    w: Any


class MotionHistory(NamedTuple):
    """How a unit has moved since the measurement that is still in use.

    Attributes:
        twist: Measured (v, w) of now, floats or of shape (...) [m/s, rad/s].
        past: Intervals between the instants before now, the last one first.
    """

    twist: tuple[Any, Any]
    past: tuple[MotionInterval, ...]

    @classmethod
    def starting(cls, twist: tuple[Any, Any]) -> MotionHistory:
        """Return the history of a unit that has always moved at (v, w) = ``twist`` [m/s, rad/s]."""
        return cls(twist, (MotionInterval(math.inf, *twist),))

    def advanced(self, twist: tuple[Any, Any], dt: float, age: Array) -> MotionHistory:
        """Return the history ``dt`` [s] later, without what lies before the measurement in use.

        Args:
            twist: Measured (v, w) of the new instant, floats or of shape (...) [m/s, rad/s].
            dt: Time since the last instant [s].
            age: Age of the measurement in use, shape (...) [s]; its time of exposure never goes back.
        """
        (v_before, w_before), (v, w) = self.twist, twist
        mean = MotionInterval(dt, 0.5 * v_before + 0.5 * v, 0.5 * w_before + 0.5 * w)
        kept: list[MotionInterval] = []
        missing = float(age.max() if age.ndim else age)
        for interval in (mean, *self.past):
            if missing <= 0.0:
                break
            kept.append(interval)
            missing -= interval.duration
        return MotionHistory(twist, tuple(kept))

    def since(self, age: Array) -> tuple[Any, Any]:
        """Return the length [m] and the angle [rad] by which the unit has moved in the last ``age`` [s]."""
        left = number(age)
        length = turn = 0.0
        for interval in self.past:
            within = limit(left, 0.0, interval.duration)
            length, turn = length + within * interval.v, turn + within * interval.w
            left = left - within
        return length, turn


def coast(
    twist: tuple[Any, Any],
    sent: Sequence[tuple[Any, Any]],
    latency: float,
    limits: LimitsSpec,
    period: float,
) -> tuple[tuple[Any, Any], Any, Any]:
    """Predict the motion until a command that is sent now reaches the drive.

    Args:
        twist: (v, w) of now, floats or of shape (...) [m/s, rad/s].
        sent: Commands (v, w) of the instants before now, the last one first, as many as :func:`under_way`
            says.
        latency: Time that a command takes to the drive [s].
        limits: What the drive can do.
        period: Time between two commands [s].

    Returns:
        The twist then, and the length [m] and the angle [rad] moved until then.
    """
    v, w = twist
    length = turn = 0.0
    for k in reversed(range(under_way(latency, period))):
        duration = min(period, latency - k * period)
        (v, mean_v), (w, mean_w) = drive_components((v, w), sent[k], limits, duration)
        length, turn = length + duration * mean_v, turn + duration * mean_w
    return (v, w), length, turn


def under_way(latency: float, period: float) -> int:
    """Return how many commands are in force between now and the arrival of one that is sent now."""
    return math.ceil((latency - _ROUNDING_S) / period) if latency > 0.0 else 0
