"""Sums of errors of mounts: images tell apart neither what holds a tag, nor where a whole marker is."""

from __future__ import annotations

import numpy as np
import pytest

from msrr_perception.pose.marker_mounts import (
    MOUNT_SIZE,
    OFF_FLOOR,
    ON_FLOOR,
    mounts_by_errors,
    reference_tag,
)
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se3 import SE3

RNG = np.random.default_rng(8)


def _marker(count: int) -> tuple[Array, Array]:
    """Return middles and rotations of tags that lean in all directions."""
    poses = [SE3.from_xyz_rpy(0.05 * RNG.normal(size=3), RNG.normal(size=3)) for _ in range(count)]
    return np.array([X.p for X in poses]), np.array([X.R for X in poses])


def _split(sums: Array, reference: int) -> tuple[Array, Array, Array]:
    """Return what images depend on, the place of the reference by its own mount, and that of the marker."""
    of_tags = sums[3:-3].reshape(-1, MOUNT_SIZE).copy()
    own = of_tags[reference, ON_FLOOR].copy()
    of_tags[reference, ON_FLOOR] = 0.0
    return of_tags, own, sums[-3:]


def _errors(bracket: Array, tags: Array) -> Array:
    return np.concatenate([bracket[list(OFF_FLOOR)], tags.ravel(), bracket[list(ON_FLOOR)]])


@pytest.mark.parametrize("count", [1, 2, 3, 7])
def test_what_a_bracket_does_its_tags_can_do_as_well(count: int) -> None:
    """To first order, against the chain of frames, for a bracket that is off in all directions."""
    centres, axes = _marker(count)
    by_errors, reference = mounts_by_errors(centres, axes), reference_tag(centres)
    assert np.linalg.cond(by_errors) < 1e3
    step, bracket = 1e-6, RNG.normal(size=MOUNT_SIZE)
    X_moved = SE3.from_xyz_rpy(step * bracket[:3], step * bracket[3:])
    tags, middle = np.zeros((count, MOUNT_SIZE)), centres.mean(axis=0)
    for tag, centre, R in zip(tags, centres, axes, strict=True):
        tag[:3] = R.T @ (middle + X_moved.act(centre - middle) - centre) / step
        turn = (X_moved.R - np.eye(3)) / step
        tag[3:] = R.T @ [turn[2, 1], turn[0, 2], turn[1, 0]]
    none = np.zeros(MOUNT_SIZE)
    by_bracket = _split(by_errors @ _errors(bracket, np.zeros((count, MOUNT_SIZE))), reference)
    by_tags = _split(by_errors @ _errors(none, tags), reference)
    np.testing.assert_allclose(by_bracket[0], by_tags[0], atol=1e-5)
    np.testing.assert_allclose(by_bracket[2], by_tags[2], atol=1e-5)


def test_where_a_marker_is_on_the_floor_no_image_depends_on() -> None:
    centres, axes = _marker(4)
    by_errors, reference = mounts_by_errors(centres, axes), reference_tag(centres)
    bracket = np.zeros(MOUNT_SIZE)
    bracket[list(ON_FLOOR)] = RNG.normal(size=3)
    of_tags, own, place = _split(by_errors @ _errors(bracket, np.zeros((4, MOUNT_SIZE))), reference)
    np.testing.assert_allclose(of_tags, 0.0, atol=1e-12)
    np.testing.assert_allclose(own, 0.0, atol=1e-12)
    arm = centres[reference] - centres.mean(axis=0)
    x, y, yaw = bracket[list(ON_FLOOR)]
    np.testing.assert_allclose(place, [x - yaw * arm[1], y + yaw * arm[0], yaw], atol=1e-12)


def test_the_reference_is_the_tag_in_the_middle() -> None:
    centres = np.array([[0.03, -0.02, 0.1], [0.0, 0.0, 0.1], [0.03, 0.02, 0.1], [-0.03, 0.0, 0.1]])
    assert reference_tag(centres) == 1
