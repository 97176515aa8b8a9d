"""The step of the corner filter: when it starts anew, what it counts, and on which readings it rests."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from msrr_perception.estimation.corner_update import CornerUpdate
from msrr_perception.estimation.filter_step import FilterStep
from msrr_perception.motion.drive_motion import DriveMotion
from msrr_perception.motion.motion_noise import DEFAULT_NOISE
from msrr_perception.motion.wheel_history import WheelHistory
from msrr_perception.pose.target import TargetModel, pose_vector
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import (
    Detections,
    Exposure,
    ExposureCounts,
    PoseMeasurement,
    WheelOdometry,
)
from msrr_scenes.specs.scene import Scene
from tests.conftest import not_none
from tests.perception.conftest import see

X_DU = SE2(-0.6, 0.05, 0.1)
FIRST, NEXT = Exposure("a/onboard", 0, 0), Exposure("a/onboard", 1, 40_000_000)
RESET_AFTER = 5


class Stepper:
    """A filter step with its wheels, and the state after a first exposure of all tags."""

    def __init__(self, target: TargetModel, scene: Scene) -> None:
        self.motion, self.wheels = DriveMotion(target, scene.odometry, DEFAULT_NOISE), WheelHistory()
        self.wheel_radius = target.wheel_radius
        update = CornerUpdate(target, 0.3, DEFAULT_NOISE.tilt_sigma, 0.9999, 2.0)
        self.step = FilterStep(self.motion, update, self.wheels, RESET_AFTER)
        for k in range(10):
            self.wheels.add(WheelOdometry("a", k * 10_000_000, 0.02 * k, 0.02 * k))
        first = self.step.take(None, Detections(FIRST, see(pose_vector(X_DU), target.port_tags), ()))
        assert first is not None
        self.first = first


@pytest.fixture
def stepper(target: TargetModel, scene: Scene) -> Stepper:
    return Stepper(target, scene)


def _measured(X_DU: SE2, exposure: Exposure = NEXT) -> PoseMeasurement:
    return PoseMeasurement(exposure, X_DU, 1e-6 * np.eye(3), (None, None))


@pytest.mark.parametrize("axis", [0, 1])
def test_a_state_whose_position_is_unknown_is_started_anew_at_once(stepper: Stepper, axis: int) -> None:
    """From a standard deviation of 10 m on, whatever is thought of the wheels; a smaller one is corrected."""
    used, anew = ExposureCounts(used=2), ExposureCounts(used=1, rejected=1)
    for sigma, doubted_ns, counts in ((9.9, None, used), (10.1, None, anew), (10.1, 0, anew)):
        covariance = stepper.first.covariance.copy()
        covariance[axis, axis] = sigma**2
        before = stepper.first._replace(covariance=covariance, wheels_doubted_ns=doubted_ns)
        after = not_none(stepper.step.take(before, _measured(X_DU)))
        assert after.exposures == counts
        assert after.rejected == 0
        np.testing.assert_allclose(after.mean[:2], X_DU.translation, atol=1e-2)


def test_both_axes_together_make_a_position_unknown(stepper: Stepper) -> None:
    covariance = stepper.first.covariance.copy()
    covariance[[0, 1], [0, 1]] = 7.2**2
    after = not_none(stepper.step.take(stepper.first._replace(covariance=covariance), _measured(X_DU)))
    assert after.exposures == ExposureCounts(used=1, rejected=1)


def test_a_state_that_no_measurement_confirms_is_kept_until_the_last_that_may_disagree(
    stepper: Stepper,
) -> None:
    """A pose measured 20 m away moves nothing, and the last that may disagree in a row is the new start."""
    state, elsewhere = stepper.first, SE2(-20.0, 3.0, 1.0)
    for k in range(1, RESET_AFTER + 1):
        after = stepper.step.take(state, _measured(elsewhere, Exposure("a/onboard", k, k * 40_000_000)))
        assert after is not None
        assert after.exposures == ExposureCounts(used=1, rejected=k)
        far = math.hypot(*(after.mean[:2] - elsewhere.translation))
        if k < RESET_AFTER:
            assert (after.rejected, after.last_seen_ns) == (k, 0)
            assert far > 15.0
            state = after
    assert (after.rejected, after.last_seen_ns) == (0, RESET_AFTER * 40_000_000)
    assert far < 0.01


def test_a_measurement_that_starts_nothing_leaves_the_state_as_it_was(
    stepper: Stepper, target: TargetModel
) -> None:
    """Two tags that disagree with each other as well, when a new start is due."""
    last, (one, two, _) = stepper.first._replace(rejected=9), see(pose_vector(X_DU), target.port_tags)
    tags = (replace(one, corners=one.corners + 100.0), replace(two, corners=two.corners - 80.0))
    after = not_none(stepper.step.take(last, Detections(NEXT, tags, ())))
    assert (after.rejected, after.last_seen_ns) == (10, 0)
    assert after.exposures == ExposureCounts(used=1, rejected=1)
    np.testing.assert_allclose(after.mean[1:3], stepper.first.mean[1:3], atol=0.01)


def test_whichever_pose_of_a_new_start_leads_counts_on_from_the_state_before(
    stepper: Stepper, target: TargetModel
) -> None:
    """One tag leaves poses open; the count began again where another one than the first took the lead."""
    last, elsewhere = stepper.first._replace(rejected=RESET_AFTER - 1), SE2(-0.8, -0.1, 0.2)
    after = stepper.step.take(last, Detections(NEXT, see(pose_vector(elsewhere), target.port_tags[:1]), ()))
    assert after is not None
    assert after.alternatives
    for state in (after, *after.alternatives):
        assert state.exposures == ExposureCounts(used=1, rejected=1)
        assert state.wheels_until_ns == stepper.motion.wheels_until(state) > NEXT.stamp_ns
        assert (state.rejected, state.last_seen_ns) == (0, NEXT.stamp_ns)


def test_a_pose_with_which_a_measurement_does_not_agree_is_less_likely(stepper: Stepper) -> None:
    mean = stepper.first.mean.copy()
    mean[0] -= 0.3
    other = stepper.first._replace(mean=mean, alternatives=())
    for one, another in ((stepper.first, other), (other, stepper.first)):
        after = not_none(stepper.step.take(one._replace(alternatives=(another,)), _measured(X_DU)))
        np.testing.assert_allclose(after.mean[:2], X_DU.translation, atol=0.01)
        assert after.alternatives == ()
        assert after.exposures == ExposureCounts(used=2)


def test_wheels_that_agree_again_are_trusted_after_they_did_not(stepper: Stepper) -> None:
    """As long as none has been corrected without them."""
    wheels = not_none(stepper.wheels.angles_at(NEXT.stamp_ns))
    measured = _measured(X_DU @ SE2(wheels.left * stepper.wheel_radius, 0.0, 0.0))
    at_once = stepper.step.take(stepper.first, measured)
    again = stepper.step.take(stepper.first._replace(rejected=RESET_AFTER - 1), measured)
    assert at_once is not None
    assert again is not None
    np.testing.assert_array_equal(again.mean, at_once.mean)
    np.testing.assert_array_equal(again.covariance, at_once.covariance)
    assert (again.exposures, again.rejected) == (ExposureCounts(used=2), 0)
    third = not_none(stepper.step.take(stepper.first._replace(rejected=2), measured))
    np.testing.assert_array_equal(third.covariance, at_once.covariance)


def test_what_agrees_only_without_the_wheels_is_counted_and_dated(stepper: Stepper) -> None:
    """Wheels that are doubted already, and a unit that has been carried 2 cm aside meanwhile."""
    aside = X_DU @ SE2(0.0, 0.02, 0.0)
    doubted = stepper.first._replace(wheels_doubted_ns=0)
    after = not_none(stepper.step.take(doubted, _measured(aside)))
    assert after.exposures == ExposureCounts(used=1, without_wheels=1)
    assert (after.wheels_doubted_ns, after.rejected) == (NEXT.stamp_ns, 0)
    last = not_none(stepper.step.take(doubted._replace(rejected=RESET_AFTER - 1), _measured(aside)))
    assert last.exposures == ExposureCounts(used=1, rejected=1), "it starts anew, and trusts the wheels"
    assert last.wheels_doubted_ns is None
    trusted = not_none(stepper.step.take(stepper.first, _measured(aside)))
    assert trusted.exposures == ExposureCounts(used=1, rejected=1)
    assert (trusted.wheels_doubted_ns, trusted.rejected) == (None, 1)


@pytest.mark.parametrize("clock", [False, True])
def test_a_measured_pose_rests_on_the_wheels_about_it_only_where_the_clock_is_estimated(
    target: TargetModel, scene: Scene, clock: bool
) -> None:
    """Rows of a picture are exposed one after the other, so that a picture always does."""
    tolerances = replace(target.tolerances, clock_s=0.02) if clock else target.tolerances
    stepper = Stepper(replace(target, tolerances=tolerances), scene)
    assert stepper.motion.learns_clock is clock
    wheels = not_none(stepper.wheels.angles_at(NEXT.stamp_ns))
    way = 0.5 * (wheels.left + wheels.right) * target.wheel_radius
    X = X_DU @ SE2(way, 0.0, 0.0)
    for measurement, rests in (
        (_measured(X), clock),
        (Detections(NEXT, see(pose_vector(X), target.port_tags), ()), True),
    ):
        after = not_none(stepper.step.take(stepper.first, measurement))
        assert after.exposures == ExposureCounts(used=2)
        prior = stepper.motion.to_measurement(stepper.first, stepper.wheels, NEXT.stamp_ns)
        assert after.wheels_until_ns == (stepper.motion.wheels_until(prior) if rests else 0)
