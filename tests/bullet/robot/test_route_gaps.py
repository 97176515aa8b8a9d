"""Routes keep a larger gap than collision monitors do, by as much as units stray from their tracks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from msrr_bullet.base_station.base_station import coordination_setup
from msrr_bullet.robot.autonomy import Autonomy
from msrr_bullet.robot.collision_monitor import CollisionMonitor
from msrr_control.planning.route_planner import RoutePlanner
from msrr_control.staging.parameters import AssemblyParams
from msrr_control.staging.setup import AssemblySetup
from msrr_control.tracks.gaps import GAP_M
from msrr_perception.pose.overhead_model import OverheadModel
from msrr_perception.tracking.arena_tracker import ArenaTracker
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.loading.load import load_scene
from msrr_scenes.messages import ArenaEstimate, GlobalPose, MonitorState, ObstacleEstimate, Twist

#: Period of the control [ns].
DT_NS = 20_000_000

#: How far two units that were built with care overshot the places at which they stopped [m].
STRAY_M = 0.024


@pytest.mark.parametrize("grade", ["perfect", "careful", "workshop", "rough"])
def test_a_unit_may_turn_where_a_route_passes_another_one(grade: str) -> None:
    """Both may be off their tracks by what they overshoot; one that its monitor held would block both."""
    scene = load_scene("assemble_zigzag", {"as_built": grade})
    tracker = ArenaTracker(OverheadModel.from_scene(scene.told(), ("a", "b")))
    body = coordination_setup(scene.told()).lanes.body
    least = GAP_M + body.extra_gap - STRAY_M
    for yaw in np.radians([0.0, 20.0, 45.0, 70.0]):
        X_WA = SE2(0.3, -0.2, float(yaw))
        apart = next(y for y in np.arange(0.2, 0.4, 1e-4) if body.gap(X_WA, SE2(0.3, -0.2 + y, 0.0)) > least)
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


@pytest.mark.parametrize("sigma_m", [0.0, 0.005, 0.01, 0.02, 0.04])
def test_a_unit_may_drive_along_its_route_past_a_post_however_badly_that_is_known(sigma_m: float) -> None:
    """Its collision monitor, which takes the post to be nearer by two standard deviations, never stops it."""
    scene = load_scene("two_units").told()
    setup, params = AssemblySetup.of(scene, scene.docks[0]), AssemblyParams()
    planner = RoutePlanner(params.route, params.walls, params.pace, setup.box, setup.offset, setup.half_width)
    certain, known_to = 1e-10 * np.eye(3), np.diag([sigma_m**2, sigma_m**2, 0.0]) + 1e-10 * np.eye(3)
    post = ObstacleEstimate("post", 0, SE2(-0.3, 0.0), known_to, scene.obstacles["post"].radius_m)
    target = GlobalPose("b", 0, SE2(1.5, 0.0), certain)

    def seen_from(X_WU: SE2) -> ArenaEstimate:
        return ArenaEstimate(0, GlobalPose("a", 0, X_WU, certain), target, (), (post,), 0)

    route = planner.plan(setup.map_of(seen_from(SE2(-1.5, 0.02))), caution=1)
    assert route is not None
    for s in np.arange(setup.offset, float(route.path.length), 0.02):
        at = route.path.at(np.asarray(s))
        heading = float(at.heading)
        axle = at.point - setup.offset * np.array([np.cos(heading), np.sin(heading)])
        here = SE2(float(axle[0]), float(axle[1]), heading)
        decision = CollisionMonitor(scene, "a", scene.docks[0]).limit(Twist(0.2), seen_from(here), 0)
        assert decision.state is not MonitorState.STOP, (s, here, decision)


@pytest.mark.parametrize("grade", ["careful", "workshop", "rough"])
def test_a_route_stays_in_the_arena_however_far_off_the_overhead_camera_sees_the_unit(grade: str) -> None:
    """Poses as in a trial of grade rough in which a unit, seen 2.1 standard deviations off, drove out."""
    scene = load_scene("four_units_cross", {"as_built": grade, "perception": "parametric"}).told()
    robot = Autonomy(scene, next(step for step in scene.docks if step.unit == "d"))
    for k in range(5):
        for name, X_WU in (("d", SE2(-0.53, -1.03, 0.77)), ("b", SE2(0.51, 0.15, 0.07))):
            robot.receive(GlobalPose(name, k * DT_NS, X_WU, 1e-6 * np.eye(3)))
        robot.step(k * DT_NS)
    path = robot.estimates.path
    assert path is not None
    x, y = min(path.points, key=lambda point: point[1])
    errors = OverheadModel.from_scene(scene, ("d",)).errors_of(GlobalPose("d", 0, SE2(x, y), np.eye(3)))
    assert errors is not None
    sigma = float(np.sqrt((errors.own + errors.shared)[1, 1]))
    assert y - scene.control.guard.sigmas * sigma > scene.arena.y_m[0]
    assert y - scene.arena.y_m[0] < 0.3, "the route leads along the border"
