"""How a unit moves about an exposure whose time is in doubt, as its wheels tell it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from msrr_perception.kernels.compiled import kernel, subroutine
from msrr_scenes.arrays import Array

#: Time before and after an instant whose readings tell the velocity then [s], and the number of times in
#: either of them at which the angles are taken. The errors of encoders look like changes of the velocity,
#: which tell the clock of the camera: by two readings 20 ms from the instant, at 4096 ticks per turn, its
#: error was twice its standard deviation. Most pictures come 40 ms after their exposure, when all these
#: readings are there already.
ABOUT_S, _TIMES = 0.03, 3


class Rates(NamedTuple):
    """How a unit moves about the stamp of an exposure, by K instants with equal steps; K is odd.

    The exposure is thought to have been at the middle one. Between two instants the velocity changes
    linearly; before the first and after the last one it is constant.
    """

    first: float  # time from the stamp to the first instant [s]
    step: float  # time from one instant to the next [s]
    way: Array  # (K, 3) by which (x, y, yaw) in D change from the stamp to each instant [m, rad]
    velocity: Array  # (K, 3) of (x, y, yaw) in D at each instant [m/s, rad/s]


#: The rates of a unit that stands.
AT_REST = Rates(0.0, 1.0, np.zeros((1, 3)), np.zeros((1, 3)))


@kernel
def moved(rates: Rates, after: float, way: Array, velocity: Array) -> None:
    """Write how a unit has moved at an instant.

    Args:
        rates: How the unit moves about the stamp.
        after: Time from the stamp to the instant [s].
        way: Output, by which (x, y, yaw) in D change from the stamp to the instant, shape (3,) [m, rad].
        velocity: Output, velocity of (x, y, yaw) in D at the instant, shape (3,) [m/s, rad/s].
    """
    last = rates.way.shape[0] - 1
    since = after - rates.first
    i = int(min(max(since / rates.step, 0.0), max(last - 1.0, 0.0)))
    since -= i * rates.step
    lasts = min(max(since, 0.0), rates.step)
    for k in range(3):
        change = (rates.velocity[min(i + 1, last), k] - rates.velocity[i, k]) / rates.step
        velocity[k] = rates.velocity[i, k] + lasts * change
        way[k] = rates.way[i, k] + since * rates.velocity[i, k] + lasts * (since - 0.5 * lasts) * change


@kernel
def rates_by_wheels(
    readings: Array, exposed: float, step: float, steps: int, radii: Array, track: float, yaw: float
) -> Rates:
    """Return how a unit moves about the stamp of an exposure.

    Args:
        readings: Times from the stamp [s], in order, with the angles that the left and the right wheel have
            turned then [rad], shape (R, 3). Before the first and after the last one the wheels stand.
        exposed: Time from the stamp to when the exposure is thought to have been [s].
        step: Time from one instant to the next [s].
        steps: Number of instants before, and after the exposure.
        radii: Radii of the left and the right wheel, shape (2,) [m].
        track: Distance of the wheels [m].
        yaw: Yaw of the unit in D at the stamp [rad].
    """
    count = 2 * steps + 1
    way, velocity, speeds = np.zeros((count, 3)), np.zeros((count, 3)), np.zeros((count, 2))
    left = radii[0] * (_angle(readings, exposed, 1) - _angle(readings, 0.0, 1))
    right = radii[1] * (_angle(readings, exposed, 2) - _angle(readings, 0.0, 2))
    ahead, turn = 0.5 * (left + right), (right - left) / track
    way[steps, 0], way[steps, 1] = ahead * math.cos(yaw + 0.5 * turn), ahead * math.sin(yaw + 0.5 * turn)
    way[steps, 2] = turn
    for i in range(count):
        left = radii[0] * _speed(readings, exposed + (i - steps) * step, 1)
        right = radii[1] * _speed(readings, exposed + (i - steps) * step, 2)
        speeds[i, 0], velocity[i, 2] = 0.5 * (left + right), (right - left) / track
    _integrate(velocity, way, step, 2, 3)
    for i in range(count):
        at = yaw + way[i, 2]
        velocity[i, 0], velocity[i, 1] = speeds[i, 0] * math.cos(at), speeds[i, 0] * math.sin(at)
    _integrate(velocity, way, step, 0, 2)
    return Rates(exposed - steps * step, step, way, velocity)


@subroutine
def _integrate(velocity: Array, way: Array, step: float, first: int, end: int) -> None:
    """Write some columns of the way at all instants, from that at the middle one on."""
    middle = way.shape[0] // 2
    for k in range(first, end):
        for i in range(middle):
            after, before = middle + i, middle - i
            way[after + 1, k] = way[after, k] + 0.5 * step * (velocity[after, k] + velocity[after + 1, k])
            way[before - 1, k] = way[before, k] - 0.5 * step * (velocity[before, k] + velocity[before - 1, k])


@subroutine
def _speed(readings: Array, at: float, wheel: int) -> float:
    """Return the slope of the line nearest to the angles of a wheel about an instant [rad/s]."""
    total, squares = 0.0, 0.0
    for i in range(-_TIMES, _TIMES + 1):
        time = i * ABOUT_S / _TIMES
        total += time * _angle(readings, at + time, wheel)
        squares += time * time
    return total / squares


@subroutine
def _angle(readings: Array, at: float, wheel: int) -> float:
    """Return the angle of a wheel at an instant [rad]."""
    last = readings.shape[0] - 1
    if at <= readings[0, 0]:
        return float(readings[0, wheel])
    if at >= readings[last, 0]:
        return float(readings[last, wheel])
    i = 0
    while readings[i + 1, 0] < at:
        i += 1
    share = (at - readings[i, 0]) / (readings[i + 1, 0] - readings[i, 0])
    return float(readings[i, wheel] + share * (readings[i + 1, wheel] - readings[i, wheel]))
