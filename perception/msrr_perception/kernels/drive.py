"""Motion of the filter's state along encoder readings; see :mod:`msrr_perception.motion.drive_motion`."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from msrr_perception.kernels.compiled import inlined, kernel
from msrr_scenes.arrays import Array


class Drive(NamedTuple):
    """A drive and its noise; see ``MotionNoise``."""

    radius: float  # radius of the wheels [m]
    track: float  # distance between the wheels [m]
    tips: float  # distance of the tips of the pins ahead of U [m]
    contact_zone: float  # [m]
    wheel_variance: float  # variance along each wheel per metre
    sideways: float  # variance across the wheels per metre
    contact: float  # variance along each wheel per metre
    guidance: float  # variance across the wheels per metre
    play: float  # variance along a wheel per metre, while the play of its gear is taken up
    drift: float  # variance per second
    turn_drift: float  # variance per second
    tilt: float  # variance
    tilt_time: float  # [s]
    strained: float  # variance of an error that radii and track have in common, per metre
    strained_turning: float  # variance of that error per radian
    strained_aside: float  # variance across the way per metre

    def packed(self) -> NDArray[np.void]:
        """Return the drive in the form that kernels take, a record of the same fields, shape (1,).

        To take its numbers out of a tuple, a call of a kernel would need a microsecond.
        """
        return np.array([tuple(self)], dtype=[(field, np.float64) for field in self._fields])


def is_at_port(x: float, y: float, tips: float, contact_zone: float) -> bool:
    """Return whether a unit at (x, y) in D is in the contact zone of the port.

    One that is farther to the side than its pins reach ahead, ``tips``, does not stand before the port: of
    the two poses that a single tag shows, the wrong one may be near to the plane of the face and far aside.
    """
    return -x - tips < contact_zone and abs(y) < tips


#: The same for kernels. From Python each process would compile it for itself.
_is_at_port = inlined(is_at_port)


@inlined
def add_slip(
    P: Array,
    drive: np.void,
    left: float,
    right: float,
    loose_left: float,
    loose_right: float,
    c: float,
    s: float,
    dt: float,
    x: float,
    y: float,
) -> None:
    """Add the motion that the encoders do not measure to the covariance of (x, y, yaw).

    Args:
        P: Covariance; the upper left 3 x 3 is changed.
        drive: Drive and its noise, an entry of :meth:`Drive.packed`.
        left: Distance driven by the left wheel, not negative [m].
        right: Distance driven by the right wheel, not negative [m].
        loose_left: 1 while the play of the left gear is taken up, else 0.
        loose_right: The same of the right one.
        c: Cosine of the heading.
        s: Sine of the heading.
        dt: Duration [s].
        x: Position x of U in D before the step [m].
        y: Position y of U in D before the step [m].
    """
    way, rest = 0.5 * (left + right), drive["drift"] * dt
    per_wheel, forward, side = drive["wheel_variance"], rest, drive["sideways"] * way + rest
    # At the port the wheels may spin, and the holes guide the pins.
    if _is_at_port(x, y, drive["tips"], drive["contact_zone"]):
        per_wheel += drive["contact"]
        side += drive["guidance"] * way
    v_left = (per_wheel + drive["play"] * loose_left) * left
    v_right = (per_wheel + drive["play"] * loose_right) * right
    forward += 0.25 * (v_left + v_right)
    turn = (v_left + v_right) / (drive["track"] * drive["track"]) + drive["turn_drift"] * dt
    both = 0.5 * (v_right - v_left) / drive["track"]  # forward and turn together
    cross = c * s * (forward - side)
    P[0, 0] += c * c * forward + s * s * side
    P[1, 1] += s * s * forward + c * c * side
    P[2, 2] += turn
    P[0, 1] += cross
    P[1, 0] += cross
    P[0, 2] += c * both
    P[2, 0] += c * both
    P[1, 2] += s * both
    P[2, 1] += s * both


@inlined
def strain(P: Array, variance: float) -> None:
    """Add a variance that both radii and the track have in common to their covariance."""
    for i in range(5, 8):
        for j in range(5, 8):
            P[i, j] += variance


@kernel
def propagate(mean: Array, P: Array, steps: Array, packed: NDArray[np.void]) -> None:
    """Move mean and covariance of the state by K steps, in place.

    Args:
        mean: Pose with tilt, relative errors of both radii and of the track, and anything that does not
            move, shape (n,).
        P: Covariance of the state, shape (n, n).
        steps: Angles turned by the left and the right motor [rad], duration [s], and 1 for each side whose
            play is taken up, shape (K, 5).
        packed: Drive and its noise, :meth:`Drive.packed`.
    """
    drive, n = packed[0], mean.shape[0]
    rows = np.empty((3, n))
    F = np.zeros((3, 8))  # first three rows of the transition matrix; the others are diagonal
    for k in range(steps.shape[0]):
        d_left, d_right, dt = drive["radius"] * steps[k, 0], drive["radius"] * steps[k, 1], steps[k, 2]
        x, y, yaw = mean[0], mean[1], mean[2]
        way_left, way_right = d_left * (1.0 + mean[5]), d_right * (1.0 + mean[6])
        track = drive["track"] * (1.0 + mean[7])
        turn, forward = (way_right - way_left) / track, 0.5 * (way_right + way_left)
        half = 0.5 * turn
        chord = forward * (math.sin(half) / half if abs(half) > 1e-4 else 1.0 - half * half / 6.0)
        c, s = math.cos(yaw + half), math.sin(yaw + half)
        keep = math.exp(-dt / drive["tilt_time"])
        F[0, 2], F[1, 2] = -chord * s, chord * c
        for column in range(5, 8):
            d, rate = d_left, -d_left / track
            if column == 6:
                d, rate = d_right, d_right / track
            elif column == 7:
                d, rate = 0.0, -turn / (1.0 + mean[7])
            F[0, column] = 0.5 * (d * c - chord * s * rate)
            F[1, column] = 0.5 * (d * s + chord * c * rate)
            F[2, column] = rate
        strained = drive["strained"] * abs(forward) + drive["strained_turning"] * abs(turn)
        if strained > 0.0:  # one half before the step and one after it: then steps may be cut in any way
            strain(P, 0.5 * strained)
        for j in range(n):  # F P
            for i in range(3):
                rows[i, j] = P[i, j] + F[i, 2] * P[2, j]
                rows[i, j] += F[i, 5] * P[5, j] + F[i, 6] * P[6, j] + F[i, 7] * P[7, j]
        for j in range(n):
            P[0, j], P[1, j], P[2, j] = rows[0, j], rows[1, j], rows[2, j]
            P[3, j] *= keep
            P[4, j] *= keep
        for i in range(n):  # (F P) F^T
            yaw_column = P[i, 2]
            for j in range(3):
                P[i, j] += F[j, 2] * yaw_column
                P[i, j] += F[j, 5] * P[i, 5] + F[j, 6] * P[i, 6] + F[j, 7] * P[i, 7]
            P[i, 3] *= keep
            P[i, 4] *= keep
        add_slip(P, drive, abs(d_left), abs(d_right), steps[k, 3], steps[k, 4], c, s, dt, x, y)
        if strained > 0.0:
            strain(P, 0.5 * strained)
            aside = drive["strained_aside"] * abs(forward)
            P[0, 0] += s * s * aside
            P[0, 1] -= c * s * aside
            P[1, 0] -= c * s * aside
            P[1, 1] += c * c * aside
        P[3, 3] += (1.0 - keep * keep) * drive["tilt"]
        P[4, 4] += (1.0 - keep * keep) * drive["tilt"]
        mean[0], mean[1] = x + chord * c, y + chord * s
        turned = yaw + turn
        mean[2] = turned - 2.0 * math.pi * np.rint(turned / (2.0 * math.pi))
        mean[3] *= keep
        mean[4] *= keep
