"""Verdicts: on a step, on what ended a trial, and on the trial as a whole."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from msrr_bullet.trial.step_result import StepResult
from msrr_scenes.outcome import Outcome

#: Outcomes of the end of a mission as its base station tells it, which steps and locks may contradict.
_TOLD = (Outcome.COMPLETE, Outcome.INCOMPLETE)

#: Outcomes of steps that a base station does not know of, unless the unit itself has given up and said so.
_UNKNOWN = (Outcome.PROGRAM_FAILED, Outcome.FALSE_DOCK, Outcome.LOCK_FAILED, Outcome.STUCK)


@dataclass(frozen=True, slots=True)
class Verdict:
    """An outcome, and what speaks for it.

    The reason is empty where the robot has ended the step and its own reason tells why.
    """

    outcome: Outcome
    reason: str = ""


def time_is_up(limit_s: float, still_to_do: str = "") -> Verdict:
    """Return the verdict on what has not ended within the time limit of its scene [s], and why, in words."""
    why = f": {still_to_do}" if still_to_do else ""
    return Verdict(Outcome.TIMEOUT, f"the time limit of {limit_s:g} s is over{why}")


def decisive_step(steps: Sequence[StepResult]) -> StepResult:
    """Return the first step to end without success; the last one if all have succeeded.

    A step that was aborted decides nothing, for it ended because of something else.
    """
    failed = [step for step in steps if not step.succeeded and step.outcome is not Outcome.ABORTED]
    succeeded = [step for step in steps if step.succeeded]
    return min(failed, key=lambda step: step.ended_s, default=(succeeded or steps)[-1])


def verdict_on_trial(ended: Verdict | None, steps: Sequence[StepResult], failed_lock: str | None) -> Verdict:
    """Return the verdict on a trial.

    ``ended`` is what ended the trial, other than its steps: danger, the time limit, or the base station; None
    where the steps of the plan decide. ``failed_lock`` is a lock, closed since the start, that did not hold
    the pull test.
    """
    if ended is None:
        decisive = decisive_step(steps)
        return Verdict(decisive.outcome, decisive.reason)
    if ended.outcome not in _TOLD:
        return ended
    for step in steps:
        if step.outcome in _UNKNOWN and step.belief != "gave_up":
            return Verdict(step.outcome, f"{step.unit} at {step.target}: {step.reason}")
    return ended if failed_lock is None else Verdict(Outcome.LOCK_FAILED, failed_lock)
