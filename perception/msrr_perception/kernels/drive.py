"""Motion of the filter's state along encoder readings; see :mod:`msrr_perception.estimation.motion`."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from msrr_perception.kernels.compiled import inlined, kernel
from msrr_scenes.arrays import Array


class Drive(NamedTuple):
    """A drive and its noise in the form that kernels take; see ``MotionNoise``."""

    radius: float  # radius of the wheels [m]
    track: float  # distance between the wheels [m]
    front: float  # distance of the port's face ahead of U [m]
    contact_zone: float  # [m]
    wheel_variance: float  # variance along each wheel per metre
    sideways: float  # variance per metre
    contact: float  # variance per metre
    guidance: float  # variance per metre
    drift: float  # variance per second
    turn_drift: float  # variance per second
    tilt: float  # variance
    tilt_time: float  # [s]


@inlined
def add_slip(
    P: Array, drive: Drive, left: float, right: float, c: float, s: float, dt: float, x: float
) -> None:
    """Add the motion that the encoders do not measure to the covariance of (x, y, yaw).

    Args:
        P: Covariance; the upper left 3 x 3 is changed.
        drive: Drive and its noise.
        left: Distance driven by the left wheel, not negative [m].
        right: Distance driven by the right wheel, not negative [m].
        c: Cosine of the heading.
        s: Sine of the heading.
        dt: Duration [s].
        x: Position x of U in D before the step [m].
    """
    way, rest = 0.5 * (left + right), drive.drift * dt
    per_wheel, forward, side = drive.wheel_variance, rest, drive.sideways * way + rest
    if -x - drive.front < drive.contact_zone:  # the wheels may spin, and the holes guide the pins
        per_wheel += drive.guidance
        forward += drive.contact * way
        side += drive.guidance * way
    v_left, v_right = per_wheel * left, per_wheel * right
    forward += 0.25 * (v_left + v_right)
    turn = (v_left + v_right) / (drive.track * drive.track) + drive.turn_drift * dt
    both = 0.5 * (v_right - v_left) / drive.track  # forward and turn together
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


@kernel
def propagate(state: Array, covariance: Array, steps: Array, drive: Drive) -> tuple[Array, Array]:
    """Return mean and covariance of the state after K steps.

    Args:
        state: ``(x, y, yaw, pitch, roll, scale left, scale right)``, shape (7,).
        covariance: Covariance of the state, shape (7, 7).
        steps: Angles turned by the left and the right wheel [rad] and duration [s], shape (K, 3).
        drive: Drive and its noise.
    """
    mean, P, half_way = state.copy(), covariance.copy(), np.empty((7, 7))
    F = np.zeros((3, 7))  # first three rows of the transition matrix; the others are diagonal
    for k in range(steps.shape[0]):
        d_left, d_right, dt = drive.radius * steps[k, 0], drive.radius * steps[k, 1], steps[k, 2]
        x, yaw = mean[0], mean[2]
        way_left, way_right = d_left * (1.0 + mean[5]), d_right * (1.0 + mean[6])
        turn, forward = (way_right - way_left) / drive.track, 0.5 * (way_right + way_left)
        half = 0.5 * turn
        chord = forward * (math.sin(half) / half if abs(half) > 1e-4 else 1.0 - half * half / 6.0)
        c, s = math.cos(yaw + half), math.sin(yaw + half)
        keep = math.exp(-dt / drive.tilt_time)
        F[0, 0] = F[1, 1] = F[2, 2] = 1.0
        F[0, 2], F[1, 2] = -chord * s, chord * c
        for column in range(5, 7):
            d, rate = d_left, -d_left / drive.track
            if column == 6:
                d, rate = d_right, d_right / drive.track
            F[0, column] = 0.5 * (d * c - chord * s * rate)
            F[1, column] = 0.5 * (d * s + chord * c * rate)
            F[2, column] = rate
        for j in range(7):  # F P
            for i in range(3):
                half_way[i, j] = P[i, j] + F[i, 5] * P[5, j] + F[i, 6] * P[6, j]
                if i < 2:
                    half_way[i, j] += F[i, 2] * P[2, j]
            half_way[3, j], half_way[4, j] = keep * P[3, j], keep * P[4, j]
            half_way[5, j], half_way[6, j] = P[5, j], P[6, j]
        for i in range(7):  # (F P) F^T
            for j in range(3):
                P[i, j] = half_way[i, j] + half_way[i, 5] * F[j, 5] + half_way[i, 6] * F[j, 6]
                if j < 2:
                    P[i, j] += half_way[i, 2] * F[j, 2]
            P[i, 3], P[i, 4] = half_way[i, 3] * keep, half_way[i, 4] * keep
            P[i, 5], P[i, 6] = half_way[i, 5], half_way[i, 6]
        add_slip(P, drive, abs(d_left), abs(d_right), c, s, dt, x)
        P[3, 3] += (1.0 - keep * keep) * drive.tilt
        P[4, 4] += (1.0 - keep * keep) * drive.tilt
        mean[0], mean[1] = x + chord * c, mean[1] + chord * s
        turned = yaw + turn
        mean[2] = turned - 2.0 * math.pi * np.rint(turned / (2.0 * math.pi))
        mean[3] *= keep
        mean[4] *= keep
    return mean, P
