"""The true mounting of the onboard camera, calibration errors included."""

from __future__ import annotations

import math

from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.specs.faults import CameraMisaligned
from msrr_scenes.specs.scene import Scene


def camera_pose(scene: Scene, unit: str) -> SE3:
    """Return the true pose ``X_UB`` of a unit's camera body, whose x axis is the optical axis."""
    X_UB = scene.geometry(unit).frame("camera")
    for fault in scene.faults:
        if isinstance(fault, CameraMisaligned) and fault.unit == unit:
            X_UB = X_UB @ SE3.from_se2(SE2(0.0, 0.0, math.radians(fault.yaw_deg)))
    return X_UB
