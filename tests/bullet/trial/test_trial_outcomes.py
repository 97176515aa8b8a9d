"""Every outcome is reached by a shipped scene with or without overrides, with the belief of the robot."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import pytest

from msrr_bullet.run import run_trial
from msrr_bullet.trial.step_result import Belief, StepResult
from msrr_scenes.messages import Phase
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.scene import Scene

SEED = 1

#: A shorter trial with the same end: a start nearer to the port, and limits that give up sooner.
BRIEF = {"units.a.pose.x_m": "-0.25", "docking.stall_time_s": "0.8", "docking.retreat_m": "0.15"}


@dataclass(frozen=True)
class Case:
    """How an outcome is provoked, and what else has to hold."""

    outcome: Outcome
    scene: str
    belief: Belief
    true: Callable[[StepResult], bool]
    overrides: Mapping[str, str] = field(default_factory=dict)
    blind: bool = False

    @cached_property
    def id(self) -> str:
        return self.outcome.value


def seated(step: StepResult) -> bool:
    return step.seating is not None and step.seating.seated


def nothing_touched(step: StepResult) -> bool:
    return step.contact is None and not step.lock_closed


CASES = (
    Case(
        Outcome.DOCKED,
        "weak_lock",  # only the strength of the lock differs from the case lock_failed
        "docked",
        lambda r: seated(r) and r.lock_engaged and r.pull_test_passed is True and r.phase is Phase.DONE,
        {"lock.strength_n": "26", "perception": "parametric"},
    ),
    Case(
        Outcome.LOCK_FAILED,
        "weak_lock",
        "undecided",  # it senses that the pull took it off its seat
        lambda r: (
            "no longer docked" in r.belief_reason
            and seated(r)
            and r.lock_closed
            and r.lock_engaged
            and r.pull_test_passed is False
        ),
    ),
    Case(
        Outcome.JAMMED,
        "askew_camera",
        "gave_up",
        # Beyond the capture range of the funnel, and the lock was never closed.
        lambda r: r.contact is not None and r.contact.lateral_m > 0.016 and not r.lock_closed,
        {"docking.retreat_m": "0.15"},
    ),
    Case(
        Outcome.NOT_SEATED,
        "plugged_port",
        "gave_up",
        lambda r: r.contact is not None and r.contact.lateral_m < 0.003 and not seated(r),
        {"docking.attempts": "1", **BRIEF},
    ),
    Case(Outcome.TARGET_LOST, "lost_target", "gave_up", nothing_touched),
    Case(
        Outcome.GAVE_UP,
        "seized_drive",
        "gave_up",
        lambda r: nothing_touched(r) and r.attempts[-1].believed is not None,
    ),
    Case(
        Outcome.NEVER_DETECTED,
        "hidden_marker",
        "gave_up",
        lambda r: nothing_touched(r) and r.attempts[-1].believed is None,
        {"docking.search_time_s": "1"},
    ),
    Case(
        Outcome.COLLISION,
        "obstacle_in_lane",
        "undecided",
        lambda r: nothing_touched(r) and r.min_clearance_m is not None and r.min_clearance_m <= 0.0,
        {
            "judge.min_clearance_m": "0",
            "perception": "parametric",
        },  # with contact physics, so that the unit stops at the post
    ),
    Case(
        Outcome.CLEARANCE_VIOLATED,
        "obstacle_in_lane",
        "undecided",
        lambda r: r.min_clearance_m is not None and 0.0 < r.min_clearance_m < 0.02,
        blind=True,
    ),
    Case(
        Outcome.BLOCKED,
        "blocked",
        "gave_up",
        # It has seen nothing with its own camera, and knows where it is from the overhead camera.
        lambda r: nothing_touched(r) and r.attempts[-1].believed is not None,
        blind=True,
    ),
    Case(
        Outcome.LEFT_ARENA, "no_room_to_retreat", "undecided", lambda r: r.phase is Phase.RETREAT, blind=True
    ),
    Case(Outcome.TIMEOUT, "short_time", "undecided", lambda r: abs(r.ended_s - 2.0) < 0.03, blind=True),
    Case(
        Outcome.PROGRAM_FAILED,
        "close_range",
        "undecided",
        lambda r: nothing_touched(r) and "LawController" in r.belief_reason,
        # A class that has the methods of a controller, and cannot run on what controllers are built from.
        {"control.docking": "msrr_control.docking.controller:LawController"},
        blind=True,
    ),
    Case(
        Outcome.FALSE_DOCK,
        "stuck_seat_switch",
        "docked",
        # The lock closed on nothing and reports that it is closed.
        lambda r: not seated(r) and r.lock_closed and not r.lock_engaged and r.pull_test_passed is not True,
    ),
    Case(
        Outcome.FALSE_ABORT,
        "dead_seat_switch",
        "gave_up",
        lambda r: r.contact is not None and not r.lock_closed,
        {"perception": "parametric"},
    ),
)

#: Outcomes for which the judge has a reason of its own: it ends the step, or the robot wrongly says docked.
WITH_A_REASON_OF_THE_JUDGE = (
    Outcome.LOCK_FAILED,
    Outcome.FALSE_DOCK,
    Outcome.COLLISION,
    Outcome.CLEARANCE_VIOLATED,
    Outcome.LEFT_ARENA,
    Outcome.TIMEOUT,
)

Load = Callable[..., Scene]


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.id)
def test_an_outcome_is_provoked(case: Case, shipped: Load) -> None:
    result = run_trial(shipped(case.scene, case.overrides, blind=case.blind), SEED)
    (step,) = result.steps
    assert (result.outcome, step.belief) == (case.outcome, case.belief), step.belief_reason
    assert case.true(step), step
    assert step.belief_reason
    assert bool(step.verdict_reason) is (case.outcome in WITH_A_REASON_OF_THE_JUDGE)
    assert result.reason == (step.verdict_reason or step.belief_reason)
    assert result.docked == (case.outcome is Outcome.DOCKED)


def test_every_outcome_has_a_case() -> None:
    of_steps = {Outcome.ABORTED, Outcome.UNDOCKED, Outcome.STUCK}
    of_missions = {Outcome.COMPLETE, Outcome.INCOMPLETE}
    assert {case.outcome for case in CASES} == set(Outcome) - of_steps - of_missions


@pytest.mark.parametrize("grade", ["perfect", "rough"])
def test_verification_by_sight_detects_a_stuck_seat_switch(shipped: Load, grade: str) -> None:
    """The case false_dock with verification by sight: the robot knows that it is not docked.

    A perfect robot sees itself 9 mm off its seat, a rough one may not; both see that the lock does not hold.
    """
    overrides = {"docking.verify.by_sight": "true", "docking.attempts": "1", "as_built": grade, **BRIEF}
    (step,) = run_trial(shipped("stuck_seat_switch", overrides), SEED).steps
    assert step.outcome in (Outcome.NOT_SEATED, Outcome.JAMMED)
    assert step.belief == "gave_up"
    assert re.search(r"seen to move by \d\d.\d mm in a tug test", step.reason)


def test_a_stuck_seat_switch_does_not_prevent_a_docking(shipped: Load) -> None:
    clear = {
        "faults": "[{kind: seat_switch_stuck, unit: b, value: closed}]",
        "docking.verify.by_sight": "true",
    }
    assert run_trial(shipped("stuck_seat_switch", clear, blind=True), SEED).outcome is Outcome.DOCKED


def test_a_unit_that_gives_up_because_its_lock_gives_way_in_a_tug_test_is_right(shipped: Load) -> None:
    """The pins were seated, but nothing held them: to give up was no false abort.

    A marker that sits 6 mm deeper than drawn lets the unit see itself off its seat, and test its lock.
    """
    deeper = {"as_built.bracket.x_m": "0.006", "perception": "parametric", "docking.attempts": "1", **BRIEF}
    result = run_trial(shipped("weak_lock", deeper), SEED)
    (step,) = result.steps
    assert "in a tug test" in step.belief_reason
    assert (result.outcome, step.belief) == (Outcome.LOCK_FAILED, "gave_up")
    assert result.reason == step.belief_reason


def test_touching_the_target_beside_its_port_is_a_collision(shipped: Load) -> None:
    """The docking pair may touch where it docks and nowhere else."""
    misaligned = {"faults": "[{kind: camera_misaligned, unit: a, yaw_deg: 25}]", "docking.attempts": "1"}
    result = run_trial(shipped("askew_camera", misaligned), SEED)
    (step,) = result.steps
    assert (result.outcome, step.belief) == (Outcome.COLLISION, "undecided")
    assert result.reason.startswith("a touched b beside its port at (")
    assert step.contact is None
    assert step.min_clearance_m is not None
    assert step.min_clearance_m <= 0.0
