"""Which tags the corner filter believes, and how much it believes its first look."""

from __future__ import annotations

import math
from copy import deepcopy
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from msrr_perception.estimation.corner_filter import CornerEkf
from msrr_perception.pose.target import TargetModel, pose_vector
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import Detections, Exposure, PoseMeasurement, TagDetection
from msrr_scenes.specs.scene import Scene
from tests.conftest import not_none
from tests.perception.conftest import see

X_DU = SE2(-0.6, 0.05, 0.1)
SIGMA_PX = 0.3
FRAME_NS = 40_000_000
#: 99.99 % of chi-square with 8 degrees of freedom, the eight coordinates of a tag's corners, from a table.
GATE = 31.83


def _shown(frame: int, tags: tuple[TagDetection, ...]) -> Detections:
    return Detections(Exposure("a/onboard", frame, frame * FRAME_NS), tags, ())


def _settled(target: TargetModel, scene: Scene, frames: int = 50, **options: Any) -> CornerEkf:
    """A filter that has just seen a unit stand still, without noise: it is sure where it is."""
    ekf = CornerEkf(target, scene.odometry, **{"corner_sigma_px": SIGMA_PX, **options})
    for frame in range(50 - frames, 50):
        ekf.add_detections(_shown(frame, see(pose_vector(X_DU), target.port_tags)))
    return ekf


def _after(ekf: CornerEkf, tags: tuple[TagDetection, ...]) -> np.ndarray:
    ekf.add_detections(_shown(50, tags))
    found = not_none(ekf.estimate(50 * FRAME_NS))
    return np.concatenate([found.X_DU.as_array(), found.covariance.ravel()])


def _spoilt(tag: TagDetection, distance: float) -> TagDetection:
    """A tag one of whose corners lies ``distance`` standard deviations from its place, along the diagonal."""
    corners = np.array(tag.corners)
    outwards = corners[0] - corners[2]
    corners[0] += distance * SIGMA_PX * outwards / np.linalg.norm(outwards)
    return TagDetection(tag.tag_id, corners)


@pytest.mark.parametrize(
    ("share", "believed"), [(0.8, True), (1.25, False), (4.0, False), (30.0, False), (400.0, False)]
)
def test_a_tag_beyond_the_gate_is_as_good_as_not_there(
    target: TargetModel, scene: Scene, share: float, believed: bool
) -> None:
    """One corner off by the root of ``share`` of the gate; the settled belief adds little to the noise."""
    tags = see(pose_vector(X_DU), target.port_tags)
    bad = (_spoilt(tags[0], math.sqrt(share * GATE)), *tags[1:])
    with_it = _after(_settled(target, scene), bad)
    without = _after(_settled(target, scene), tags[1:])
    assert np.array_equal(with_it, without) is not believed


def test_the_gate_passes_its_share_of_good_tags(target: TargetModel, scene: Scene) -> None:
    """A gate of 80 %: 200 noisy looks at one tag, each by a filter that is sure where it is.

    The standard error of the share that passes is 0.028: bounds of 0.15 are five of them, odds below 1e-6.
    """
    rng, settled = np.random.default_rng(17), _settled(target, scene, gate_probability=0.8, frames=15)
    passed = 0
    for _ in range(200):
        ekf = deepcopy(settled, {id(target): target})
        _after(ekf, see(pose_vector(X_DU), target.port_tags[:1], rng, SIGMA_PX))
        found = not_none(ekf.estimate(50 * FRAME_NS))
        passed += found.last_seen_ns == 50 * FRAME_NS
    assert passed / 200 == pytest.approx(0.8, abs=0.15)


@pytest.mark.parametrize(("options", "inflation"), [({}, 2.0), ({"start_inflation": 5.0}, 5.0)])
def test_the_first_covariance_is_inflated_by_the_given_factor(
    target: TargetModel, scene: Scene, options: dict[str, float], inflation: float
) -> None:
    covariance = np.diag([1e-4, 2e-4, 3e-4])
    pose = PoseMeasurement(Exposure("a/onboard", 0, 0), X_DU, covariance, (None, None))
    by_pose = CornerEkf(target, scene.odometry, **options)
    by_pose.add_pose(pose)
    found = not_none(by_pose.estimate(0))
    np.testing.assert_allclose(found.covariance, inflation * covariance, rtol=1e-12)

    look = _shown(0, see(pose_vector(X_DU), target.port_tags))
    plain, inflated = (CornerEkf(target, scene.odometry, **o) for o in ({"start_inflation": 1.0}, options))
    for ekf in (plain, inflated):
        ekf.add_detections(look)
    one, more = plain.estimate(0), inflated.estimate(0)
    assert one is not None
    assert more is not None
    # Where edges look to be, and the tilt of the floor, are not inflated, and small.
    np.testing.assert_allclose(more.covariance, inflation * one.covariance, rtol=0.05)


def test_corners_that_are_less_sure_than_modelled_count_less(target: TargetModel, scene: Scene) -> None:
    """What a picture tells shrinks with a measured deviation that is large, not with a small one."""
    tags = see(pose_vector(X_DU), target.port_tags)
    known = []
    for sigma in (None, 1e-4, 0.2, 1.0):
        told = [t if sigma is None else replace(t, corner_sigma_px=np.full(4, sigma)) for t in tags]
        ekf = _settled(target, scene, frames=1, corner_sigma_px=None)
        known.append(_after(ekf, tuple(told))[3:].reshape(3, 3))
    plain, small, large, larger = known
    np.testing.assert_array_equal(small, plain)
    assert np.linalg.eigvalsh(large - plain).min() > -1e-12
    assert np.trace(plain) < np.trace(large) < np.trace(larger)
