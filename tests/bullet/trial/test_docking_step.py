"""Steps of a plan: locks of earlier steps, attempts, the time limit, and tags of other units."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import pytest

from msrr_bullet.log import MemoryRecorder, TruePose
from msrr_bullet.run import run_trial
from msrr_bullet.sweep.summarise import summarise
from msrr_bullet.trial.docking_step import DockingStep
from msrr_bullet.trial.trial import Trial
from msrr_scenes.loading.load import load_scene
from msrr_scenes.messages import Action, Phase
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.scene import Scene

Load = Callable[..., Scene]

IDEAL = {"plant": "unicycle", "perception": "parametric"}

#: A start near the port, and attempts that end sooner.
BRIEF = {"units.a.pose.x_m": "-0.25", "docking.stall_time_s": "0.8", "docking.retreat_m": "0.15"}


def test_a_lock_of_an_earlier_step_that_opens_fails_the_plan(
    shipped: Load, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The lock of the first pair opens when the second step begins."""
    begin = DockingStep.__init__

    def open_first_lock(self, environment, index, *rest) -> None:
        begin(self, environment, index, *rest)
        if index == 1:
            environment.simulation.plant.set_lock("a", False)

    monkeypatch.setattr(DockingStep, "__init__", open_first_lock)
    result = run_trial(shipped("three_units", IDEAL), 1)
    assert result.outcome is Outcome.LOCK_FAILED
    assert not result.docked
    assert [step.outcome for step in result.steps] == [Outcome.LOCK_FAILED, Outcome.ABORTED]
    assert result.decisive_step is result.steps[0]


TWO_STEPS = """
description: Two units dock to a third one; the port of the first is plugged in its first attempt.
units:
  b: {number: 1, pose: {x_m: 0.4}}
  a: {number: 0, pose: {frame: b.rear, x_m: -0.30}}
  c: {number: 2, pose: {frame: b.left, x_m: -0.30}}
docking: {stall_time_s: 0.8, retreat_m: 0.15}
faults: [{kind: port_plugged, unit: b, port: rear, attempts: [1]}]
plan: [{unit: a, to: b.rear}, {unit: c, to: b.left}]
"""


def test_every_step_has_a_result_of_its_own(shipped: Load, tmp_path: Path) -> None:
    """The attempts of all steps were summed, and the other figures were those of the last step alone."""
    path = tmp_path / "two_steps.yaml"
    path.write_text(TWO_STEPS)
    scene = load_scene(path, IDEAL)
    result = run_trial(scene, 1)
    first, second = result.steps
    assert result.outcome is first.outcome is second.outcome is Outcome.DOCKED
    assert [(s.index, s.unit, s.target) for s in (first, second)] == [(0, "a", "b.rear"), (1, "c", "b.left")]
    assert (len(first.attempts), len(second.attempts)) == (2, 1)
    plugged, free = (attempt.contact for attempt in first.attempts)
    assert plugged is not None
    assert free is not None
    assert plugged.time_s < first.attempts[0].ended_s < free.time_s < first.ended_s <= second.started_s
    assert first.contact == free
    assert second.contact != free
    assert result.duration_s == second.ended_s
    assert result.min_clearance_m == min(first.min_clearance_m, second.min_clearance_m)

    summary = summarise(scene, "code", [result])
    assert [(s.unit, s.target, s.trials) for s in summary.steps] == [("a", "b.rear", 1), ("c", "b.left", 1)]
    assert [s.docked_by_attempt for s in summary.steps] == [{2: 1}, {1: 1}]
    assert summary.steps[0].contact_lateral_mm.max == 1000.0 * free.lateral_m


@pytest.mark.parametrize(
    ("off_m", "seed", "attempts"), [pytest.param(-0.018, 3, 2, marks=pytest.mark.nightly), (0.016, 1, 3)]
)
def test_a_robot_that_wrongly_takes_itself_for_perfect_finds_the_port_beside(
    shipped: Load, off_m: float, seed: int, attempts: int
) -> None:
    """Its marker is off by more than the mouths are wide. It pressed against the same place three times.

    It tries both sides, one after the other. In its seat it is seen as far beside it as the marker is, which
    a tug test tells from a false seat.
    """
    overrides = {"as_built.bracket.y_m": str(off_m), **BRIEF}
    result = Trial(shipped("close_range", overrides), seed).run()
    (step,) = result.steps
    assert step.attempts[0].contact is not None
    assert step.attempts[0].contact.lateral_m == pytest.approx(abs(off_m), abs=3e-4)
    assert result.outcome is Outcome.DOCKED
    assert len(step.attempts) == attempts
    assert "held in a tug test" in step.reason


def test_a_robot_that_is_done_at_the_time_limit_is_in_time(shipped: Load) -> None:
    free = run_trial(shipped("close_range", IDEAL), 1)
    limit = {"time_limit_s": repr(free.duration_s)}
    in_time = run_trial(shipped("close_range", {**IDEAL, **limit}), 1)
    assert (in_time.outcome, in_time.duration_s) == (Outcome.DOCKED, free.duration_s)


CREEPING = """from msrr_scenes.messages import Twist
class Creeping:
    approach_mps = 0.1
    def __init__(self, setup): ...
    def reset(self, inputs): ...
    def step(self, inputs):
        return Twist(0.0015, 0.0)
"""


def test_a_unit_that_creeps_is_stalled(
    shipped: Load, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It hardly moves, 3 mm in 2 s where it promises 0.2 m, and once stayed in DOCK for 59 s.

    An attempt that gets nowhere lasts a hand-over (2 s), a stall (2 s and the first way) and a retreat that
    is over before it begins: 10 s at most.
    """
    (tmp_path / "creeping_law.py").write_text(CREEPING)
    monkeypatch.syspath_prepend(tmp_path)
    result = run_trial(shipped("close_range", {**IDEAL, "control.docking": "creeping_law:Creeping"}), 1)
    assert result.outcome is Outcome.GAVE_UP
    ends = [0.0, *(attempt.ended_s for attempt in result.steps[0].attempts)]
    assert max(after - before for before, after in pairwise(ends)) < 10.0


@pytest.mark.parametrize("latency_ms", [pytest.param(300, marks=pytest.mark.nightly), 700])
def test_pictures_that_are_late_cost_little_where_the_delay_is_compensated(
    shipped: Load, latency_ms: int
) -> None:
    """The target counted as lost, or as not seen, for the age of its pictures: it crept, and gave up."""
    late = {"cameras.onboard.latency_ms": latency_ms, "docking.lost_time_s": 1.5, "docking.verify.time_s": 2}
    in_time, result = (run_trial(shipped("close_range", {**IDEAL, **more}), 1) for more in ({}, late))
    assert result.outcome is Outcome.DOCKED
    assert len(result.steps[0].attempts) == 1
    assert result.duration_s < in_time.duration_s + 2.0


THIRD_UNIT = """
description: The tags of the target are covered, and those of a third unit are in view.
units:
  b: {number: 1, pose: {x_m: 0.4}}
  a: {number: 0, pose: {frame: b.rear, x_m: -0.50}}
  c: {number: 2, pose: {x_m: 0.9, y_m: 0.25}}
faults: [{kind: marker_hidden, unit: b}]
docking: {attempts: 1, search_time_s: 1}
plan: [{unit: a, to: b.rear}]
"""


def test_tags_of_a_third_unit_are_not_the_target(tmp_path: Path) -> None:
    path = tmp_path / "third_unit.yaml"
    path.write_text(THIRD_UNIT)
    assert run_trial(load_scene(path), 1).outcome is Outcome.NEVER_DETECTED


def test_the_time_limit_ends_slow_control(shipped: Load) -> None:
    """It went on: the limit was looked at at control instants alone."""
    slow = run_trial(shipped("close_range", {**IDEAL, "control.rate_hz": "1", "time_limit_s": "1.25"}), 1)
    assert (slow.outcome, slow.duration_s) == (Outcome.TIMEOUT, 1.25)


def test_a_step_that_docked_in_time_stays_docked_when_a_later_one_times_out(tmp_path: Path) -> None:
    """Its pull test did not fit into the time that was left, so that it timed out, and decided the trial."""
    path = tmp_path / "two_steps.yaml"
    seized = "faults: [{kind: unit_seized, unit: c}]"
    path.write_text(re.sub("faults: .*", seized, TWO_STEPS))
    result = run_trial(load_scene(path, {"perception": "parametric", "time_limit_s": "6.5"}), 1)
    assert [step.outcome for step in result.steps] == [Outcome.DOCKED, Outcome.TIMEOUT]
    assert result.steps[0].pull_test_passed
    assert result.decisive_step is result.steps[1]


@pytest.mark.parametrize(
    ("lag_ms", "most_mm"), [(0, 5.0), pytest.param(100, 10.0, marks=pytest.mark.nightly), (280, 23.0)]
)
def test_a_unit_in_its_seat_does_not_push_its_target_over_a_slippery_floor(
    shipped: Load, lag_ms: int, most_mm: float
) -> None:
    """Wheels that spin push as hard as those of the target hold; only how long they spin is left to the unit.

    While it pressed on until the lock had closed, the target slid by 11, 15 and 25 mm.
    """
    floor = {"as_built.floor.friction_percent": "-66", "as_built.drive.lag_ms": str(lag_ms)}
    recorder = MemoryRecorder()
    result = Trial(shipped("close_range", {**floor, "perception": "parametric"}), 0, recorder=recorder).run()
    done_ns = min(ns for _, ns, m in recorder.messages if isinstance(m, Action) and m.phase is Phase.DONE)
    poses = [(ns, m.X_WB) for _, ns, m in recorder.messages if isinstance(m, TruePose) and m.name == "b"]
    before, after = poses[0][1], next(X for ns, X in poses if ns >= done_ns)
    pushed = 1e3 * math.hypot(after.x - before.x, after.y - before.y)
    print(f"a drive that lags by {lag_ms} ms pushed its target by {pushed:.1f} mm")
    assert result.docked
    assert pushed < most_mm


_ASSEMBLY_ON_A_SLOPE = """
as_built: careful
units:
  b: {number: 1, pose: {x_m: 0.8, yaw_deg: 19}}
  c: {number: 2}
  d: {number: 3}
  e: {number: 4}
  f: {number: 5}
  a: {number: 0, pose: {frame: c.left, x_m: -0.6}}
assembled: [c.front-b.rear, d.front-c.rear, e.front-d.rear, f.front-e.rear]
cameras: {overhead: {}}
plan: [{unit: a, to: c.left}]
time_limit_s: 60
"""


@pytest.mark.nightly
@pytest.mark.parametrize("seed", [0, 1])
def test_a_unit_that_slides_down_a_slippery_slope_docks_in_the_next_attempt(
    tmp_path: Path, seed: int
) -> None:
    """While all its attempts were as fast as the first one, it slid out of the port in each of them."""
    path = tmp_path / "slope.yaml"
    path.write_text(_ASSEMBLY_ON_A_SLOPE)
    floor = {"friction_percent": -90, "slope_x_deg": -1.6, "slope_y_deg": -0.3}
    overrides = {f"as_built.floor.{key}.error": str(error) for key, error in floor.items()}
    lagging = {"as_built.drive.lag_ms.error": "350", "perception": "parametric"}
    result = Trial(load_scene(path, {**overrides, **lagging}), seed).run()
    assert result.outcome is Outcome.COMPLETE
    assert len(result.steps[0].attempts) == 2


@pytest.mark.nightly
def test_a_unit_that_slides_out_of_a_port_keeps_away_from_its_neighbours(tmp_path: Path) -> None:
    """While it pressed on for two seconds, it turned by 8 degrees and came within 18 mm of one of them."""
    path = tmp_path / "slope.yaml"
    path.write_text(_ASSEMBLY_ON_A_SLOPE)
    floor = {"friction_percent": -90, "slope_x_deg": -1.436, "slope_y_deg": -1.393}
    overrides = {f"as_built.floor.{key}.error": str(error) for key, error in floor.items()}
    rough = {"as_built.grade": "rough", "perception": "parametric", "time_limit_s": "90"}
    result = Trial(load_scene(path, {**overrides, **rough}), 5).run()
    assert result.outcome is Outcome.COMPLETE
    slid, _ = result.steps[0].attempts
    assert "both seat switches opened again" in slid.reason
