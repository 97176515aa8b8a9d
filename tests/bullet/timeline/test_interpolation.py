"""Snapshots between the decisions of a trial."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from msrr_bullet.timeline.interpolation import SnapshotInterpolator, interpolate_pose
from msrr_scenes.errors import MsrrError
from msrr_scenes.geometry.se2 import SE2


def test_poses_between_two_lie_on_the_way():
    a, b = SE2(1.0, 2.0, 3.0), SE2(1.2, 1.9, -3.1)  # across the wrap of angles
    half = interpolate_pose(a, b, 0.5)
    np.testing.assert_allclose((a.inverse() @ half).log(), 0.5 * (a.inverse() @ b).log(), atol=1e-12)
    for fraction, end in ((0.0, a), (1.0, b)):
        np.testing.assert_allclose((end.inverse() @ interpolate_pose(a, b, fraction)).log(), 0.0, atol=1e-12)


def test_a_trial_is_interpolated_between_two_decisions_and_extended_beyond_them(drive):
    trial = SnapshotInterpolator(drive.snapshots)
    a, b = drive.snapshots[50:52]
    middle = trial.at((a.stamp_ns + b.stamp_ns) // 2)
    np.testing.assert_allclose(
        (a.units["a"].inverse() @ middle.units["a"]).log(),
        0.5 * (a.units["a"].inverse() @ b.units["a"]).log(),
        atol=1e-8,
    )
    assert sorted(s.first.los.left for s in (a, middle, b))[1] == middle.first.los.left != a.first.los.left
    assert middle.first.phase is a.first.phase
    assert trial.at(a.stamp_ns).units["a"] == a.units["a"]
    assert trial.at(trial.end_ns + 7).units == drive.snapshots[-1].units
    assert trial.until(a.stamp_ns)[-1] is a


def test_estimates_of_two_phases_are_not_mixed(drive):
    trial = SnapshotInterpolator(drive.snapshots)
    a, b = next(
        (a, b)
        for a, b in pairwise(drive.snapshots)
        if a.first.phase is not b.first.phase and a.first.estimate
    )
    assert trial.at((a.stamp_ns + b.stamp_ns) // 2).first.estimate is a.first.estimate


def test_a_trial_without_a_decision_is_refused():
    with pytest.raises(MsrrError, match="without a single decision"):
        SnapshotInterpolator([])
