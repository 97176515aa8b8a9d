"""What was learned of errors of calibration is told by their names, in their units, against tolerances."""

from __future__ import annotations

import numpy as np
import pytest

from msrr_perception.estimation.calibration_errors import calibration_errors
from msrr_perception.estimation.corner_filter import CornerEkf
from msrr_perception.motion.filter_state import CalibrationEstimate
from msrr_perception.pose.calibration import POSE_SIZE
from msrr_perception.pose.target import TargetModel
from msrr_scenes.specs.scene import Scene


def test_tolerances_are_those_of_the_scene_and_errors_are_told_by_them(careful: Scene) -> None:
    target = TargetModel.from_scene(careful.told(), careful.docks[0])
    layout, prior = target.filter_layout, CornerEkf(target, careful.odometry).prior
    sigmas = np.sqrt(np.diag(layout.errors(prior.mean, prior.covariance)[1]))
    by = np.linspace(-6.0, 6.0, len(sigmas))
    drive = layout.first - POSE_SIZE
    mean = np.concatenate([(by * sigmas)[:drive], layout.by_errors @ (by * sigmas)[drive:]])
    learned = CalibrationEstimate(mean, 0.25 * prior.covariance, prior.shared)
    named = [k for k, quantity in enumerate(layout.quantities) if quantity is not None]
    found = calibration_errors(layout, prior, learned)
    assert [one.quantity for one in found] == [layout.quantities[k] for k in named]
    for k, one in zip(named, found, strict=True):
        group, key = one.quantity.name.split(".")
        if group != "drive":  # encoders add to what is known of wheels
            assert one.tolerance == pytest.approx(getattr(getattr(careful.as_built, group), key).sigma), key
        assert (one.error, one.sigma) == pytest.approx((by[k] * one.tolerance, 0.5 * one.tolerance))
        assert one.deviation == pytest.approx(by[k])
        assert one.contradicts == (abs(by[k]) > 4.5)
