"""Faces behind others: they are left out where nothing of them shows, and only there."""

from __future__ import annotations

import numpy as np
import pybullet
import pytest

from msrr_bullet.render import Instant, RenderContext
from msrr_bullet.render.floor import Floor
from msrr_bullet.render.raster.assembly import VisualShape
from msrr_bullet.render.raster.floor_texture import pack_floor
from msrr_bullet.render.raster.lens_map import LensMap
from msrr_bullet.render.raster.mesh import box
from msrr_bullet.render.raster.rasterizer import Rasterizer
from msrr_bullet.render.raster_renderer import RasterRenderer
from msrr_scenes.geometry.distortion import Distortion
from msrr_scenes.geometry.pinhole import PinholeCamera, optical_pose
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.messages import Pixels

CAMERA = PinholeCamera(80, 60, 80.0)
LENSES = (None, Distortion(k1=-0.15, p1=0.003))

#: Size of a pixel at the wall, 1 m away [m].
PIXEL_M = 1.0 / 80.0


def picture(lens: Distortion | None, slit_m: float, behind: bool) -> Pixels:
    """Return the picture of a grey wall with an upright slit, with or without white boxes behind."""
    client = pybullet.connect(pybullet.DIRECT)

    def add(half: list[float], place: list[float], grey: float) -> None:
        shape = pybullet.createVisualShape(
            pybullet.GEOM_BOX, halfExtents=half, rgbaColor=[grey, grey, grey, 1.0], physicsClientId=client
        )
        pybullet.createMultiBody(0.0, baseVisualShapeIndex=shape, basePosition=place, physicsClientId=client)

    for side in (-1.0, 1.0):
        add([0.01, 0.5, 0.6], [1.01, side * (0.5 + 0.5 * slit_m) + 0.003, 0.0], 0.4)
    if behind:
        for k in range(5):
            add([0.05, 1.0, 1.0], [2.0 + 0.3 * k, 0.1 * k, 0.0], 1.0)
    black = Floor(lambda: np.zeros((1, 1), dtype=np.float32), 1.0, 0.0)
    renderer = RasterRenderer(RenderContext(client, floor=black))
    views = [(CAMERA.frame, Instant(optical_pose(SE3())))]
    (pixels,) = renderer.render_instants(CAMERA, views, lens)
    pybullet.disconnect(client)
    return pixels


@pytest.mark.parametrize("lens", LENSES, ids=str)
def test_what_a_wall_hides_changes_no_pixel(lens: Distortion | None) -> None:
    np.testing.assert_array_equal(picture(lens, 0.0, behind=True), picture(lens, 0.0, behind=False))


@pytest.mark.parametrize("lens", LENSES, ids=str)
@pytest.mark.parametrize("width_px", [0.25, 0.5])
def test_what_is_behind_shows_through_a_slit_narrower_than_a_pixel(
    lens: Distortion | None, width_px: float
) -> None:
    """Where all corners of a pixel show the wall, too: the light is that of the area, by 16 samples."""
    dark, light = (picture(lens, 10.0 * PIXEL_M, behind).astype(float) for behind in (False, True))
    white = (light - dark).max()
    more = picture(lens, width_px * PIXEL_M, behind=True).astype(float)
    more -= picture(lens, width_px * PIXEL_M, behind=False)
    share = more[10:50].sum(axis=1) / white
    assert white > 50.0
    assert share.mean() == pytest.approx(width_px, abs=1.0 / 16.0)
    assert share.min() > 0.0


@pytest.mark.parametrize("lens", LENSES, ids=str)
def test_what_a_solid_encloses_changes_no_pixel(lens: Distortion | None) -> None:
    """Boxes that touch, overlap and lie flush: on one frame, and each on a frame of its own in its place."""
    rng = np.random.default_rng(7)
    floor = pack_floor([np.zeros((1, 1), dtype=np.float32)], period=1.0, wall=0.0)
    turned = 0
    for _ in range(10):
        size, place = rng.integers(1, 4, (12, 3)), rng.integers(0, 4, (12, 3))
        grid = [
            (box(0.05 * s), SE3(np.eye(3), 0.05 * (p + 0.5 * s))) for s, p in zip(size, place, strict=True)
        ]
        greys = rng.uniform(0.3, 1.0, 12)
        X_WM = SE3.from_xyz_rpy(rng.uniform(-0.1, 0.1, 3), rng.uniform(-3.0, 3.0, 3))
        pose = np.concatenate([X_WM.p, X_WM.quaternion_xyzw()])
        X_WC = optical_pose(SE3.from_xyz_rpy([-0.5, 0.0, 0.0], [0.0, 0.0, 0.0]))
        pictures = []
        for apart in (False, True):
            shapes = [
                VisualShape(k if apart else 0, X_MG, mesh, greys[k]) for k, (mesh, X_MG) in enumerate(grid)
            ]
            frames = len(shapes) if apart else 1
            rasterizer = Rasterizer(shapes, frames)
            lens_map = None if lens is None else LensMap(CAMERA, lens)
            poses = np.tile(pose, (frames, 1))
            pictures.append(rasterizer.draw(CAMERA, X_WC, CAMERA.frame, poses, floor, lens_map))
            turned += 0 if apart else int(np.isinf(rasterizer.geometry.planes[:, 3]).sum())
        np.testing.assert_array_equal(*pictures)
    assert turned > 50
