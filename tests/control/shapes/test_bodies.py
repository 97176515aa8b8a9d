"""Gaps between bodies, against the distance of two polygons computed corner by corner."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest

from msrr_control.coordination.setup import CoordinationSetup
from msrr_control.shapes.bodies import Body
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.unit_geometry import find_urdf, read_unit


def _corner_distance(a: Array, b: Array) -> float:
    """Smallest distance of the corners of ``b`` from the border of ``a`` [m]."""
    start, edge = a, np.roll(a, -1, axis=0) - a
    to = b[:, None] - start[None]
    share = np.clip((to * edge).sum(-1) / (edge * edge).sum(-1), 0.0, 1.0)
    return float(np.linalg.norm(to - share[..., None] * edge, axis=-1).min())


def _distance(body: Body, X_WA: SE2, X_WB: SE2) -> float:
    a, b = X_WA.act(body.outline), X_WB.act(body.outline)
    return min(_corner_distance(a, b), _corner_distance(b, a))


def test_a_gap_is_the_distance_or_a_little_less(setup: CoordinationSetup) -> None:
    body, rng = setup.lanes.body, np.random.default_rng(1)
    for _ in range(400):
        X_WA = SE2(*rng.uniform(-math.pi, math.pi, 3))
        X_WB = X_WA @ SE2(*rng.uniform([-0.5, -0.5, -math.pi], [0.5, 0.5, math.pi]))
        gap = body.gap(X_WA, X_WB)
        if gap > 0.0:
            distance = _distance(body, X_WA, X_WB)
            assert 0.92 * distance - 1e-9 <= gap <= distance + 1e-9
        np.testing.assert_allclose(gap, body.gap(X_WB, X_WA), atol=1e-12)


def test_a_gap_to_a_disc_is_the_distance_or_a_little_less(setup: CoordinationSetup) -> None:
    body, rng = setup.lanes.body, np.random.default_rng(4)
    outline = body.outline.astype(np.float32).reshape(-1, 1, 2)
    poses = rng.uniform([-0.5, -0.5, -math.pi], [0.5, 0.5, math.pi], (200, 3))
    gaps = body.gaps_to_disc(poses, 0.1, -0.2, 0.05)
    assert (gaps > 0.0).sum() > 100
    for pose, gap in zip(poses, gaps, strict=True):
        x, y = SE2(*pose).inverse().act([0.1, -0.2])
        distance = -cv2.pointPolygonTest(outline, (float(x), float(y)), True)
        if distance > 0.0:
            assert 0.92 * distance - 1e-6 <= gap + 0.05 <= distance + 1e-6


def test_bodies_in_each_other_have_a_negative_gap(setup: CoordinationSetup) -> None:
    body, rng = setup.lanes.body, np.random.default_rng(2)
    for _ in range(100):
        X_WA = SE2(*rng.uniform(-1.0, 1.0, 3))
        assert body.gap(X_WA, X_WA @ SE2(*rng.uniform([-0.13, -0.13, -3.0], [0.13, 0.13, 3.0]))) < 0.0


def test_near_asks_the_same_as_the_gap(setup: CoordinationSetup) -> None:
    """The circles by which most pairs are decided decide them as the bodies do."""
    body, rng = setup.lanes.body, np.random.default_rng(3)
    a = rng.uniform([-0.5, -0.5, -3.0], [0.5, 0.5, 3.0], (60, 3))
    b = rng.uniform([-0.5, -0.5, -3.0], [0.5, 0.5, 3.0], (50, 3))
    for wanted in (0.0, 0.02, 0.05):
        near = body.near(a[:, None], b[None], wanted)
        gaps = body.gaps(a[:, None], b[None])
        assert near.any()
        assert not near.all()
        # Where circles decide that bodies are near, the strip between them is no wider either.
        np.testing.assert_array_equal(near, gaps < wanted)


def test_the_measures_of_a_rectangle() -> None:
    """It is neither about its axle nor symmetric, and all its numbers are plain."""
    outline = np.array([[-0.1, -0.08], [0.2, -0.08], [0.2, 0.05], [-0.1, 0.05]])
    body = Body(outline, {}, 0.2)
    assert body.radius == pytest.approx(math.hypot(0.2, 0.08))
    assert body.half_width == pytest.approx(0.08)
    ahead, behind, left, right = (
        body.gap(SE2(), X) for X in (SE2(0.5, 0.1), SE2(-0.5, 0.1), SE2(0.1, 0.5), SE2(0.1, -0.5))
    )
    assert (ahead, behind) == pytest.approx((0.2, 0.2))
    assert (left, right) == pytest.approx((0.37, 0.37))
    assert body.gap(SE2(), SE2(0.0, 0.5, math.pi)) == pytest.approx(0.4)
    discs = body.gaps_to_disc(
        np.array([[0.0, 0.0, 0.5 * math.pi], [0.0, 0.0, -0.5 * math.pi]]), 0.5, 0.0, 0.1
    )
    assert discs == pytest.approx([0.5 - 0.1 - 0.08, 0.5 - 0.1 - 0.05])
    for gap in (0.199, 0.201):
        assert body.near(np.zeros(3), np.array([0.5, 0.1, 0.0]), gap) == (gap > 0.2)


@pytest.mark.parametrize("error", [0.0, 0.006, 0.011, 0.0112, 0.0204])
def test_bodies_stay_farther_apart_by_what_is_known_less_well_to_the_next_millimetre(error: float) -> None:
    body = Body.of(read_unit(find_urdf("unit.urdf")), error)
    assert max(error - 0.011, 0.0) - 1e-9 <= body.extra_gap < max(error - 0.010, 1e-9)
    corners = np.linalg.norm(body.outline - np.roll(body.outline, 1, axis=0), axis=1)
    assert corners.min() > 1e-3, "a corner is there twice"


def test_docked_neighbours_at_a_corner_are_28_mm_apart(setup: CoordinationSetup) -> None:
    body = setup.lanes.body
    gap = body.gap(body.docked(SE2(), "rear"), body.docked(SE2(), "left"))
    assert abs(gap - math.sqrt(2.0) * 0.02) < 1e-6
