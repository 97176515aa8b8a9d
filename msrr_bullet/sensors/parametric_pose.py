"""Perception without pixels: the true relative pose with stated errors.

It lives beside the plant, not in the perception room, because it reads truth. A trial that uses it says so in
its result; it exists to study controllers by the thousand and to attribute failures.
"""

from __future__ import annotations

import math

import numpy as np

from msrr_scenes.geometry.pinhole import PinholeCamera
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import Exposure, PoseMeasurement
from msrr_scenes.specs.plan import LosSpec
from msrr_scenes.specs.sensors import ParametricSpec

#: A stated error of zero would make the filter believe a measurement without question [m, rad].
LEAST_SIGMA = 1e-4


def edge_bearings(X_DC: SE2, los: LosSpec) -> tuple[float, float]:
    """Return the true bearings (left, right) [rad] of the LOS target's edges.

    Args:
        X_DC: The camera (x along its axis) in the dock frame.
        los: Half-width b and setback s_b of the target.
    """
    edges = np.array([[los.setback_m, los.half_width_m], [los.setback_m, -los.half_width_m]])
    p_C = X_DC.inverse().act(edges)
    return math.atan2(p_C[0, 1], p_C[0, 0]), math.atan2(p_C[1, 1], p_C[1, 0])


def measure(
    exposure: Exposure,
    X_DU: SE2,
    X_UC: SE2,
    camera: PinholeCamera,
    los: LosSpec,
    spec: ParametricSpec,
    rng: np.random.Generator,
) -> PoseMeasurement | None:
    """Draw one measurement; None when neither edge of the target is inside the field of view.

    Args:
        exposure: Camera, frame, time.
        X_DU: True pose of the unit in the dock frame.
        X_UC: Camera in the unit, in the plane (x along its axis).
        camera: Its field of view.
        los: The line-of-sight target.
        spec: Standard deviations.
        rng: Stream of this camera; five numbers are drawn for every exposure, seen or not.
    """
    noise = rng.standard_normal(5)
    sigma_yaw = math.radians(spec.sigma_yaw_deg)
    sigma_bearing = math.radians(spec.sigma_bearing_deg)
    true = edge_bearings(X_DU @ X_UC, los)
    seen = [abs(a) <= camera.half_fov for a in true]
    if not any(seen):
        return None
    left, right = (
        a + sigma_bearing * float(n) if s else None for a, n, s in zip(true, noise[3:], seen, strict=True)
    )
    X_measured = SE2(
        X_DU.x + spec.sigma_xy_m * float(noise[0]),
        X_DU.y + spec.sigma_xy_m * float(noise[1]),
        X_DU.yaw + sigma_yaw * float(noise[2]),
    )
    sigma_xy = max(spec.sigma_xy_m, LEAST_SIGMA)
    covariance = np.diag([sigma_xy**2, sigma_xy**2, max(sigma_yaw, LEAST_SIGMA) ** 2])
    return PoseMeasurement(exposure, X_measured, covariance, (left, right))
