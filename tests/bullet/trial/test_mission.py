"""A mission: the order of steps, what their failure does, and which plans need a base station."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from msrr_bullet.log import LogHeader, MemoryRecorder, read_log
from msrr_bullet.log.mcap_recorder import McapRecorder
from msrr_bullet.log.records import JUDGE, Event, StepStart
from msrr_bullet.plant.plant import Plant
from msrr_bullet.timeline.log_snapshots import read_snapshots
from msrr_bullet.timeline.mission_series import EventKind, unit_events
from msrr_bullet.trial.docking_step import DockingStep
from msrr_bullet.trial.result import TrialResult
from msrr_bullet.trial.trial import Trial
from msrr_scenes.errors import SceneError
from msrr_scenes.loading.load import load_scene
from msrr_scenes.messages import seconds
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.mission import RadioSpec
from msrr_scenes.specs.scene import Scene

SCENE = """
description: Three units dock to a fourth one, from in front of its ports.
perception: parametric
units:
  b: {{number: 1, pose: {{x_m: 0.4}}}}
  a: {{number: 0, pose: {{frame: b.rear, x_m: -0.30}}}}
  c: {{number: 2, pose: {{frame: b.left, x_m: -0.40}}}}
  d: {{number: 3, pose: {{frame: b.right, x_m: -0.50}}}}
plan:
{plan}
"""


def mission(folder: Path, plan: str, **overrides: str) -> Scene:
    path = folder / "mission.yaml"
    path.write_text(SCENE.format(plan=plan))
    return load_scene(path, overrides)


BLACKOUT = "[{kind: camera_blackout, camera: overhead, from_s: 4, to_s: 19}]"

Load = Callable[..., Scene]


def run(scene: Scene) -> tuple[TrialResult, dict[int, int]]:
    """Return the result, and the time at which each step begins."""
    recorder = MemoryRecorder()
    result = Trial(scene, 1, recorder=recorder).run()
    return result, {m.index: ns for _, ns, m in recorder.messages if isinstance(m, StepStart)}


def test_units_on_their_own_dock_one_after_another(tmp_path: Path) -> None:
    """In the order that `after` asks for; the result lists them as the plan does."""
    plan = """
  - {unit: a, to: b.rear, after: [right]}
  - {unit: c, to: b.left, after: []}
  - {unit: d, to: b.right, name: right, after: [c]}
"""
    result, starts = run(mission(tmp_path, plan, plant="unicycle"))
    a, c, d = result.steps
    assert result.docked
    assert (a.unit, c.unit, d.unit) == ("a", "c", "d")
    assert starts[1] == 0
    assert (d.started_s, a.started_s) == (c.ended_s, d.ended_s) == (seconds(starts[2]), seconds(starts[0]))


def test_a_step_that_does_not_dock_ends_the_plan(tmp_path: Path) -> None:
    """The port of the second unit is plugged; the first is docked and stays so, the third never begins."""
    plan = """
  - {unit: a, to: b.rear}
  - {unit: c, to: b.left}
  - {unit: d, to: b.right}
faults: [{kind: port_plugged, unit: b, port: left, attempts: [1, 2, 3]}]
docking: {attempts: 1, stall_time_s: 0.8, retreat_m: 0.15}
"""
    result, starts = run(mission(tmp_path, plan))
    assert starts.keys() == {0, 1}
    a, c = result.steps
    assert (a.docked, a.pull_test_passed) == (True, True)
    assert not c.docked
    assert result.outcome is c.outcome
    assert result.decisive_step is c


def test_what_endangers_bodies_ends_the_mission(tmp_path: Path) -> None:
    """A post appears in front of a, which has no camera for it."""
    post = "{shape: cylinder, radius_m: 0.02, appears_at_s: 0.5, pose: {x_m: 0.15}}"
    plan = f"  - {{unit: a, to: b.rear}}\n  - {{unit: c, to: b.left}}\nobstacles: {{post: {post}}}"
    result, starts = run(mission(tmp_path, plan, plant="unicycle"))
    assert starts.keys() == {0}
    assert [step.outcome for step in result.steps] == [Outcome.CLEARANCE_VIOLATED]
    assert result.outcome is Outcome.CLEARANCE_VIOLATED


@pytest.mark.parametrize(
    ("name", "post", "outcomes"),
    [
        ("dock_again", "appears_at_s: 22, pose: {x_m: 0.8, y_m: 0.1}", {"docked", "undocked", "aborted"}),
        pytest.param(
            *("assemble_cross", "appears_at_s: 3, tag_id: 500", {"docked", "aborted"}),
            marks=pytest.mark.nightly,  # a quarter of a minute
        ),
    ],
)
def test_every_step_has_one_verdict(shipped: Load, name: str, post: str, outcomes: set[str]) -> None:
    """Also one that ended before a post hits a unit that stands, and one whose route a post closes."""
    scene = shipped(
        name,
        {
            "plant": "unicycle",
            "perception": "parametric",
            "as_built": "perfect",
            "obstacles.post": f"{{shape: cylinder, radius_m: 0.05, {post}}}",
        },
    )
    recorder = MemoryRecorder()
    steps = [step.outcome.value for step in Trial(scene, 1, recorder=recorder).run().steps]
    assert set(steps) == outcomes
    verdicts = [m.text for *_, m in recorder.messages if isinstance(m, Event) and m.source == JUDGE]
    *told, _ = verdicts  # the last one is that on the trial
    assert sorted(text.partition(": ")[2].partition(",")[0] for text in told) == sorted(steps)


def test_units_that_dock_beside_each_other_do_not_hold_each_other_up(shipped: Load) -> None:
    """Led by a base station; the first to be docked is no stranger to those that come beside it."""
    scene = shipped("four_units_cross", {"perception": "parametric", "plant": "unicycle"})
    at_once = tuple(step.model_copy(update={"after": ()}) for step in scene.plan)
    result, starts = run(scene.model_copy(update={"plan": at_once, "radio": RadioSpec()}))
    assert result.outcome is Outcome.COMPLETE, result.reason
    assert [len(step.attempts) for step in result.steps] == [1, 1, 1]
    first_end = min(step.ended_s for step in result.steps)
    assert all(1e-9 * start < first_end for start in starts.values())


def test_a_mission_in_which_no_step_began_has_a_reason(line_of_three: Path) -> None:
    silent = {"radio.silences": "[{from_s: 0, until_s: 60}]", "time_limit_s": "2"}
    result, starts = run(load_scene(line_of_three, silent))
    assert (result.steps, starts) == ((), {})
    assert result.decisive_step is None
    reason = "the time limit of 2 s is over: under way: a, b, c"  # routes, of which they never hear
    assert (result.outcome, result.reason) == (Outcome.TIMEOUT, reason)
    assert result.mission is not None
    assert result.mission.messages_lost == result.mission.messages_sent > 0
    assert result.mission.makespan_s is None
    assert TrialResult.from_json(result.to_json()) == result


def test_a_mission_whose_time_is_up_says_who_waits_for_whom(shipped: Load) -> None:
    fast = {"plant": "unicycle", "perception": "parametric", "as_built": "perfect", "time_limit_s": "4.25"}
    result, _ = run(shipped("assemble_line", fast))
    assert result.outcome is Outcome.TIMEOUT
    assert re.search(r" is over: .*\bd waits for c; .*\bunder way: .*\bf\b", result.reason), result.reason


def test_units_that_nobody_sees_for_a_while_go_on_when_they_are_seen_again(
    line_of_three: Path, tmp_path: Path
) -> None:
    """The overhead camera fails for 15 s, 5 s longer than units wait for it; log and result tell of it."""
    fast = {"plant": "unicycle", "perception": "parametric", "as_built": "perfect", "time_limit_s": "200"}
    scene = load_scene(line_of_three, {**fast, "shape": "{line: 2}", "faults": BLACKOUT})
    with McapRecorder(tmp_path / "log.mcap", LogHeader.of(scene, 1, {})) as recorder:
        result = Trial(scene, 1, recorder=recorder).run()
    assert result.outcome is Outcome.COMPLETE, result.reason
    gave_up = [step for step in result.steps if not step.docked]
    assert gave_up
    snapshots = read_snapshots(read_log(tmp_path / "log.mcap"))
    for unit in {step.unit for step in gave_up}:
        kinds = [event.kind for event in unit_events(snapshots, unit)]
        assert [kind for kind in kinds if kind in (EventKind.LOST, EventKind.FOUND)] == [
            EventKind.LOST,
            EventKind.FOUND,
        ]


def test_steps_at_the_same_time_need_a_base_station(tmp_path: Path) -> None:
    plan = "  - {unit: a, to: b.rear}\n  - {unit: c, to: b.left, after: []}\ncameras: {overhead: {}}"
    with pytest.raises(SceneError, match=r"'a' and 'c' may be .* same time.* add `radio: {}`") as refused:
        mission(tmp_path, plan)
    assert "plan.1.after" in str(refused.value)
    assert mission(tmp_path, plan + "\nradio: {}").coordinated
    assert not mission(tmp_path, plan.replace("[]", "[a]")).coordinated


@pytest.mark.parametrize("plant", ["bullet", "unicycle"])
def test_to_ask_at_every_tick_changes_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, plant: str
) -> None:
    """Nothing is due between the times that sensors, links and control give, and the judge misses nothing."""
    plan = "  - {unit: a, to: b.rear}"
    rates = {"cameras.onboard.rate_hz": "17", "link.latency_ms": "13", "odometry.rate_hz": "70"}
    scene = mission(tmp_path, plan, plant=plant, time_limit_s="3.4", **rates)

    def log(name: str) -> bytes:
        with McapRecorder(tmp_path / name, LogHeader.of(scene, 1, {})) as recorder:
            result = Trial(scene, 1, recorder=recorder).run()
        assert result.steps[0].attempts[0].contact is not None
        return (tmp_path / name).read_bytes()

    as_due = log("as_due.mcap")
    advance = Plant.advance
    calls: list[float] = []

    def by_one_tick(self: Plant, until_ns: float, observe: Callable[[], None] | None = None) -> None:
        calls.append(until_ns)
        advance(self, self.now_ns(), observe)

    monkeypatch.setattr(Plant, "advance", by_one_tick)
    monkeypatch.setattr(DockingStep, "watches", lambda self: True)
    assert log("every_tick.mcap") == as_due
    assert len(calls) > 700  # 240 a second


ASKEW = """
time_limit_s: 40
arena: {x_m: [-2.0, 2.0], y_m: [-1.5, 1.5]}
as_built: {grade: rough, tags: {yaw_deg: {sigma: 1.2, error: 3.5}}}
units:
  a: {number: 0, pose: {x_m: -1.2, y_m: -0.9}}
cameras: {overhead: {height_m: 4}}
radio: {}
plan:
  - {move: a, name: there, pose: {x_m: 0.6, y_m: -0.9, yaw_deg: 0}}
  - {move: a, after: [there], pose: {x_m: 1.2, y_m: -0.2, yaw_deg: 90}}
"""


def test_a_unit_whose_tag_is_held_askew_arrives_where_it_takes_itself_to_be(tmp_path: Path) -> None:
    """It learns by driving how its tag is held; the base station does not, and sees it look elsewhere."""
    path = tmp_path / "askew.yaml"
    path.write_text(ASKEW)
    result = Trial(load_scene(path), 2).run()
    assert result.outcome is Outcome.COMPLETE
    assert result.mission is not None
    assert result.mission.replans == 0
