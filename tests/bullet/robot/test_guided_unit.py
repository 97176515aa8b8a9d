"""A unit that a base station leads: what it does with the routes that it is granted."""

from __future__ import annotations

import numpy as np

from msrr_bullet.robot.guided_unit import GuidedUnit
from msrr_perception.tracking.body_track import SeenPose, SeenPoses
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import GlobalPose, Twist
from msrr_scenes.messages.coordination import Authority, LegKind, RouteLeg, UnitMode
from msrr_scenes.specs.scene import Scene


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
