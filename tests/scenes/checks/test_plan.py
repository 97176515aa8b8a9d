"""Checks of plan and faults: a step that can never begin and faults that exclude each other are named."""

from collections.abc import Mapping

import pytest

from msrr_scenes import load_scene
from msrr_scenes.errors import SceneError


def plan(*steps: str) -> str:
    pairs = (step.split(" to ") for step in steps)
    return f"[{', '.join(f'{{unit: {unit}, to: {to}}}' for unit, to in pairs)}]"


def faults(*given: str) -> str:
    return f"[{', '.join(f'{{{fault}}}' for fault in given)}]"


@pytest.mark.parametrize(
    ("overrides", "place", "mend"),
    [
        ({"plan": plan("a to b.rear", "c to b.rear")}, "plan.1.to", "name another port"),
        ({"plan": "[{move: a, pose: {x_m: 30}}]"}, "plan.0.pose", "(30, 0) lies outside the arena: x from"),
        (
            {"plan": "[{move: a, pose: {frame: b.rear, x_m: -0.5}}]"},
            "plan.0.pose.frame",
            "a pose in the world frame",
        ),
        (
            {"plan": "[{move: a, pose: {spread: {x_m: 0.1}}}]"},
            "plan.0.pose.spread",
            "to one pose, none is drawn",
        ),
        ({"plan": plan("a to b.rear", "a to c.rear")}, "plan.1.unit", "add `radio: {}` to the scene"),
        ({"plan": plan("a to b.rear", "a to b.rear")}, "plan.1.unit", "remove one of the steps"),
        ({"plan": plan("a to b.rear", "b to a.rear")}, "plan.1.to", "locked together by then"),
        ({"plan": plan("a to b.rear", "b to c.rear")}, "plan.1.unit", "let 'b' dock before it"),
        ({"plan": plan("a to b.rear", "c to a.rear", "b to c.rear")}, "plan.2.to", "remove the step"),
        (
            {
                "faults": faults(
                    "kind: seat_switch_stuck, unit: b, value: open",
                    "kind: seat_switch_stuck, unit: b, value: closed",
                )
            },
            "faults.1",
            "fault 0 is of this kind",
        ),
        (
            {
                "faults": faults(
                    "kind: port_plugged, unit: b, port: rear", "kind: port_plugged, unit: b, port: rear"
                )
            },
            "faults.1",
            "keep one of them",
        ),
        (
            {"faults": faults("kind: port_plugged, unit: b, port: rear, attempts: [4, 5]")},
            "faults.0.attempts",
            "none of these is among docking.attempts = 3",
        ),
        *(
            (
                {"faults": faults(f"kind: {kind}, {where}")},
                f"faults.0.{key}",
                f"{kind} acts on {acting}; name",
            )
            for kind, where, key, acting in (
                ("lock_jammed", "unit: b", "unit", "a"),
                ("seat_switch_stuck", "unit: a, value: open", "unit", "b"),
                ("port_plugged", "unit: b, port: left", "port", "b.rear"),
                ("camera_blackout", "camera: c/onboard, from_s: 0, to_s: 1", "camera", "overhead, a/onboard"),
            )
        ),
    ],
)
def test_a_step_that_never_begins_and_faults_that_contradict_each_other(
    overrides: Mapping[str, str], place: str, mend: str
) -> None:
    with pytest.raises(SceneError) as caught:
        load_scene("bystander", overrides)
    assert f": {place}: " in str(caught.value)
    assert mend in str(caught.value)


@pytest.mark.parametrize(
    "overrides",
    [
        {"plan": plan("a to b.rear", "c to b.left")},
        {"plan": plan("a to b.rear", "c to a.rear")},
        {
            "plan": plan("a to b.rear", "c to b.left"),
            "faults": faults(
                "kind: port_plugged, unit: b, port: rear", "kind: port_plugged, unit: b, port: left"
            ),
        },
        {
            "faults": faults(
                "kind: camera_blackout, camera: a/onboard, from_s: 0, to_s: 1",
                "kind: camera_blackout, camera: a/onboard, from_s: 2, to_s: 3",
            )
        },
    ],
)
def test_plans_and_faults_that_are_allowed(overrides: Mapping[str, str]) -> None:
    load_scene("bystander", overrides)
