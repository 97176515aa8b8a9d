"""Pictures through a lens that distorts: windows, an independent warp, and cv2.projectPoints."""

from __future__ import annotations

import math
from collections.abc import Iterator

import cv2
import numpy as np
import pybullet
import pytest
from numpy.typing import NDArray

from msrr_bullet.render import Instant, RenderContext
from msrr_bullet.render.raster.lens_map import LensMap
from msrr_bullet.render.raster_renderer import RasterRenderer
from msrr_bullet.simulation.tagged_bodies import TagVisuals
from msrr_bullet.simulation.world import BulletWorld
from msrr_scenes.errors import GeometryError
from msrr_scenes.geometry.distortion import Distortion
from msrr_scenes.geometry.pinhole import PinholeCamera, Window, optical_pose
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.loading.load import load_scene
from msrr_scenes.messages import Pixels
from msrr_scenes.placement.placement import draw_placement
from msrr_scenes.random_streams import stream
from tests.bullet.render.conftest import centroid, plain_floor

LENSES = (
    Distortion(k1=-0.1),
    Distortion(k1=0.25, p1=0.004, p2=-0.003),
    Distortion(k1=-0.25, k2=0.12, k3=-0.01, p1=-0.002),
)

#: Pixels that are not square, and an image that leans: rows bend to one side.
LEANING = Distortion(k1=-0.2, k2=0.04, p1=0.01, p2=-0.01, aspect=1.05)


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Iterator[BulletWorld]:
    """Scene ``two_units``."""
    scene = load_scene("two_units")
    placement = draw_placement(scene, lambda name: stream(0, name))
    tags = TagVisuals(scene, tmp_path_factory.mktemp("tags"))
    with BulletWorld(scene, placement, tags=tags) as world:
        yield world


@pytest.fixture(scope="module")
def units(world: BulletWorld) -> tuple[RasterRenderer, SE3]:
    """The scene on a floor without texture: its renderer, and the pose of unit b."""
    return RasterRenderer(RenderContext(world.client, floor=plain_floor(105.0))), world.pose3("b")


def views(X_WB: SE3, count: int, seed: int) -> Iterator[SE3]:
    """Yield poses of a camera about a unit, from near to a metre away, tilted in every direction."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        away, turn, z = rng.uniform(0.25, 1.0), rng.uniform(-math.pi, math.pi), rng.uniform(0.05, 0.5)
        aim = turn + math.pi + rng.uniform(-0.5, 0.5)
        pose = SE3.from_xyz_rpy(
            (away * math.cos(turn), away * math.sin(turn), z),
            (rng.uniform(-0.2, 0.2), rng.uniform(0.0, 0.5), aim),
        )
        yield X_WB @ optical_pose(pose)


def through(
    renderer: RasterRenderer, lens: Distortion, camera: PinholeCamera, X_WC: SE3, window: Window
) -> Pixels:
    return renderer.render_instants(camera, [(window, Instant(X_WC))], lens)[0]


@pytest.mark.parametrize("lens", [*LENSES, LEANING], ids=str)
@pytest.mark.parametrize("count", [40, pytest.param(500, marks=pytest.mark.nightly)])
def test_a_window_is_the_crop_of_the_frame(world: BulletWorld, lens: Distortion, count: int) -> None:
    renderer, X_WB = RasterRenderer(RenderContext(world.client)), world.pose3("b")
    camera = PinholeCamera.from_hfov(640, 480, math.radians(75.0))
    rng = np.random.default_rng(8)
    for X_WC in views(X_WB, count // 20, seed=4):
        whole = camera.frame.padded(5)  # blur reads beyond the frame
        frame = through(renderer, lens, camera, X_WC, whole)
        for _ in range(20):
            w, h = (int(a) for a in rng.integers(1, 150, 2))
            x, y = int(rng.integers(-5, 646 - w)), int(rng.integers(-5, 486 - h))
            part = through(renderer, lens, camera, X_WC, Window(x, y, w, h))
            np.testing.assert_array_equal(part, frame[y + 5 : y + 5 + h, x + 5 : x + 5 + w])


@pytest.mark.parametrize("lens", LENSES, ids=str)
def test_a_picture_is_the_warp_of_a_finer_one(units: tuple[RasterRenderer, SE3], lens: Distortion) -> None:
    """4 x 4 points of each pixel, undistorted, looked up in a plain picture of four times the size.

    Both sample: sixteen samples of an edge between black and white are off by a sixteenth of 255 or two.
    """
    renderer, X_WB = units
    camera = PinholeCamera.from_hfov(160, 120, math.radians(75.0))
    fine = PinholeCamera(160 * 4 + 600, 120 * 4 + 600, 4.0 * camera.focal)
    y, x = (np.mgrid[0:480, 0:640] + 0.5) / 4.0 - 0.5
    points = np.stack([x, y], axis=-1).reshape(-1, 2)
    places = fine.project(camera.rays(lens.ideal_pixels(camera, points))).astype(np.float32)
    for X_WC in views(X_WB, 4, seed=11):
        plain = renderer.render(fine, X_WC, fine.frame)
        warped = cv2.remap(
            plain, places[:, 0].reshape(480, 640), places[:, 1].reshape(480, 640), cv2.INTER_LINEAR
        )
        expected = warped.reshape(120, 4, 160, 4).mean(axis=(1, 3))
        error = np.abs(through(renderer, lens, camera, X_WC, camera.frame) - expected)
        assert error.mean() < 0.3
        assert np.quantile(error, 0.995) < 2.0 * 255.0 / 16.0


def test_a_lens_that_hardly_distorts_shows_what_an_ideal_one_shows(world: BulletWorld) -> None:
    """Corners that are looked up and corners that are counted: rounding may move an edge by 1e-9 pixels.

    A lens without coefficients is one of these.
    """
    renderer, X_WB = RasterRenderer(RenderContext(world.client)), world.pose3("b")
    camera = PinholeCamera.from_hfov(640, 480, math.radians(75.0))
    for k, X_WC in enumerate(views(X_WB, 10, seed=21)):
        lens = (Distortion(k1=1e-12), Distortion())[k % 2]
        ideal = renderer.render(camera, X_WC, camera.frame).astype(int)
        shown = through(renderer, lens, camera, X_WC, camera.frame).astype(int)
        assert np.abs(shown - ideal).max() <= 255 / 16 + 1  # a sample of sixteen
        assert np.count_nonzero(shown != ideal) <= 30  # of 307,200


def coefficients(lens: Distortion) -> NDArray[np.float64]:
    return np.array([lens.k1, lens.k2, lens.p1, lens.p2, lens.k3])


@pytest.mark.parametrize("lens", LENSES, ids=str)
@pytest.mark.parametrize("count", [20, pytest.param(200, marks=pytest.mark.nightly)])
def test_a_tile_is_where_opencv_projects_it(lens: Distortion, count: int) -> None:
    """The centroid of a white tile that faces the camera, against its outline by cv2.projectPoints."""
    client = pybullet.connect(pybullet.DIRECT)
    half = 0.012
    shape = pybullet.createVisualShape(
        pybullet.GEOM_BOX, halfExtents=[half, half, 1e-5], rgbaColor=[1, 1, 1, 1], physicsClientId=client
    )
    tile = pybullet.createMultiBody(0.0, baseVisualShapeIndex=shape, physicsClientId=client)
    renderer = RasterRenderer(RenderContext(client, floor=plain_floor(0.0)))
    camera = PinholeCamera.from_hfov(640, 480, math.radians(75.0))
    X_WC = SE3(np.eye(3), np.array([0.0, 0.0, -5.0]))  # below the floor, which is not seen from there
    side = np.linspace(-half, half, 41)[:-1]
    along, across = np.concatenate([side, 0 * side + half, -side, 0 * side - half]), np.zeros(160)
    outline = np.column_stack([along, np.roll(along, 40), across])
    rng = np.random.default_rng(6)
    errors = []
    for _ in range(count):
        pixel = rng.uniform((20.0, 20.0), (620.0, 460.0))
        p_C = rng.uniform(0.4, 0.8) * camera.rays(lens.ideal_pixels(camera, pixel[np.newaxis]))[0]
        place, turn = (X_WC.p + p_C).tolist(), [0.0, 0.0, 0.0, 1.0]
        pybullet.resetBasePositionAndOrientation(tile, place, turn, physicsClientId=client)
        exact = cv2.projectPoints(
            p_C + outline - [0.0, 0.0, 1e-5], np.zeros(3), np.zeros(3), camera.matrix(), coefficients(lens)
        )[0][:, 0]
        window = Window.around(exact, 3)
        light = through(renderer, lens, camera, X_WC, window).astype(float)
        rows, columns = np.mgrid[window.y : window.y_end, window.x : window.x_end]
        seen = np.array([(columns * light).sum(), (rows * light).sum()]) / light.sum()
        errors.append(seen - centroid(exact))
    pybullet.disconnect(client)
    worst = np.abs(errors).max()
    print(f"{count} tiles: worst {worst:.4f} px")
    assert worst < 0.05


def test_a_lens_that_folds_the_image_is_refused(units: tuple[RasterRenderer, SE3]) -> None:
    renderer, X_WB = units
    camera = PinholeCamera.from_hfov(640, 480, math.radians(75.0))
    with pytest.raises(GeometryError, match="two points of the scene appear at one pixel"):
        through(renderer, Distortion(k1=-0.2), camera, X_WB, Window(300, 200, 20, 20))


@pytest.mark.parametrize("lens", [*LENSES, LEANING], ids=str)
def test_the_map_of_a_lens_is_its_inverse_in_any_window(lens: Distortion) -> None:
    camera = PinholeCamera.from_hfov(640, 480, math.radians(75.0))
    rng = np.random.default_rng(3)
    lens_map = LensMap(camera, lens)
    for _ in range(20):
        w, h = (int(a) for a in rng.integers(1, 200, 2))
        x, y = int(rng.integers(-8, 648 - w)), int(rng.integers(-8, 488 - h))
        grid = lens_map.grid(Window(x, y, w, h))
        corners = np.stack(np.meshgrid(np.arange(x, x + w + 1), np.arange(y, y + h + 1)), axis=-1) - 0.5
        ideal = lens.ideal_pixels(camera, corners.reshape(-1, 2)).reshape(corners.shape) + 0.5
        np.testing.assert_allclose(np.stack([grid.u, grid.v], axis=-1), ideal, atol=1e-9)
        np.testing.assert_array_equal(grid.v_low, grid.v.min(axis=1))
        np.testing.assert_array_equal(grid.v_high, grid.v.max(axis=1))
        assert grid.pitch <= np.diff(grid.u, axis=1).min()
        assert grid.slant >= np.abs(np.diff(grid.v, axis=1)).max()
        assert grid.shift >= np.abs(np.diff(grid.u, axis=0)).max()


@pytest.mark.parametrize("lens", [*LENSES, LEANING], ids=str)
def test_a_window_as_wide_as_the_frame_shows_the_same_when_it_is_asked_for_again(lens: Distortion) -> None:
    """Its places are kept from the second time on only."""
    lens_map = LensMap(PinholeCamera.from_hfov(640, 480, math.radians(75.0)), lens)
    wide, narrow = Window(-4, 100, 648, 128), Window(300, 90, 60, 60)
    first, bounds = lens_map.grid(wide), lens_map.bounds(wide)
    lens_map.grid(narrow)
    again = lens_map.grid(wide)
    assert again is not first
    assert lens_map.bounds(wide) == bounds
    assert again.column == first.column
    for name in ("u", "v", "v_low", "v_high", "group_u", "group_v"):
        np.testing.assert_array_equal(getattr(again, name), getattr(first, name))
    assert first.pitch == np.diff(first.u, axis=1).min()
    assert first.slant == np.abs(np.diff(first.v, axis=1)).max()
    assert first.shift == np.abs(np.diff(first.u, axis=0)).max()
