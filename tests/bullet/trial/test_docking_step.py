"""Steps of a plan: locks of earlier steps, attempts, the time limit, and tags of other units."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import pytest

from msrr_bullet.run import run_trial
from msrr_bullet.sweep.summary import summarise
from msrr_bullet.trial.docking_step import DockingStep
from msrr_scenes.loading.load import load_scene
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.scene import Scene

Load = Callable[..., Scene]

IDEAL = {"plant": "unicycle", "perception": "parametric"}


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


def test_attempts_are_counted_by_step(shipped: Load) -> None:
    scene = shipped("three_units", IDEAL)
    result = run_trial(scene, 1)
    assert result.outcome is Outcome.DOCKED
    assert [(record.step, record.attempt) for record in result.records] == [(0, 1), (1, 1)]
    summary = summarise(scene, "hash", "code", [result])
    assert summary.docked_by_attempt == {1: 1}, "both steps docked at the first attempt"


def test_a_robot_that_is_done_at_the_time_limit_is_in_time(shipped: Load) -> None:
    free = run_trial(shipped("close_range", IDEAL), 1)
    limit = {"time_limit_s": repr(free.duration_s)}
    in_time = run_trial(shipped("close_range", {**IDEAL, **limit}), 1)
    assert (in_time.outcome, in_time.duration_s) == (Outcome.DOCKED, free.duration_s)


@pytest.mark.parametrize("compensation", ["true", "false"])
def test_a_unit_that_creeps_is_stalled(shipped: Load, compensation: str) -> None:
    """Pictures that are 500 ms late: the law hardly moves, 3 mm in 2 s, and once stayed in DOCK for 59 s.

    An attempt that gets nowhere lasts a hand-over (2 s), a stall (2 s and the first way) and a retreat that
    is over before it begins: 10 s at most.
    """
    late = {"cameras.onboard.latency_ms": "500", "control.delay_compensation": compensation}
    result = run_trial(shipped("close_range", {**IDEAL, **late}), 1)
    assert result.outcome is not Outcome.TIMEOUT
    ends = [0.0, *(record.ended_s for record in result.records)]
    assert max(after - before for before, after in pairwise(ends)) < 10.0


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
