"""The equations of bundle adjustment: derivatives, and what the choice of the map's frame does not change."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from msrr_perception.mapping.bundle import Bundle, Sightings
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.distortion import Distortion
from msrr_scenes.geometry.lens import Lens
from msrr_scenes.geometry.pinhole import PinholeCamera

LENS = Lens(PinholeCamera(800, 600, 700.0, (4.0, -3.0)), Distortion(-0.1, 0.02, 0.002, -0.003, 0.01, 1.03))
VIEWS, TAGS, REFERENCE = 3, 4, 1


def bundle(refines_lens: bool = True) -> Bundle:
    rng = np.random.default_rng(7)

    def rotations(count: int, spread: float) -> Array:
        return np.stack([cv2.Rodrigues(w)[0] for w in rng.normal(0.0, spread, (count, 3))])

    p_CM = rng.uniform([-0.2, -0.2, 1.5], [0.2, 0.2, 2.0], (VIEWS, 3))
    p_MT = rng.uniform(-0.4, 0.4, (TAGS, 3))
    return Bundle(LENS, rotations(VIEWS, 0.2), p_CM, rotations(TAGS, 0.3), p_MT, REFERENCE, 0.1, refines_lens)


def sightings() -> Sightings:
    """Every tag in every picture but one, anywhere in it."""
    view, tag = np.divmod(np.arange(1, VIEWS * TAGS), TAGS)
    return Sightings(view, tag, np.random.default_rng(8).uniform(0.0, 600.0, (len(view), 4, 2)))


@pytest.mark.parametrize("refines_lens", [False, True])
def test_derivatives_are_those_of_the_residuals(refines_lens: bool) -> None:
    of, seen = bundle(refines_lens), sightings()
    assert of.variables == 6 * (VIEWS + TAGS - 1) + 5 * refines_lens
    columns = []
    for step in 1e-6 * np.eye(of.variables):
        columns.append((of.moved(step).residuals(seen) - of.moved(-step).residuals(seen)) / 2e-6)
    np.testing.assert_allclose(of.jacobian(seen).toarray(), np.column_stack(columns), rtol=0, atol=2e-5)


def test_the_reference_does_not_move_and_all_others_do() -> None:
    before = bundle()
    after = before.moved(np.full(before.variables, 0.01))
    for tag in range(TAGS):
        same = np.array_equal(after.X_MT(tag).matrix(), before.X_MT(tag).matrix())
        assert same == (tag == REFERENCE)


@pytest.mark.parametrize("tag", range(TAGS))
def test_the_frame_of_the_map_is_no_matter_of_what_is_seen(tag: int) -> None:
    before, seen = bundle(), sightings()
    after = before.referred_to(tag)
    np.testing.assert_allclose(after.residuals(seen), before.residuals(seen), atol=1e-9)
    np.testing.assert_allclose(after.X_MT(tag).matrix(), np.eye(4), atol=1e-12)
    assert after.reference == tag


def test_corners_behind_a_camera_have_finite_pixels() -> None:
    """A step of the solver may carry them there."""
    behind, seen = bundle().moved(np.where(np.arange(41) % 6 == 5, -3.0, 0.0)), sightings()
    assert behind.corners_C(seen)[..., 2].max() < 0.0
    assert np.isfinite(behind.residuals(seen)).all()
    assert np.isfinite(behind.jacobian(seen).data).all()
