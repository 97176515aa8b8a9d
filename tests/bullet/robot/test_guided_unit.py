"""A unit that a base station leads: what it does with the routes that it is granted."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from msrr_bullet.robot.guided_unit import GuidedUnit
from msrr_perception.tracking.body_track import SeenPose, SeenPoses
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import OVERHEAD, GlobalPose, Phase, Twist, WheelOdometry
from msrr_scenes.messages.coordination import Authority, LegKind, RouteLeg, UnitMode
from msrr_scenes.specs.scene import Scene
from tests.bullet.robot.conftest import locked_pair


def test_a_route_without_legs_ends_where_the_unit_stands() -> None:
    """A base station grants such a route to a unit that stands in its place, and waits for its report."""
    scene = Scene.model_validate(
        {"name": "one", "units": {"a": {"number": 0}}, "cameras": {"overhead": {}}, "shape": {"line": 1}}
    )
    unit = GuidedUnit(scene, "a")
    unit.authorise(Authority("a", 1, 1, 0, 3_000_000_000, 0.0, (), None, False))
    assert unit.active
    assert unit.step(20_000_000).twist == Twist()
    report = unit.report(20_000_000)
    assert (report.route, report.mode, report.progress) == (1, UnitMode.STANDING, 0.0)
    assert not unit.active


def _seen(name: str, stamp_ns: int, x: float) -> SeenPose:
    pose = GlobalPose(name, stamp_ns, SE2(x, 0.0, 0.0), 1e-6 * np.eye(3))
    return SeenPose(pose, np.zeros((3, 3)))


def test_a_new_route_begins_with_what_was_seen_before() -> None:
    """What stands is looked at once a second or two; until then its collision monitor let everything pass."""
    post = {"shape": "cylinder", "radius_m": 0.08, "height_m": 0.2, "tag_id": 500, "pose": {"x_m": 0.4}}
    scene = Scene.model_validate(
        {
            "name": "one",
            "units": {"a": {"number": 0}},
            "obstacles": {"post": post},
            "cameras": {"overhead": {}},
            "shape": {"line": 1},
        }
    )
    unit = GuidedUnit(scene, "a")
    assert not unit.active, "it listens on standby, too"
    unit.see(SeenPoses(100_000_000, (_seen("a", 100_000_000, 0.0), _seen("post", 100_000_000, 0.4))))
    leg = RouteLeg(LegKind.TURN, (0.0, 0.0, 0.0), (), (), 1.0, 0.1)
    for route in (1, 2):
        unit.authorise(Authority("a", route, route, 0, 10_000_000_000, leg.end, (leg,), None, False))
        now_ns = 200_000_000 * route
        unit.step(now_ns)
        assert unit.route == route
        assert unit.arena is not None
        assert [o.name for o in unit.arena.obstacles] == ["post"]


def test_a_route_is_reported_from_its_first_command_to_its_end() -> None:
    scene = Scene.model_validate(
        {"name": "one", "units": {"a": {"number": 0}}, "cameras": {"overhead": {}}, "shape": {"line": 1}}
    )
    unit, leg = GuidedUnit(scene, "a"), RouteLeg(LegKind.TURN, (0.0, 0.0, 0.0), (), (), 1.0, 0.1)
    assert not unit.uses_camera(OVERHEAD)
    unit.authorise(Authority("a", 1, 1, 0, 60_000_000_000, leg.end, (leg,), None, False))
    geometry, yaw = scene.geometry("a"), 0.0
    told = []
    for now_ns in range(20_000_000, 4_000_000_000, 20_000_000):
        way = 0.5 * geometry.track / geometry.wheel_radius * yaw
        unit.receive(WheelOdometry("a", now_ns, -way, way))
        if now_ns % 100_000_000 == 0:
            pose = GlobalPose("a", now_ns, SE2(0.0, 0.0, yaw), 1e-6 * np.eye(3))
            unit.see(SeenPoses(now_ns, (SeenPose(pose, np.zeros((3, 3))),)))
        yaw += 0.02 * unit.step(now_ns).twist.w
        report = unit.report(now_ns)
        assert (report.seq, report.route, report.docked_to) == (1, 1, None)
        assert report.progress == pytest.approx(0.1 * yaw, abs=0.005)
        assert (unit.assembly is not None) is (unit.active and unit.arena is not None)
        told.append((report.mode, unit.active))
    changes = [now for before, now in pairwise(told) if now != before]
    assert told[0] == (UnitMode.STANDING, True), "it has not been seen yet"
    assert changes[0] == (UnitMode.DRIVING, True)
    assert {mode for mode, _ in changes[1:]} == {UnitMode.STANDING}
    assert changes[-1] == (UnitMode.STANDING, False)
    assert report.progress == leg.end
    assert yaw == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("share", [-1.0, 0.5, 1.0])
def test_a_locked_unit_opens_its_lock_only_for_a_route_of_which_the_way_out_is_free(share: float) -> None:
    scene = locked_pair()
    unit, leg = GuidedUnit(scene, "b", "a.rear"), RouteLeg(LegKind.BACK, (0.0, 0.0, 0.0), (), (), 0.0, 0.3)
    limit = share * leg.end
    unit.authorise(Authority("b", 4, 1, 0, 60_000_000_000, limit, (leg,), None, True))
    leaves = share == 1.0
    assert unit.active is leaves
    action, report = unit.step(20_000_000), unit.report(20_000_000)
    assert action.lock is not leaves
    assert action.phase is (Phase.RETREAT if leaves else Phase.DONE)
    assert unit.leaving is leaves
    assert (report.mode, report.docked_to) == (UnitMode.DOCKED, "a.rear"), "it is out when it is far enough"
    assert report.route == (4 if leaves else 0)
    older = Authority("b", 5, 1, 0, 60_000_000_000, leg.end, (leg,), None, True)
    unit.authorise(older)
    unit.step(40_000_000)
    assert unit.report(40_000_000).route == (4 if leaves else 0), "of the same number: it is not newer"
