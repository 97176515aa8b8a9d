"""A unit that a base station leads: what it does with the routes that it is granted."""

from __future__ import annotations

from msrr_bullet.robot.guided_unit import GuidedUnit
from msrr_scenes.messages import Twist
from msrr_scenes.messages.coordination import Authority, UnitMode
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
