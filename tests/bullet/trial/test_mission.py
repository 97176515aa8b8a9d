"""A mission: order of the steps, steps at the same time, and what the failure of one does to the others."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from msrr_bullet.log.records import StepStart
from msrr_bullet.trial.result import TrialResult
from msrr_bullet.trial.trial import Trial
from msrr_scenes.errors import SceneError
from msrr_scenes.loading.load import load_scene
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.scene import Scene

SCENE = """
description: Three units dock to a fourth one at the same time, from in front of its ports.
perception: parametric
units:
  b: {{number: 1, pose: {{x_m: 0.4}}}}
  a: {{number: 0, pose: {{frame: b.rear, x_m: -0.30}}}}
  c: {{number: 2, pose: {{frame: b.left, x_m: -0.40}}}}
  d: {{number: 3, pose: {{frame: b.right, x_m: -0.50}}}}
plan:
{plan}
"""
AT_ONCE = """
  - {unit: a, to: b.rear, after: []}
  - {unit: c, to: b.left, after: []}
  - {unit: d, to: b.right, after: []}
"""


def mission(folder: Path, plan: str, **overrides: str) -> Scene:
    path = folder / "mission.yaml"
    path.write_text(SCENE.format(plan=plan))
    return load_scene(path, overrides)


Load = Callable[..., Scene]


class Starts:
    """Keeps the time at which each step begins."""

    def __init__(self) -> None:
        self.stamps: dict[int, int] = {}

    def write(self, _topic: str, stamp_ns: int, message: object) -> None:
        if isinstance(message, StepStart):
            self.stamps[message.index] = stamp_ns

    def window(self, *_: object) -> None:
        """Ignore pixels."""

    def close(self) -> None:
        """Nothing to close."""


def run(scene: Scene) -> tuple[TrialResult, dict[int, int]]:
    recorder = Starts()
    return Trial(scene, 1, recorder=recorder).run(), recorder.stamps


@pytest.mark.parametrize("plant", ["bullet", "unicycle"])
def test_steps_without_an_order_are_carried_out_at_the_same_time(tmp_path: Path, plant: str) -> None:
    """Together they take as long as the longest of them alone, and each one docks as if it were alone."""
    together, starts = run(mission(tmp_path, AT_ONCE, plant=plant))
    assert together.docked
    assert starts == {0: 0, 1: 0, 2: 0}
    assert all(step.pull_test_passed for step in together.steps)
    one_by_one, _ = run(mission(tmp_path, AT_ONCE.replace(", after: []", ""), plant=plant))
    for step, single in zip(together.steps, one_by_one.steps, strict=True):
        assert single.docked
        assert step.ended_s == pytest.approx(single.ended_s - single.started_s, abs=0.25)
    assert together.duration_s < 0.6 * one_by_one.duration_s


def test_a_step_begins_when_those_before_it_have_docked(tmp_path: Path) -> None:
    plan = """
  - {unit: a, to: b.rear, after: []}
  - {unit: c, to: b.left, after: [], name: left}
  - {unit: d, to: b.right, after: [a, left]}
"""
    result, starts = run(mission(tmp_path, plan, plant="unicycle"))
    a, c, d = result.steps
    assert result.docked
    assert starts[0] == starts[1] == 0
    assert d.started_s == starts[2] * 1e-9 == max(a.ended_s, c.ended_s)


def test_a_step_that_fails_holds_up_those_after_it_alone(tmp_path: Path) -> None:
    """The port of the first unit is plugged; the second does not wait for it, the third does."""
    plan = """
  - {unit: a, to: b.rear, after: []}
  - {unit: c, to: b.left, after: []}
  - {unit: d, to: b.right, after: [a]}
faults: [{kind: port_plugged, unit: b, port: rear, attempts: [1, 2, 3]}]
docking: {attempts: 1, stall_time_s: 0.8, retreat_m: 0.15}
"""
    result, starts = run(mission(tmp_path, plan))
    assert starts.keys() == {0, 1}
    a, c = result.steps
    assert not a.docked
    assert (c.docked, c.pull_test_passed) == (True, True)
    assert result.outcome is a.outcome is not Outcome.ABORTED
    assert result.decisive_step is a


def test_what_endangers_bodies_ends_the_mission(tmp_path: Path) -> None:
    """A post appears in front of a, which has no camera for it; c has done nothing wrong and is aborted."""
    post = "{shape: cylinder, radius_m: 0.02, appears_at_s: 0.5, pose: {x_m: 0.15}}"
    plan = "\n".join(AT_ONCE.splitlines()[1:3]) + f"\nobstacles: {{post: {post}}}"
    result, _ = run(mission(tmp_path, plan, plant="unicycle"))
    assert [step.outcome for step in result.steps] == [Outcome.CLEARANCE_VIOLATED, Outcome.ABORTED]
    assert result.outcome is Outcome.CLEARANCE_VIOLATED
    assert result.decisive_step.unit == "a"


def test_units_that_dock_beside_each_other_do_not_hold_each_other_up(shipped: Load) -> None:
    """With an overhead camera; the first to be docked is no stranger to those that come beside it."""
    scene = shipped("four_units_cross", {"perception": "parametric", "plant": "unicycle"})
    at_once = tuple(step.model_copy(update={"after": ()}) for step in scene.plan)
    result, starts = run(scene.model_copy(update={"plan": at_once}))
    assert result.docked, result.decisive_step.belief_reason
    assert set(starts.values()) == {0}
    assert [len(step.attempts) for step in result.steps] == [1, 1, 1]


@pytest.mark.parametrize(
    ("plan", "message"),
    [
        ("  - {unit: a, to: b.rear, after: [x]}", "no step named 'x'"),
        ("  - {unit: a, to: b.rear, after: [a]}", "step 'a' waits for itself"),
        (
            "  - {unit: a, to: b.rear, after: [c]}\n  - {unit: c, to: b.left}",
            "step 'a' waits for itself",
        ),
        (
            "  - {unit: a, to: b.rear}\n  - {unit: c, to: b.left, name: a}\n"
            "  - {unit: d, to: b.right, after: [a]}",
            "2 steps are named 'a'",
        ),
        (
            "  - {unit: a, to: b.rear}\n  - {unit: c, to: a.rear, after: []}",
            "'a' may move at the same time",
        ),
    ],
)
def test_an_order_that_cannot_be_kept_is_refused(tmp_path: Path, plan: str, message: str) -> None:
    with pytest.raises(SceneError, match=message):
        mission(tmp_path, plan)
