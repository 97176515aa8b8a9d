"""The verdict on a trial, from what ended it, its steps and the locks that were closed since the start."""

from __future__ import annotations

from pathlib import Path

import pytest

from msrr_bullet.trial.step_result import AttemptRecord, Belief, PlanarPose, StepResult
from msrr_bullet.trial.trial import Trial
from msrr_bullet.trial.verdict import Verdict, decisive_step, verdict_on_trial
from msrr_scenes.loading.load import load_scene
from msrr_scenes.messages import Phase
from msrr_scenes.outcome import Outcome

COLLISION, LATE = Verdict(Outcome.COLLISION, "a touched c"), Verdict(Outcome.TIMEOUT, "late")
COMPLETE = Verdict(Outcome.COMPLETE, "all tasks are done")
LOCK = "the lock of c at a.left failed"


def step(outcome: Outcome, ended_s: float = 5.0, reason: str = "", belief: Belief = "docked") -> StepResult:
    here = PlanarPose(x_m=-0.1, y_m=0.0, yaw_rad=0.0)
    attempt = AttemptRecord(ended_s=ended_s, phase=Phase.DONE, reason="", believed=None, true=here)
    return StepResult(
        index=0,
        unit="a",
        port="front",
        target="b.rear",
        outcome=outcome,
        verdict_reason=reason,
        belief=belief,
        belief_reason="seen seated",
        started_s=0.0,
        attempts=(attempt,),
    )


DOCKED, JAMMED, ABORTED = step(Outcome.DOCKED), step(Outcome.JAMMED, 9.0), step(Outcome.ABORTED, 3.0)
FALSE_DOCK = step(Outcome.FALSE_DOCK, reason="the lock holds nothing")
WEAK = step(Outcome.LOCK_FAILED, reason="the lock failed the pull test")
HANGS = step(Outcome.STUCK, reason="it is still in its port", belief="undocked")
KNOWS_IT_HANGS = step(Outcome.STUCK, belief="gave_up")
GAVE_WAY = step(Outcome.LOCK_FAILED, belief="gave_up")


def test_the_decisive_step_is_the_first_to_end_without_success() -> None:
    sooner = step(Outcome.TARGET_LOST, 8.0)
    assert decisive_step((DOCKED, JAMMED, sooner, ABORTED)) is sooner
    assert decisive_step((ABORTED, DOCKED, FALSE_DOCK)) is FALSE_DOCK
    last = step(Outcome.UNDOCKED)
    assert decisive_step((DOCKED, last, ABORTED)) is last


@pytest.mark.parametrize(
    ("ended", "steps", "failed_lock", "verdict"),
    [
        (None, (DOCKED, JAMMED), None, Verdict(Outcome.JAMMED, "seen seated")),
        (None, (FALSE_DOCK,), None, Verdict(Outcome.FALSE_DOCK, "the lock holds nothing")),
        (COMPLETE, (DOCKED, JAMMED), None, COMPLETE),  # the base station has answered a jam
        (COMPLETE, (FALSE_DOCK,), None, Verdict(Outcome.FALSE_DOCK, "a at b.rear: the lock holds nothing")),
        (COMPLETE, (WEAK,), None, Verdict(Outcome.LOCK_FAILED, "a at b.rear: the lock failed the pull test")),
        (COMPLETE, (HANGS,), None, Verdict(Outcome.STUCK, "a at b.rear: it is still in its port")),
        (COMPLETE, (KNOWS_IT_HANGS,), None, COMPLETE),
        (COMPLETE, (GAVE_WAY, DOCKED), None, COMPLETE),  # the unit has told that its lock gave way
        (COMPLETE, (DOCKED,), LOCK, Verdict(Outcome.LOCK_FAILED, LOCK)),
        (COLLISION, (FALSE_DOCK,), LOCK, COLLISION),
        (LATE, (), LOCK, LATE),
    ],
)
def test_what_is_true_of_steps_and_locks_contradicts_what_the_base_station_tells(
    ended: Verdict | None, steps: tuple[StepResult, ...], failed_lock: str | None, verdict: Verdict
) -> None:
    """Danger and the time limit are the verdict whatever else is true."""
    assert verdict_on_trial(ended, steps, failed_lock) == verdict


def test_a_robot_that_a_base_station_leads_notices_that_its_lock_does_not_hold() -> None:
    """It was on standby by then, and was never let look."""
    models = {"perception": "parametric", "as_built": "perfect", "lock.strength_n": "22"}
    scene = load_scene("dock_again", {**models, "radio": "{}", "plan": "[{unit: a, to: b.rear}]"})
    (docking,) = Trial(scene, 1).run().steps
    assert (docking.outcome, docking.belief) == (Outcome.LOCK_FAILED, "undecided")
    assert docking.belief_reason.startswith("no longer docked: a seat switch has been open")


def test_a_mission_whose_lock_fails_says_which(line_of_three: Path) -> None:
    """Its reason was that all tasks are done, as the base station believes."""
    fast = {"plant": "unicycle", "perception": "parametric", "as_built": "perfect", "shape": "{line: 2}"}
    weak = {"lock.strength_n": "1.0", "lock.pull_force_n": "5.0"}
    result = Trial(load_scene(line_of_three, {**fast, **weak}), 1).run()
    (docking,) = result.steps
    assert result.outcome is docking.outcome is Outcome.LOCK_FAILED
    assert result.reason == f"{docking.unit} at {docking.target}: the lock failed the pull test"
