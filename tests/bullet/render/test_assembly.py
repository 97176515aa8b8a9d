"""Shapes on moving frames as flat arrays."""

from __future__ import annotations

import math

import numpy as np
import pytest

from msrr_bullet.render.raster.assembly import VisualShape, assemble
from msrr_bullet.render.raster.mesh import box
from msrr_bullet.render.raster.texture import texture_of
from msrr_bullet.tag_print import plate_texture
from msrr_scenes.geometry.se3 import SE3


def test_assembly_puts_shapes_into_their_moving_frames() -> None:
    X_MG = SE3.from_xyz_rpy([0.1, -0.2, 0.3], [0.3, -0.4, 1.2])
    mesh = box(np.array([0.3, 0.2, 0.1]))
    geometry, _ = assemble([VisualShape(0, SE3(), mesh, 1.0), VisualShape(1, X_MG, mesh, 0.5)])
    start, end = geometry.shape_face[1], geometry.shape_face[2]
    for face in range(start, end):
        corners = geometry.corners[geometry.corner_start[face] : geometry.corner_start[face + 1]]
        n, d = geometry.planes[face, :3], geometry.planes[face, 3]
        np.testing.assert_allclose(geometry.vertices[corners] @ n, d, atol=1e-12)
    np.testing.assert_allclose(geometry.shape_ball[1, :3], X_MG.p, atol=1e-12)
    assert geometry.shape_ball[1, 3] == pytest.approx(0.5 * math.sqrt(0.14))
    assert set(geometry.grey[start:end]) == {127.5}
    nothing, _ = assemble([])
    assert len(nothing.planes) == 0


def test_shapes_share_the_textures_that_they_have_in_common() -> None:
    mesh = box(np.ones(3))
    one, two = (texture_of(plate_texture(tag)[..., 0]) for tag in (3, 4))
    shapes = [VisualShape(0, SE3(), mesh, 1.0, texture) for texture in (one, None, two, one)]
    geometry, textures = assemble(shapes)
    numbers = [int(geometry.texture[first]) for first in geometry.shape_face[:-1]]
    assert numbers == [0, -1, 1, 0]
    assert textures.level_start.tolist() == [0, 1, 2]
    assert textures.levels.tolist() == [[0, 10, 10], [100, 10, 10]]
    regions = textures.region_grey[geometry.cells[geometry.shape_face[2], 3] + textures.regions[100:]]
    np.testing.assert_array_equal(regions, two.levels[0].ravel())
