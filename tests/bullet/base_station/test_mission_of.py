"""What a scene asks of its base station: shapes in their order, assembled units, or the steps of a plan."""

from __future__ import annotations

from pathlib import Path

import pytest

from msrr_bullet.base_station.base_station import BaseStation, check_mission, coordination_setup, mission_of
from msrr_perception.pose.overhead_model import OverheadModel
from msrr_scenes import load_scene
from msrr_scenes.errors import SceneError
from msrr_scenes.messages.coordination import MissionState, UnitState


def test_shapes_follow_each_other_and_begin_with_what_is_assembled() -> None:
    scene = load_scene("reconfigure")
    mission = mission_of(scene)
    assert mission.holders == scene.holders
    assert mission.then is not None
    assert (mission.name, mission.then.name, mission.then.then) == ("tee of 6", "line of 6", None)
    assert not mission.then.holders, "they are known when the shape before is complete"


def test_a_plan_keeps_its_steps() -> None:
    plan = "[{undock: f}, {unit: f, name: back, to: a.left}]"
    scene = load_scene("reconfigure", {"shape": "null", "plan": plan})
    mission = mission_of(scene)
    assert (mission.shape, mission.then) == (None, None)
    assert [step.label for step in mission.steps] == ["f", "back"]
    assert mission.holders == scene.holders


def test_a_plan_that_closes_a_lane_is_refused_before_any_trial(tmp_path: Path) -> None:
    """On a way round from the left of u0 to behind it, where the last unit stands in front of u3's port."""
    tree = {"u1": "u0.left", "u2": "u1.rear", "u4": "u2.right", "u5": "u4.rear", "u6": "u5.rear"}
    units = "".join(f"  u{k}: {{number: {k}}}\n" for k in range(1, 7) if k != 3)
    path = tmp_path / "round.yaml"
    path.write_text(f"""\
arena: {{x_m: [-3, 3], y_m: [-3, 3]}}
units:
  u0: {{number: 0}}
  u3: {{number: 3, pose: {{x_m: -2, y_m: -2}}}}
  u7: {{number: 7, pose: {{x_m: 2, y_m: -2}}}}
{units}
cameras: {{overhead: {{height_m: 6.5}}}}
assembled: [{", ".join(f"{unit}.front-{port}" for unit, port in tree.items())}]
plan: [{{unit: u7, to: u6.right}}, {{unit: u3, to: u0.rear}}]
""")
    with pytest.raises(SceneError, match=r"plan: step 'u3' cannot be done: 'u7' stands .* since step 'u7'"):
        check_mission(load_scene(path))
    check_mission(load_scene(path, {"plan.0.after": "[]", "plan.1.after": "[]"}))


#: Two units in the middle of an arena of which a low camera sees a part.
NEAR = {"units.a.pose": "{x_m: -0.3}", "units.b.pose": "{x_m: 0.5}"}


def test_a_unit_is_not_sent_to_where_it_is_not_seen() -> None:
    """Inside the arena, outside the picture: it drove between waiting places, and gave up."""
    plan = {**NEAR, "plan": "[{move: a, pose: {x_m: 0, y_m: 0.8}}]"}
    check_mission(load_scene("two_units_free", plan))
    with pytest.raises(SceneError, match=r"plan\.0\.pose: \(0, 0\.8\) .* overhead camera sees"):
        check_mission(load_scene("two_units_free", {**plan, "cameras.overhead.height_m": "1.6"}))


def test_the_largest_top_tag_is_seen_wherever_units_are_sent() -> None:
    low = {**NEAR, "cameras.overhead.height_m": "1.6", "plan": "[{move: a}]", "tags.top_m": "0.04"}
    larger = {**low, "units.b.tag_sizes_m": "{tag_top: 0.1}"}
    small, large = (coordination_setup(load_scene("two_units_free", o)).finder.box for o in (low, larger))
    assert large[1] < small[1] - 0.01


def test_routes_keep_inside_of_the_arena_by_what_a_unit_may_be_off_there() -> None:
    """In an arena that is seen as a whole; at the border of what is seen, a unit is in the picture or not."""
    arena = (-2.25, 2.25, -1.75, 1.75)
    for grade in ("perfect", "careful", "workshop", "rough"):
        scene = load_scene("assemble_cross", {"as_built": grade})
        setup = coordination_setup(scene)
        sigma_x, sigma_y = OverheadModel.from_scene(scene, scene.units).place_sigma("a", arena)
        for edge, bound, sigma in zip(arena, setup.finder.inner, 2 * [sigma_x] + 2 * [sigma_y], strict=True):
            room = abs(edge - bound) + setup.lanes.spec.border_m
            assert room == pytest.approx(max(2.0 * sigma, setup.lanes.spec.border_m)), grade
    seen = {
        g: coordination_setup(load_scene("sixteen", {"as_built": g})).finder.inner
        for g in ("careful", "workshop")
    }
    assert seen["workshop"][:2] != seen["careful"][:2]
    assert seen["workshop"][2:] == seen["careful"][2:]


def test_assembled_units_are_docked_before_anything_is_heard() -> None:
    status = BaseStation(load_scene("reconfigure")).status
    assert (status.state, status.shape) == (MissionState.RUNNING, "tee of 6")
    assert {unit.state for unit in status.units} == {UnitState.DOCKED}
