"""The distance of two convex parts against an exact distance in the plane, and the lower bounds."""

from __future__ import annotations

import math

import numpy as np
import pytest

from msrr_bullet.collision.convex_distance import PartPair, PlacedPart
from msrr_bullet.collision.footprint import Part
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.random_streams import stream
from tests.bullet.collision.conftest import exact_distance, random_polygon, random_pose

#: FCL represents a point by a sphere of a nanometre; a few of those are rounding here [m].
NANO = 2e-8


def random_part(rng):
    """Draw a polygon or a disc."""
    if rng.random() < 0.3:
        return Part.disc(*rng.normal(size=2) * 0.1, rng.uniform(0.01, 0.3))
    return random_polygon(rng)


def move(placed: PlacedPart, X: SE2) -> None:
    placed.place(X, math.cos(X.yaw), math.sin(X.yaw))


def pair_of(a: Part, X_WA: SE2, b: Part, X_WB: SE2) -> PartPair:
    placed = PlacedPart(a), PlacedPart(b)
    for part, X in zip(placed, (X_WA, X_WB), strict=True):
        move(part, X)
    return PartPair(*placed)


def test_distance_and_points_are_exact() -> None:
    """1000 pairs, a quarter of which overlap: points on both parts that span the distance."""
    rng = stream(1, "test_convex_distance/exact")
    overlapping = 0
    for _ in range(1000):
        a, b, X_WA, X_WB = random_part(rng), random_part(rng), random_pose(rng, 0.3), random_pose(rng, 0.3)
        expected, _ = exact_distance(X_WA.act(a.core), X_WB.act(b.core), a.radius + b.radius)
        gap = pair_of(a, X_WA, b, X_WB).measure()
        assert gap.distance == pytest.approx(expected, abs=1e-6)
        p, q = np.array([gap.point_a]), np.array([gap.point_b])
        assert np.linalg.norm(p - q) == pytest.approx(abs(gap.distance), abs=NANO)
        assert a.gap(X_WA.inverse().act(p))[0] < 1e-6
        assert b.gap(X_WB.inverse().act(q))[0] < 1e-6
        overlapping += expected < 0.0
    assert 150 < overlapping < 850


def test_bounds_never_exceed_the_distance() -> None:
    """A walk of two parts, with bounds before and after the first measurement."""
    rng = stream(2, "test_convex_distance/bounds")
    excluded = 0
    for _ in range(60):
        a, b, X_WA, X_WB = random_part(rng), random_part(rng), random_pose(rng, 0.3), random_pose(rng, 0.5)
        placed = PlacedPart(a), PlacedPart(b)
        pair = PartPair(*placed)
        for step in range(20):
            X_WA, X_WB = X_WA @ SE2(*rng.normal(0.0, 0.02, 3)), X_WB @ SE2(*rng.normal(0.0, 0.02, 3))
            move(placed[0], X_WA)
            move(placed[1], X_WB)
            distance = pair_of(a, X_WA, b, X_WB).measure().distance
            assert pair.circle_distance() <= distance + 1e-12
            assert not pair.farther_than(distance)
            excluded += pair.farther_than(distance - 0.05)
            if step % 5 == 0:
                assert pair.measure().distance == pytest.approx(distance, abs=NANO)
    assert excluded > 600  # the bounds are of use


def test_shapes_that_nearly_touch_are_measured_exactly() -> None:
    """A disc straight in front of a face, micrometres away, where the search of FCL ends too early."""
    face = Part.polygon([[-0.1, -0.1], [0.1, -0.1], [0.1, 0.1], [-0.1, 0.1]])
    disc = Part.disc(0.0, 0.0, 0.05)
    for gap in (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 0.0, -1e-6):
        for y in (0.0, 0.03, -0.099):
            X_WB = SE2(0.15 + gap, y, 0.3)
            measured = pair_of(face, SE2(), disc, X_WB).measure()
            assert measured.distance == pytest.approx(gap, abs=NANO)


def test_coincident_discs_overlap_by_both_radii() -> None:
    disc = Part.disc(0.0, 0.0, 0.2)
    assert pair_of(disc, SE2(1, 1, 0), disc, SE2(1, 1, 2)).measure().distance == pytest.approx(-0.4)
