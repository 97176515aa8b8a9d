"""Footprints: parts of units and obstacles, and the simplification that keeps the union of parts."""

from __future__ import annotations

import math

import numpy as np
import pytest

from msrr_bullet.collision.footprint import (
    Part,
    _in_box,
    _without_covered,
    obstacle_parts,
    simplify,
    unit_parts,
)
from msrr_scenes.geometry.unit_geometry import find_urdf, read_unit
from msrr_scenes.random_streams import stream
from msrr_scenes.specs.bodies import BoxSpec, CylinderSpec
from tests.bullet.collision.conftest import random_polygon

UNIT = read_unit(find_urdf("unit.urdf"))


@pytest.mark.parametrize(
    "part", [Part.disc(0.1, -0.2, 0.3), Part.polygon([[0, 0], [1, 0], [1, 1], [0.2, 0.1]])]
)
def test_border_points_are_dense_and_on_the_border(part):
    border = part.border()
    assert part.gap(border).max() < 1e-9
    closed = np.concatenate([border, border[:1]])
    assert np.linalg.norm(np.diff(closed, axis=0), axis=1).max() < 5.1e-4
    middle = part.core.mean(axis=0)
    assert part.gap(middle + 1.001 * (border - middle)).min() > 0.0
    assert np.linalg.norm(border - part.centre, axis=1).max() <= part.circumradius + 1e-9


def test_obstacles_have_the_extent_of_the_specification():
    (disc,) = obstacle_parts(CylinderSpec(shape="cylinder", radius_m=0.07, height_m=0.5))
    assert (disc.radius, disc.core.tolist()) == (0.07, [[0.0, 0.0]])
    (box,) = obstacle_parts(BoxSpec(shape="box", length_m=0.4, width_m=0.2, height_m=0.5))
    assert box.core.max(axis=0).tolist() == [0.2, 0.1]
    assert box.circumradius == pytest.approx(math.hypot(0.2, 0.1))


def test_the_footprint_of_the_unit_is_the_projection_of_all_solids():
    parts = unit_parts(UNIT)
    assert len(parts) <= 4, "a unit should be a few prisms"
    projections = [Part.polygon(solid.outline()) for solid in UNIT.solids]
    rng = stream(3, "test_clearance/footprint")
    points = rng.uniform(-0.15, 0.15, size=(20_000, 2))
    by_parts = np.min([part.gap(points) for part in parts], axis=0)
    by_solids = np.min([projection.gap(points) for projection in projections], axis=0)
    np.testing.assert_allclose(by_parts, by_solids, atol=3e-4)


def test_simplify_keeps_the_union():
    rng = stream(4, "test_clearance/simplify")
    for _ in range(20):
        parts = [random_polygon(rng) for _ in range(6)]
        fewer = simplify(parts)
        points = rng.uniform(-0.6, 0.6, size=(3_000, 2))
        before = np.min([p.gap(points) for p in parts], axis=0)
        after = np.min([p.gap(points) for p in fewer], axis=0)
        assert (after <= before + 1e-6).all()
        # A hole may be filled, so only points outside the common hull are compared.
        outside = Part.polygon(np.concatenate([p.core for p in parts])).gap(points) > 0.0
        np.testing.assert_allclose(after[outside], before[outside], atol=3e-4)
        assert len(fewer) <= len(parts)


def test_the_circumradius_is_reached_by_the_farthest_point_of_the_border():
    """A bound that is too large is safe, but it makes every distance be measured that it should rule out."""
    for part, expected in (
        (Part.disc(0.1, -0.2, 0.3), 0.3),
        (Part.polygon([[0, 0], [0.6, 0], [0.6, 0.2], [0, 0.2]]), math.hypot(0.3, 0.1)),
    ):
        assert part.circumradius == pytest.approx(expected, abs=1e-9)
        assert np.linalg.norm(part.border() - part.centre, axis=1).max() == pytest.approx(expected, abs=1e-5)


@pytest.mark.parametrize(("x", "y"), [(1, 0), (-1, 0), (0, 1), (0, -1)])
@pytest.mark.parametrize(("beyond_m", "covered"), [(0.0, True), (5e-7, True), (5e-6, False), (0.01, False)])
def test_a_part_is_covered_unless_it_stands_out_on_some_side(x, y, beyond_m, covered):
    """A square inside a large one is moved to the edge, up to it or beyond it by some micrometres."""
    square, off = np.array([[-0.1, -0.1], [0.1, -0.1], [0.1, 0.1], [-0.1, 0.1]]), 0.4 + beyond_m
    large, small = Part(5.0 * square), Part(square + off * np.array([x, y]))
    assert _in_box(small, large) is covered
    assert len(_without_covered([small, large], by_one_part=True)) == (1 if covered else 2)
