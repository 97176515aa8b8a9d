"""The short drive in front of a port by which the estimator learns errors of camera and wheels."""

from __future__ import annotations

import math

from msrr_control.kinematics.elementwise import limit
from msrr_control.sequence.context import DockingContext
from msrr_control.sequence.tuning import CalibrationDriveSpec
from msrr_scenes.geometry.se2 import wrap_angle
from msrr_scenes.messages import Twist


def calibration_twist(c: DockingContext, spec: CalibrationDriveSpec) -> Twist | None:
    """Return the command of one instant of the drive; None once it has ended, or cannot go on.

    The memory of the stay counts the legs: the approach, each turn, and backing out.
    """
    pose, view, memory = c.observation.pose, c.view, c.memory
    if pose is None or view is None or memory.lasted(c.now_ns) > spec.time_s:
        return None
    if memory.leg == 0:
        if view.age > c.spec.lost_time_s:
            return None  # towards a port that is not seen the unit does not drive
        if view.gap > spec.near_m:
            return c.controller.step(c.control_inputs(pose))
        memory.leg = 1
    while memory.leg <= len(spec.headings_deg):
        off = wrap_angle(math.radians(spec.headings_deg[memory.leg - 1]) - view.yaw)
        if abs(off) > math.radians(spec.heading_tolerance_deg):
            return Twist(0.0, limit(spec.turn_per_s * off, -spec.turn_radps, spec.turn_radps))
        memory.leg += 1
    if view.gap >= spec.far_m - spec.arrived_m:
        return None
    return c.backing_out(pose, spec.far_m)
