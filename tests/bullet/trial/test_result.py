"""The result of a trial: written, read back, and strict about values."""

import json
import math

import pytest
from pydantic import ValidationError

from msrr_bullet.trial.result import (
    AttemptRecord,
    Contact,
    PlanarPose,
    Seating,
    TrialResult,
    package_versions,
)
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import Phase
from msrr_scenes.outcome import Outcome

POSE = PlanarPose(x_m=-0.1, y_m=1e-17, yaw_rad=math.pi / 7)


def result(**changes: object) -> TrialResult:
    values: dict[str, object] = {
        "scene": "close_range",
        "scene_hash": "00ff",
        "seed": 3,
        "plant": "bullet",
        "perception": "images",
        "outcome": Outcome.DOCKED,
        "belief": "docked",
        "belief_reason": "seated by sight",
        "attempts": 1,
        "duration_s": 9.02,
        "phase": Phase.DONE,
        "contact": Contact(time_s=7.3, lateral_m=0.1 + 0.2, yaw_rad=1e-300, estimate_error=POSE),
        "seating": Seating(axial_gap_m=-1e-5, lateral_m=0.0, yaw_rad=0.0, seated=True),
        "lock_closed": True,
        "lock_engaged": True,
        "pull_test_passed": True,
        "min_clearance_m": 0.25,
        "records": (
            AttemptRecord(
                step=0, attempt=1, ended_s=9.0, phase=Phase.DONE, reason="", believed=None, true=POSE
            ),
        ),
    }
    return TrialResult.model_validate({**values, **changes})


def test_json_reads_back_bit_for_bit() -> None:
    assert TrialResult.from_json(result().to_json()) == result()


def test_json_holds_plain_values() -> None:
    data = json.loads(result().to_json())
    assert data["outcome"] == "docked"
    assert data["phase"] == "done"
    assert data["records"][0]["believed"] is None
    assert data["versions"]["pybullet"]


@pytest.mark.parametrize(
    "changes",
    [
        {"duration_s": math.nan},
        {"duration_s": -1.0},
        {"attempts": -1},
        {"belief": "perhaps"},
        {"outcome": "undocked"},
        {"plant": "gazebo"},
        {"score": 1.0},
        {"min_clearance_m": math.inf},
    ],
)
def test_impossible_values_are_refused(changes: dict[str, object]) -> None:
    with pytest.raises(ValidationError):
        result(**changes)


def test_a_result_cannot_be_changed() -> None:
    with pytest.raises(ValidationError):
        result().outcome = Outcome.JAMMED


@pytest.mark.parametrize("outcome", list(Outcome))
def test_docked_is_a_single_outcome(outcome: Outcome) -> None:
    assert result(outcome=outcome).docked is (outcome is Outcome.DOCKED)


def test_poses_are_converted_both_ways() -> None:
    X = SE2(0.1, -0.2, 0.3)
    assert PlanarPose.of(X).se2 == X


def test_versions_hold_what_can_change_a_trial() -> None:
    assert {"python", "msrr-bullet", "pybullet", "numpy", "python-fcl"} <= set(package_versions())
