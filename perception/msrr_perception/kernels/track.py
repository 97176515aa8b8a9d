"""Motion of a body that drives as a unit does; see :mod:`msrr_perception.tracking.body_track`."""

from __future__ import annotations

import math

import numpy as np

from msrr_perception.kernels.compiled import kernel
from msrr_perception.kernels.linear_algebra import cholesky, solve
from msrr_scenes.arrays import Array

#: Longest step of the integration [s].
_SEGMENT_S = 0.1


@kernel
def coast(
    state: Array,
    covariance: Array,
    dt: float,
    accelerating: float,
    turning: float,
    sideways: float,
    askew: float,
) -> tuple[Array, Array]:
    """Return mean and covariance of a body after ``dt`` on an arc of constant twist.

    Both accelerations are white noise (the continuous white noise acceleration of Bar-Shalom, Li and
    Kirubarajan, "Estimation with Applications to Tracking and Navigation", 2001, 6.2.2, along an arc). One
    that were constant between two measurements would follow from the way between them alone, and the speeds
    would swing from one measurement to the next.

    Args:
        state: ``(x, y, yaw, v, w)``, shape (5,) [m, rad, m/s, rad/s].
        covariance: Covariance of the state, shape (5, 5).
        dt: Duration [s].
        accelerating: Variance that the forward speed gains in time [m^2/s^3].
        turning: Variance that the yaw rate gains in time [rad^2/s^3].
        sideways: Variance of the motion across the wheels by the way driven [m].
        askew: Variance of the angle between where the body drives and where its tag points, which stays the
            same all the way [rad^2].
    """
    mean, P = state.copy(), covariance.copy()
    F, G = np.eye(5), np.zeros((5, 2))
    way, left = 0.0, dt
    while left > 1e-9:
        t = min(left, _SEGMENT_S)
        left -= t
        v, turn = mean[3], mean[4] * t
        half = 0.5 * turn
        chord = v * t * (math.sin(half) / half if abs(half) > 1e-4 else 1.0 - half * half / 6.0)
        c, s = math.cos(mean[2] + half), math.sin(mean[2] + half)
        # To first order in the turn within a segment.
        F[0, 2], F[1, 2], F[2, 4] = -chord * s, chord * c, t
        F[0, 3], F[1, 3] = t * c, t * s
        F[0, 4], F[1, 4] = -0.5 * t * chord * s, 0.5 * t * chord * c
        G[0, 0], G[1, 0], G[3, 0] = 0.5 * t * t * c, 0.5 * t * t * s, t
        G[0, 1], G[1, 1] = -chord * t * t * s / 6.0, chord * t * t * c / 6.0
        G[2, 1], G[4, 1] = 0.5 * t * t, t
        P = F @ P @ F.T
        for i in range(5):  # the mean accelerations
            for j in range(5):
                P[i, j] += accelerating / t * G[i, 0] * G[j, 0] + turning / t * G[i, 1] * G[j, 1]
        # How they vary about their means changes the way and the turn, but not the speeds.
        along, aside = accelerating * t**3 / 12.0, sideways * abs(v) * t
        P[0, 0] += c * c * along + s * s * aside
        P[1, 1] += s * s * along + c * c * aside
        P[0, 1] += c * s * (along - aside)
        P[1, 0] += c * s * (along - aside)
        P[2, 2] += turning * t**3 / 12.0
        way += chord
        mean[0] += chord * c
        mean[1] += chord * s
        mean[2] += turn
    # The product of an unknown turn and an unknown way leads to the side, which no derivative shows. When
    # both grow as the square of time, as from standstill, it is half the product of their ends.
    c, s = math.cos(mean[2]), math.sin(mean[2])
    along = c * c * P[0, 0] + 2.0 * c * s * P[0, 1] + s * s * P[1, 1]
    aside = 0.25 * along * P[2, 2] + askew * (way * way + along)
    P[0, 0] += s * s * aside
    P[1, 1] += c * c * aside
    P[0, 1] -= c * s * aside
    P[1, 0] -= c * s * aside
    return mean, P


@kernel
def fuse(state: Array, covariance: Array, measured: Array, R: Array) -> tuple[Array, Array, float]:
    """Return mean and covariance after a measured pose, and its squared Mahalanobis distance.

    Args:
        state: ``(x, y, yaw, v, w)``, shape (5,).
        covariance: Covariance of the state, shape (5, 5).
        measured: Measured ``(x, y, yaw)``, shape (3,).
        R: Covariance of the measurement, shape (3, 3).

    Returns:
        Mean, covariance and distance; an infinite distance, mean and covariance unchanged, where the
        innovation has no positive definite covariance.
    """
    innovation = measured - state[:3]
    innovation[2] -= 2.0 * math.pi * np.rint(innovation[2] / (2.0 * math.pi))
    S, L, solved = covariance[:3, :3] + R, np.zeros((3, 3)), np.empty(3)
    if not cholesky(S, L):
        return state, covariance, np.inf
    gain = np.empty((5, 3))
    for i in range(5):
        solve(L, covariance[i, :3].copy(), solved)
        gain[i] = solved
    solve(L, innovation, solved)
    distance = 0.0
    for i in range(3):
        distance += innovation[i] * solved[i]
    # Joseph's form keeps the covariance positive definite whatever the gain's rounding.
    left = np.eye(5)
    left[:, :3] -= gain
    return state + gain @ innovation, left @ covariance @ left.T + gain @ R @ gain.T, distance
