"""Textures: tags are kept as cells, photographs as pyramids."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from msrr_bullet.render.raster.assembly import VisualShape
from msrr_bullet.render.raster.floor_texture import pack_floor
from msrr_bullet.render.raster.mesh import Mesh
from msrr_bullet.render.raster.rasterizer import Rasterizer
from msrr_bullet.render.raster.texture import rectangles, texture_of
from msrr_bullet.tag_print import plate_texture
from msrr_perception.detection.native_apriltag import tag_bitmap
from msrr_scenes.geometry.pinhole import PinholeCamera, optical_pose
from msrr_scenes.geometry.se3 import SE3


@given(st.integers(0, 586))
@settings(max_examples=20, deadline=None)
def test_a_tag_is_kept_as_its_modules(tag: int) -> None:
    texture = texture_of(plate_texture(tag)[..., 0])
    assert texture.regions is not None
    np.testing.assert_array_equal(texture.levels[0] > 0.5, tag_bitmap("tag36h11", tag))
    np.testing.assert_array_equal(texture.region_grey[texture.regions], texture.levels[0])


@given(st.integers(1, 12), st.integers(1, 12), st.integers(0, 2**32 - 1))
@settings(max_examples=60, deadline=None)
def test_regions_are_rectangles_of_one_grey(rows: int, columns: int, seed: int) -> None:
    cells = np.random.default_rng(seed).integers(0, 3, (rows, columns)).astype(np.uint8)
    regions = rectangles(cells)
    for region in range(regions.max() + 1):
        y, x = np.nonzero(regions == region)
        assert len(y) == (np.ptp(y) + 1) * (np.ptp(x) + 1)
        assert len(np.unique(cells[y, x])) == 1


def test_a_blank_plate_is_one_cell_and_a_photograph_a_pyramid() -> None:
    assert texture_of(plate_texture(None)[..., 0]).levels[0].shape == (1, 1)
    photo = np.random.default_rng(0).integers(0, 256, (50, 70)).astype(np.uint8)
    texture = texture_of(photo)
    assert texture.regions is None
    assert [level.shape for level in texture.levels][:2] == [(64, 128), (32, 64)]
    assert texture.levels[-1].shape == (1, 1)
    assert float(texture.levels[-1][0, 0]) == pytest.approx(photo.mean() / 255.0, abs=0.01)


def test_an_image_has_a_grey_level_at_the_horizon_of_its_plane() -> None:
    """A level camera 10 mm above a plane of 200 m: the middles of one row of pixels lie on its horizon."""
    corners = 100.0 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    triangles = np.array([[0, 1, 2], [0, 2, 3]])
    plane = Mesh(np.column_stack([corners, np.zeros(4)]), triangles, uv=corners[triangles])
    noise = texture_of(np.random.default_rng(0).integers(100, 156, (64, 64)).astype(np.uint8))
    rasterizer = Rasterizer([VisualShape(0, SE3(), plane, 1.0, noise)], frame_count=1)
    floor = pack_floor([np.zeros((1, 1), dtype=np.float32)], period=1.0, wall=255.0)
    camera, X_WC = PinholeCamera(65, 49, 500.0), optical_pose(SE3(p=np.array([0.0, 0.0, 0.06])))
    at = np.array([[0.0, 0.0, 0.05, 0.0, 0.0, 0.0, 1.0]])
    assert rasterizer.draw(camera, X_WC, camera.frame, at, floor)[24].min() > 100
