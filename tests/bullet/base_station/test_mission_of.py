"""What a scene asks of its base station: shapes in their order, assembled units, or the steps of a plan."""

from __future__ import annotations

from msrr_bullet.base_station.base_station import BaseStation, mission_of
from msrr_scenes import load_scene
from msrr_scenes.messages.coordination import MissionState, UnitState


def test_shapes_follow_each_other_and_begin_with_what_is_assembled() -> None:
    scene = load_scene("reconfigure")
    mission = mission_of(scene)
    assert mission.holders == scene.holders
    assert mission.then is not None
    assert (mission.name, mission.then.name, mission.then.then) == ("tee of 6", "line of 6", None)
    assert not mission.then.holders, "they are known when the shape before is complete"


def test_steps_of_a_plan_are_tasks() -> None:
    plan = "[{undock: f}, {unit: f, name: back, to: a.left}]"
    scene = load_scene("reconfigure", {"shape": "null", "plan": plan})
    mission = mission_of(scene)
    assert (mission.shape, mission.then) == (None, None)
    assert [task.name for task in mission.tasks] == ["f", "back"]
    assert mission.holders == scene.holders


def test_assembled_units_are_docked_before_anything_is_heard() -> None:
    status = BaseStation(load_scene("reconfigure")).status
    assert (status.state, status.shape) == (MissionState.RUNNING, "tee of 6")
    assert {unit.state for unit in status.units} == {UnitState.DOCKED}
