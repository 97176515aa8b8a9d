"""Routes keep a larger gap than collision monitors do, by as much as units stray from their tracks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from msrr_bullet.robot.collision_monitor import CollisionMonitor
from msrr_control.coordination.bodies import Body
from msrr_control.coordination.track import GAP_M
from msrr_perception.estimation.arena_tracker import ArenaTracker
from msrr_perception.pose.overhead_model import OverheadModel
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.loading.load import load_scene
from msrr_scenes.messages import ArenaEstimate, GlobalPose, MonitorState, Twist

#: How far two units that were built with care overshot the places at which they stopped [m].
STRAY_M = 0.024


@pytest.mark.parametrize("grade", ["perfect", "careful"])
def test_a_unit_may_turn_where_a_route_passes_another_one(grade: str) -> None:
    """Both may be off their tracks by what they overshoot; one that its monitor held would block both."""
    scene = load_scene("assemble_zigzag", {"as_built": grade})
    tracker = ArenaTracker(OverheadModel.from_scene(scene.told(), ("a", "b")))
    body = Body.of(scene.geometry("a"))
    for yaw in np.radians([0.0, 20.0, 45.0, 70.0]):
        X_WA = SE2(0.3, -0.2, float(yaw))
        apart = next(
            y for y in np.arange(0.2, 0.4, 1e-4) if body.gap(X_WA, SE2(0.3, -0.2 + y, 0.0)) > GAP_M - STRAY_M
        )
        poses = {"a": X_WA, "b": SE2(0.3, -0.2 + float(apart), 0.0)}
        estimates = {}
        for name, X_WU in poses.items():
            (seen,) = tracker.locate(GlobalPose(name, 0, X_WU, 1e-8 * np.eye(3))).poses
            estimates[name] = seen.estimated(0, X_WU, seen.pose.covariance)
        arena = ArenaEstimate(0, estimates["a"], None, (estimates["b"],), (), 0)
        arena = replace(arena, strain=tracker.model.errors.strain)
        for twist in (Twist(0.0, 0.05), Twist(0.0, -0.05)):
            decision = CollisionMonitor(scene.told(), "a").limit(twist, arena, 0)
            assert decision.state is not MonitorState.STOP, (grade, yaw, twist, decision)
