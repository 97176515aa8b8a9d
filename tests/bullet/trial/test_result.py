"""The result of a trial: written, read back, and strict about values."""

import json
import math
import platform

import pytest
from pydantic import ValidationError

from msrr_bullet.trial.result import ResultError, TrialResult
from msrr_bullet.trial.step_result import (
    AssemblyFigures,
    AttemptRecord,
    Contact,
    PlanarPose,
    Seating,
    StepResult,
)
from msrr_bullet.trial.versions import package_versions, trial_versions
from msrr_scenes.messages import Phase
from msrr_scenes.outcome import Outcome

POSE = PlanarPose(x_m=-0.1, y_m=1e-17, yaw_rad=math.pi / 7)


CONTACT = Contact(time_s=7.3, lateral_m=0.1 + 0.2, yaw_rad=1e-300, port=POSE, estimate_error=POSE)


def step(**changes: object) -> StepResult:
    attempt = AttemptRecord(
        ended_s=9.02, phase=Phase.DONE, reason="", contact=CONTACT, believed=None, true=POSE
    )
    values: dict[str, object] = {
        "index": 0,
        "unit": "a",
        "port": "front",
        "target": "b.rear",
        "outcome": Outcome.DOCKED,
        "belief": "docked",
        "belief_reason": "seated by sight",
        "started_s": 0.5,
        "attempts": (attempt,),
        "seating": Seating(axial_gap_m=-1e-5, lateral_m=0.0, yaw_rad=0.0, seated=True),
        "lock_closed": True,
        "lock_engaged": True,
        "pull_test_passed": True,
        "min_clearance_m": 0.25,
        "assembly": AssemblyFigures(tracking_error_m=0.01),
    }
    return StepResult.model_validate({**values, **changes})


def result(**changes: object) -> TrialResult:
    values: dict[str, object] = {
        "scene": "close_range",
        "scene_hash": "00ff",
        "seed": 3,
        "plant": "bullet",
        "perception": "images",
        "outcome": Outcome.DOCKED,
        "reason": "seated by sight",
        "duration_s": 9.02,
        "steps": (step(),),
    }
    return TrialResult.model_validate({**values, **changes})


def test_json_reads_back_bit_for_bit() -> None:
    two = result(steps=(step(), step(index=1, min_clearance_m=-0.001, outcome=Outcome.COLLISION)))
    for written in (result(), two):
        assert TrialResult.from_json(written.to_json()) == written


def test_json_holds_plain_values_and_every_fact_once() -> None:
    data = json.loads(result().to_json())
    assert data["outcome"] == "docked"
    assert data["versions"]["pybullet"]
    (one,) = data["steps"]
    (attempt,) = one["attempts"]
    assert (attempt["phase"], attempt["believed"]) == ("done", None)
    assert not data.keys() & one.keys() - {"outcome"}, "the verdicts on the plan and on its steps"
    assert not one.keys() & attempt.keys()


@pytest.mark.parametrize(
    "changes",
    [
        {"duration_s": math.nan},
        {"duration_s": -1.0},
        {"outcome": "parked"},
        {"plant": "gazebo"},
        {"score": 1.0},
    ],
)
def test_impossible_values_of_a_trial_are_refused(changes: dict[str, object]) -> None:
    with pytest.raises(ValidationError):
        result(**changes)


@pytest.mark.parametrize(
    "changes",
    [
        {"index": -1},
        {"attempts": ()},
        {"belief": "perhaps"},
        {"outcome": "parked"},
        {"started_s": math.inf},
        {"min_clearance_m": math.inf},
        {"score": 1.0},
    ],
)
def test_impossible_values_of_a_step_are_refused(changes: dict[str, object]) -> None:
    with pytest.raises(ValidationError):
        step(**changes)


def test_a_result_cannot_be_changed() -> None:
    with pytest.raises(ValidationError):
        result().outcome = Outcome.JAMMED
    with pytest.raises(ValidationError):
        result().steps[0].outcome = Outcome.JAMMED


@pytest.mark.parametrize("outcome", list(Outcome))
def test_success_has_one_outcome_for_each_task(outcome: Outcome) -> None:
    assert step(outcome=outcome).docked is (outcome is Outcome.DOCKED)
    assert step(outcome=outcome).succeeded is (outcome in (Outcome.DOCKED, Outcome.UNDOCKED))
    assert result(outcome=outcome).docked is (outcome in (Outcome.DOCKED, Outcome.COMPLETE))


def test_the_smallest_clearance_of_a_trial_is_that_of_all_its_steps() -> None:
    values = (0.3, None, -0.002)
    steps = tuple(step(index=i, min_clearance_m=value) for i, value in enumerate(values))
    assert result(steps=steps).min_clearance_m == -0.002
    assert result(steps=steps[1:2]).min_clearance_m is None


def test_a_step_ends_as_its_last_attempt() -> None:
    ended = step()
    first = ended.attempts[0].model_copy(update={"contact": None, "phase": Phase.RETREAT, "ended_s": 4.0})
    both = step(attempts=(first, ended.attempts[0]))
    assert (both.phase, both.contact, both.ended_s) == (Phase.DONE, CONTACT, 9.02)
    assert step(attempts=(first,)).contact is None


def test_the_result_of_an_earlier_version_is_refused_with_its_version() -> None:
    """As version 0.1.0 wrote it: the figures of the last step in place of a list of steps."""
    flat = {**json.loads(result().to_json()), "attempts": 1, "versions": {"msrr-bullet": "0.1.0"}}
    del flat["steps"]
    with pytest.raises(ResultError, match=r"steps: .*msrr-bullet 0\.1\.0 wrote it, run the trial again"):
        TrialResult.from_json(json.dumps(flat))
    for text in ("", "[]", "{}", "not JSON"):
        with pytest.raises(ResultError, match="not a trial result of this version"):
            TrialResult.from_json(text)


def test_versions_hold_what_can_change_a_trial() -> None:
    assert {"python", "msrr-bullet", "pybullet", "numpy", "python-fcl"} <= set(package_versions())
    machine = trial_versions()
    assert machine["processor"].startswith(platform.machine())
    assert machine["libc"]
    assert package_versions().items() < machine.items()
