"""The corner filter where one exposure leaves open which of several poses is the right one."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest

from msrr_perception.estimation.corner_filter import CornerEkf
from msrr_perception.estimation.hypotheses import likeliest, mixed
from msrr_perception.motion.filter_state import FilterState
from msrr_perception.pose.target import TargetModel, pose_vector
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import Detections, Exposure, ExposureCounts, PoseEstimate, TagDetection
from msrr_scenes.specs.scene import Scene
from tests.conftest import not_none, pose_error
from tests.perception.conftest import project

PERIOD_NS = 40_000_000
SIGMA_PX = 0.5

#: Which tag of the port: one that is seen from the side, of which a mirrored pose is as likely, or the one
#: that faces the unit, of which the yaw is open.
OBLIQUE, FRONTAL = 0, 1

Look = Callable[[SE2, int, int], Detections]


@pytest.fixture
def look(target: TargetModel) -> Look:
    """Return how the k-th exposure shows one tag from a pose."""
    rng = np.random.default_rng(5)

    def detections(X_DU: SE2, which: int, k: int) -> Detections:
        tag = target.port_tags[which]
        corners = project(target, pose_vector(X_DU), target.corners_D[tag])[1]
        seen = TagDetection(tag, corners + rng.normal(0.0, SIGMA_PX, (4, 2)))
        return Detections(Exposure(target.camera_name, k, k * PERIOD_NS), (seen,), ())

    return detections


def _squared_deviations(estimate: PoseEstimate | None, X_DU: SE2) -> float:
    assert estimate is not None
    off = pose_error(estimate.X_DU, X_DU)
    return float(off @ np.linalg.solve(estimate.covariance, off))


@pytest.mark.parametrize(("which", "decided"), [(OBLIQUE, 45), (FRONTAL, 2)])
def test_one_tag_read_again_by_a_unit_that_stands_is_as_far_off_as_it_says(
    target: TargetModel, scene: Scene, look: Look, which: int, decided: int
) -> None:
    """By a covariance that is the second moment the mean square is 3, whatever the distribution.

    It is over two thousand places of 12 exposures each: 2.8 and 3.0, with deviations of 2.7 and 5.0, and of
    forty fifties 1.8 to 5.0: beyond the bounds by chance once in two hundred times. A filter that followed
    one pose alone had 318,000 and 60. So that none passes by being sure of nothing, the yaw has to be known
    in some places.
    """
    rng, squares, sure = np.random.default_rng(6), [], 0
    for _ in range(50):
        X_DU = SE2(-0.1 - rng.uniform(0.45, 0.85), *rng.uniform([-0.1, -0.35], [0.1, 0.35]).tolist())
        ekf = CornerEkf(target, scene.odometry, corner_sigma_px=SIGMA_PX)
        for k in range(12):
            ekf.add_detections(look(X_DU, which, k))
        estimate = ekf.predict(11 * PERIOD_NS)
        squares.append(_squared_deviations(estimate, X_DU))
        sure += estimate is not None and estimate.covariance[2, 2] < math.radians(3.0) ** 2
    assert 1.5 < np.mean(squares) < 6.0
    assert sure >= decided


def test_another_tag_decides(target: TargetModel, scene: Scene, look: Look) -> None:
    X_DU, ekf = SE2(-0.6, 0.05, 0.1), CornerEkf(target, scene.odometry, corner_sigma_px=SIGMA_PX)
    sigmas = []
    for k, which in enumerate((FRONTAL, OBLIQUE)):
        ekf.add_detections(look(X_DU, which, k))
        estimate = ekf.predict(PERIOD_NS)
        assert _squared_deviations(estimate, X_DU) < 25.0
        assert estimate is not None
        sigmas.append(math.degrees(math.sqrt(estimate.covariance[2, 2])))
    assert sigmas[1] < 3.0 < 6.0 < sigmas[0]


def test_exposures_in_any_order_leave_the_same_poses_open(
    target: TargetModel, scene: Scene, look: Look
) -> None:
    seen = [look(SE2(-0.6, 0.05, 0.1), FRONTAL, k) for k in range(3)]
    found = []
    for order in permutations(seen):
        ekf = CornerEkf(target, scene.odometry, corner_sigma_px=SIGMA_PX)
        for detections in order:
            ekf.add_detections(detections)
        estimate = not_none(ekf.predict(3 * PERIOD_NS))
        found.append((estimate.X_DU, estimate.covariance.tobytes()))
    assert math.sqrt(estimate.covariance[2, 2]) > math.radians(3.0)
    assert all(one == found[0] for one in found)


def test_exposures_that_agree_with_no_pose_leave_open_what_was(
    target: TargetModel, scene: Scene, look: Look
) -> None:
    """Two tags that disagree with it and with each other start nothing, however many exposures show them."""
    X_DU, sigmas = SE2(-0.6, 0.05, 0.1), []
    ekf = CornerEkf(target, scene.odometry, corner_sigma_px=SIGMA_PX, reset_after=3)
    for k in range(7):
        seen = look(X_DU, FRONTAL, k)
        if k > 1:
            (one,), (two,) = seen.tags, look(X_DU, OBLIQUE, k).tags
            tags = (replace(one, corners=one.corners + 100.0), replace(two, corners=two.corners - 80.0))
            seen = replace(seen, tags=tags)
        ekf.add_detections(seen)
        estimate = not_none(ekf.predict(k * PERIOD_NS))
        sigmas.append(math.degrees(math.sqrt(estimate.covariance[2, 2])))
    assert ekf.exposures == ExposureCounts(used=2, rejected=5)
    assert sigmas[1] > 3.0
    assert sigmas[2:] == sorted(sigmas[2:])


def test_rivals_are_those_that_lie_apart_and_are_not_far_less_likely() -> None:
    """Costs are told against that of the best, and all are as noisy as that and have seen the same."""
    used, others = ExposureCounts(used=3), ExposureCounts(used=2, rejected=1)

    def state(x: float, cost: float, wheels_until_ns: int, counts: ExposureCounts = others) -> FilterState:
        mean = np.array([x, 0.0, math.pi if wheels_until_ns % 2 else -math.pi, 0.0, 0.0])  # the same yaw
        return FilterState(
            9, mean, np.diag([1e-4] * 5), None, 0, 0, 1.0 + cost, wheels_until_ns, None, counts, cost
        )

    best, near, apart = state(0.0, 5.0, 1, used), state(0.004, 6.0, 4), state(0.02, 22.0, 3)
    near_apart, unlikely = state(0.0205, 22.5, 6), state(0.1, 23.5, 8)
    found = likeliest([unlikely, near_apart, apart, near, best])
    assert (found.mean is best.mean, found.cost, found.wheels_until_ns) == (True, 0.0, 3)
    (alternative,) = found.alternatives
    assert (alternative.mean is apart.mean, alternative.cost) == (True, 17.0)
    assert (
        (alternative.noise_scale, alternative.exposures)
        == (found.noise_scale, found.exposures)
        == (6.0, used)
    )


@pytest.mark.parametrize("yaw", [0.0, math.pi])
def test_a_mixture_is_the_best_pose_with_the_second_moments_of_all_about_it(yaw: float) -> None:
    """Each by its odds; where the headings wrap, as where they do not."""
    off = np.array([0.03, -0.02, 0.2])
    best = PoseEstimate(7, SE2(0.1, 0.2, yaw), np.diag([1e-4, 4e-4, 1e-3]), 5)
    other = PoseEstimate(7, SE2(0.1 + off[0], 0.2 + off[1], yaw + off[2]), np.diag([2e-4, 1e-4, 3e-3]), 5)
    assert mixed([best], [4.0]).X_DU == best.X_DU
    np.testing.assert_allclose(mixed([best], [4.0]).covariance, best.covariance)
    both = mixed([best, other], [4.0, 4.0 + 2.0 * math.log(3.0)])  # three times less likely
    assert (both.X_DU, both.stamp_ns, both.last_seen_ns) == (best.X_DU, 7, 5)
    moments = 0.75 * best.covariance + 0.25 * (other.covariance + np.outer(off, off))
    np.testing.assert_allclose(both.covariance, moments, atol=1e-12)
