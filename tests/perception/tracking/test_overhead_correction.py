"""The correction of sight by the overhead camera: the weighted mean, contradictions, and in the port."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from msrr_perception.pose.target import TargetModel
from msrr_perception.tracking.overhead_correction import OverheadCorrection
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import PoseEstimate
from msrr_scenes.specs.scene import Scene
from tests.conftest import pose_error

TRUE = SE2(-0.2, 0.002, 0.01)
MIXED = np.array([[1.0, 0.1, -0.1], [0.1, 1.0, -0.8], [-0.1, -0.8, 1.0]])
#: Standard deviations [m, m, rad] by the onboard camera, and by the overhead camera, with their covariances.
BY_SIGHT, FROM_ABOVE = np.array([1.2e-3, 1.7e-3, 6e-3]), np.array([1.7e-3, 1.4e-3, 5e-3])
P_SIGHT, P_ABOVE = MIXED * np.outer(BY_SIGHT, BY_SIGHT), MIXED[::-1, ::-1] * np.outer(FROM_ABOVE, FROM_ABOVE)


@pytest.fixture
def correction() -> OverheadCorrection:
    given = {"name": "pair", "units": {"a": {"number": 0}, "b": {"number": 1}}}
    scene = Scene.model_validate({**given, "plan": [{"unit": "a", "to": "b.rear"}]})
    return OverheadCorrection(TargetModel.from_scene(scene, scene.docks[0]))


def estimate(X_DU: SE2, covariance: np.ndarray) -> PoseEstimate:
    return PoseEstimate(1_000_000_000, X_DU, covariance, 990_000_000)


def corrected(correction: OverheadCorrection, by_sight: PoseEstimate, above: PoseEstimate) -> PoseEstimate:
    correction.update(by_sight, above)
    return correction.apply(by_sight)


def off(error: np.ndarray) -> SE2:
    return SE2(*(TRUE.as_array() + error))


def test_the_mean_of_both_is_better_than_either_and_as_good_as_it_says(
    correction: OverheadCorrection,
) -> None:
    """2,000 draws: the squares leave their bounds in 1 of 10,000 sets; side and heading are better."""
    rng, draws = np.random.default_rng(3), 2000
    errors, squares = [], 0.0
    for by_sight, from_above in zip(
        rng.multivariate_normal(np.zeros(3), P_SIGHT, draws),
        rng.multivariate_normal(np.zeros(3), P_ABOVE, draws),
        strict=True,
    ):
        correction.reset()
        sight = estimate(off(by_sight), P_SIGHT)
        fused = corrected(correction, sight, estimate(off(from_above), P_ABOVE))
        assert (fused.stamp_ns, fused.last_seen_ns) == (sight.stamp_ns, sight.last_seen_ns)
        errors.append(pose_error(fused.X_DU, TRUE))
        squares += float(errors[-1] @ np.linalg.solve(fused.covariance, errors[-1]))
    low, high = chi2.ppf([5e-5, 1.0 - 5e-5], 3 * draws)
    assert low < squares < high
    assert (np.std(errors, axis=0) < 0.85 * np.minimum(BY_SIGHT, FROM_ABOVE)).all()


def test_the_last_correction_holds_on_in_the_port(correction: OverheadCorrection) -> None:
    """Between pins and port there is no correction but the last one, and the covariance is that of sight."""
    sight = estimate(TRUE, P_SIGHT)
    assert correction.is_due(sight)
    assert correction.apply(sight) is sight
    fused = corrected(correction, sight, estimate(off(np.array([0.0, 2e-3, 0.0])), P_ABOVE))
    shift = pose_error(fused.X_DU, TRUE)
    assert 0.5e-3 < shift[1] < 1.5e-3
    at_port = estimate(SE2(-0.12, 0.0, math.radians(1.0)), 4.0 * P_SIGHT)
    assert not correction.is_due(replace(at_port, stamp_ns=sight.stamp_ns + 10**10))
    held = correction.apply(at_port)
    np.testing.assert_allclose(pose_error(held.X_DU, at_port.X_DU), shift, atol=1e-15)
    assert held.covariance is at_port.covariance
    beside = replace(at_port, X_DU=SE2(-0.12, -0.8, math.radians(80.0)))
    assert correction.is_due(replace(beside, stamp_ns=sight.stamp_ns + 10**10))


def test_where_both_contradict_each_other_sight_alone_counts(correction: OverheadCorrection) -> None:
    """Until the next approach, whatever is seen from above meanwhile."""
    sight = estimate(TRUE, P_SIGHT)
    above = estimate(off(np.array([0.0, 2e-3, 0.0])), P_ABOVE)
    correction.update(sight, above)
    wrong = replace(above, X_DU=off(np.array([0.0, 0.03, math.radians(2.0)])))
    assert corrected(correction, sight, wrong) is sight
    assert not correction.is_due(replace(sight, stamp_ns=sight.stamp_ns + 10**10))
    correction.reset()
    assert correction.is_due(sight)
    assert corrected(correction, sight, above) is not sight


def test_a_correction_is_good_for_a_tenth_of_a_second(correction: OverheadCorrection) -> None:
    """Meanwhile it shifts what is seen then, with the covariance of the mean of what is known then."""
    sight = estimate(TRUE, P_SIGHT)
    correction.update(sight, estimate(off(np.array([0.0, 2e-3, 0.0])), P_ABOVE))
    for ms, due in ((90, False), (100, True)):
        assert correction.is_due(replace(sight, stamp_ns=sight.stamp_ns + ms * 10**6)) is due
    nearer = estimate(SE2(-0.19, 0.001, 0.0), 4.0 * P_SIGHT)
    known = correction.apply(nearer)
    shift = pose_error(correction.apply(sight).X_DU, TRUE)
    np.testing.assert_allclose(pose_error(known.X_DU, nearer.X_DU), shift, atol=1e-15)
    assert np.linalg.eigvalsh(nearer.covariance - known.covariance).min() > 0.0
