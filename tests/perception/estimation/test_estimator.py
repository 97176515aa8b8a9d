"""What an estimator of a user's own may return, and what is refused."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from msrr_perception.estimation.estimator import ESTIMATORS
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import NS_PER_S, PoseEstimate

POSE = PoseEstimate(20, SE2(-0.5, 0.1, 0.2), np.diag([1e-4, 1e-4, 1e-3]), 10)
check = ESTIMATORS.methods["estimate"]


def test_a_pose_passes_and_its_numbers_become_plain_ones() -> None:
    numpy = PoseEstimate(np.int64(20), POSE.X_DU, POSE.covariance.astype(np.float32), np.int64(10))
    pose = check(numpy, 20)
    assert (type(pose.stamp_ns), pose.covariance.dtype) == (int, float)
    assert pose.X_DU == POSE.X_DU
    assert check(None, 20) is None
    assert check(replace(POSE, covariance=np.zeros((3, 3))), 20) is not None


@pytest.mark.parametrize(
    ("pose", "why"),
    [
        (SE2(), "expected a PoseEstimate"),
        ((0.0, 0.0, 0.0), "expected a PoseEstimate"),
        (replace(POSE, X_DU=(0.0, 0.0, 0.0)), "expected a PoseEstimate with a pose X_DU in SE"),
        (replace(POSE, X_DU=SE2(float("nan"), 0.0, 0.0)), "expected a pose of finite numbers"),
        (replace(POSE, X_DU=SE2(0.0, 0.0, float("nan"))), "expected a pose of finite numbers"),
        (replace(POSE, X_DU=SE2(-700.0, 0.0, 0.0)), "expected a pose in metres, no farther than 100 m"),
        (replace(POSE, X_DU=SE2(0.0, -1e300, 0.0)), "expected a pose in metres"),
        (replace(POSE, covariance=[[1.0, 0.0], [0.0]]), r"a covariance of numbers of shape \(3, 3\)"),
        (replace(POSE, covariance=np.eye(2)), r"a covariance of shape \(2, 2\)"),
        (replace(POSE, covariance=None), r"a covariance of shape \(\)"),
        (replace(POSE, covariance=np.full((3, 3), np.nan)), "a covariance of numbers up to"),
        (replace(POSE, covariance=1e300 * np.eye(3)), "a covariance of numbers up to"),
        (replace(POSE, covariance=-np.eye(3)), "symmetric and not negative"),
        (replace(POSE, covariance=np.eye(3) + np.eye(3, k=1)), "symmetric and not negative"),
        (replace(POSE, covariance=np.ones((3, 3)) + 2 * np.eye(3)[::-1]), "symmetric and not negative"),
        (replace(POSE, stamp_ns=0.02), "a time in whole nanoseconds"),
        (replace(POSE, stamp_ns=-1), "a trial, which begins at 0"),
        (replace(POSE, last_seen_ns=None), "a time in whole nanoseconds"),
    ],
)
def test_what_is_no_pose_is_refused(pose: Any, why: str) -> None:
    with pytest.raises(ValueError, match=why):
        check(pose, 20)


@pytest.mark.parametrize(
    ("method", "of"), [("estimate", "in the future"), ("predict", "ahead of the instant asked for")]
)
@pytest.mark.parametrize("key", ["stamp_ns", "last_seen_ns"])
def test_a_time_may_be_ahead_by_what_a_clock_may_be(method: str, of: str, key: str) -> None:
    asked_ns = 5 * NS_PER_S
    latest = replace(POSE, **{key: asked_ns + NS_PER_S})
    assert ESTIMATORS.methods[method](latest, asked_ns).last_seen_ns == latest.last_seen_ns
    later = replace(POSE, **{key: asked_ns + NS_PER_S + 1_000_000})
    with pytest.raises(ValueError, match=f"a {key} that is 1.001 s {of}; expected"):
        ESTIMATORS.methods[method](later, asked_ns)
