"""TinyRenderer: exact geometry, windows that are crops, a floor, no memory of earlier calls."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pybullet
import pytest

from msrr_bullet.render import RenderContext, build_renderer
from msrr_bullet.render.tiny_renderer import TinyRenderer, rotated_grid
from msrr_bullet.simulation.tag_plates import plate_scale, write_plate
from msrr_bullet.simulation.tagged_bodies import TagVisuals
from msrr_scenes.geometry.pinhole import PinholeCamera, Window, optical_pose
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.unit_geometry import tag_corners
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.spec import Choice
from msrr_scenes.specs.tag_families import TAG36H11
from tests.bullet.render.conftest import centroid, plain_floor

CAMERA = PinholeCamera.from_hfov(640, 480, math.radians(75.0))
R_DOWN = np.diag([1.0, -1.0, -1.0])  # image right is world x, image down is world -y


@pytest.fixture
def unit(client: int, tmp_path: Path) -> Scene:
    """One unit with its axle in the origin, untextured."""
    scene = Scene.model_validate(
        {
            "name": "alone",
            "units": {"a": {"number": 1}, "b": {"number": 2}},
            "plan": [{"unit": "a", "to": "b.rear"}],
        }
    )
    urdf = TagVisuals(scene, tmp_path).unit_urdf("a")
    pybullet.loadURDF(str(urdf), useFixedBase=True, physicsClientId=client)
    return scene


@pytest.mark.parametrize(("samples", "mean_px", "rms_px"), [(1, 0.012, 0.05), (2, 0.004, 0.012)])
def test_pixels_lie_where_the_pinhole_model_says(
    client: int, tmp_path: Path, samples: int, mean_px: float, rms_px: float
) -> None:
    """The centroid of a bright plate against the exact one of its projection.

    A renderer that is off by half a sample, or that mistakes the principal point, shows up in the mean.
    Over 60 views the mean's standard error is about 0.0025 px (1 sample) and 0.0008 px (2 samples): 5
    sigma.
    """
    mesh, _ = write_plate(tmp_path, None)
    shape = pybullet.createVisualShape(
        pybullet.GEOM_MESH, fileName=str(mesh), meshScale=plate_scale(0.08), rgbaColor=[1, 1, 1, 1]
    )
    body = pybullet.createMultiBody(0.0, baseVisualShapeIndex=shape)
    renderer = TinyRenderer(RenderContext(client, samples, plain_floor(0.0)))
    rng = np.random.default_rng(1)
    errors = []
    for _ in range(60):
        X_CT = SE3.from_xyz_rpy(
            [*rng.uniform(-0.12, 0.12, 2), rng.uniform(0.2, 0.8)], rng.uniform(-0.4, 0.4, 3)
        )
        pybullet.resetBasePositionAndOrientation(body, X_CT.p.tolist(), X_CT.quaternion_xyzw().tolist())
        outline = CAMERA.project(X_CT.act(TAG36H11.plate_ratio * tag_corners(0.08)))
        window = Window.around(outline, 3)
        image = renderer.render(CAMERA, SE3(), window).astype(float)
        v, u = np.mgrid[window.y : window.y_end, window.x : window.x_end]
        seen = np.array([(image * u).sum(), (image * v).sum()]) / image.sum()
        errors.append(seen - centroid(outline))
    e = np.array(errors)
    assert np.abs(e.mean(axis=0)).max() < mean_px
    assert np.sqrt((e**2).mean(axis=0)).max() < rms_px


@pytest.mark.parametrize("samples", [1, 2, 3, 4])
def test_sub_pixel_positions_share_no_row_and_no_column(samples: int) -> None:
    positions = rotated_grid(samples)
    steps = (np.arange(samples**2) + 0.5) / samples**2 - 0.5
    for axis in range(2):
        np.testing.assert_allclose(np.sort(positions[:, axis]), steps, atol=1e-12)
    np.testing.assert_allclose(positions.mean(axis=0), 0.0, atol=1e-12)


def test_windows_also_outside_the_frame_are_crops_of_a_larger_one(client: int, unit: Scene) -> None:
    X_WC = optical_pose(SE3.from_xyz_rpy([-0.45, 0.05, 0.155], [0.01, 0.02, -0.1]))
    renderer = TinyRenderer(RenderContext(client, 2))
    whole = CAMERA.frame.padded(8)
    frame = renderer.render(CAMERA, X_WC, whole).astype(int)
    rng = np.random.default_rng(8)
    worst, unequal, total = 0, 0, 0
    for _ in range(60):
        w, h = (int(a) for a in rng.integers(4, 120, 2))
        x = int(rng.integers(whole.x, whole.x_end - w))
        y = int(rng.integers(whole.y, whole.y_end - h))
        part = renderer.render(CAMERA, X_WC, Window(x, y, w, h)).astype(int)
        difference = np.abs(part - frame[y + 8 : y + 8 + h, x + 8 : x + 8 + w])
        worst = max(worst, int(difference.max()))
        unequal += int((difference > 0).sum())
        total += difference.size
    assert unequal < 1e-3 * total, f"{unequal} of {total}, worst {worst}"


def test_the_light_of_an_earlier_picture_is_not_kept(client: int, unit: Scene) -> None:
    X_WC = SE3(R_DOWN, np.array([0.0, 0.0, 0.8]))
    renderer = TinyRenderer(RenderContext(client, 1))
    before = renderer.render(CAMERA, X_WC, CAMERA.frame)
    pybullet.getCameraImage(
        16,
        16,
        lightDirection=[0, -1, 0],
        lightColor=[1, 0, 0],
        lightAmbientCoeff=0.1,
        lightDiffuseCoeff=0.9,
        lightSpecularCoeff=0.9,
        shadow=1,
        renderer=pybullet.ER_TINY_RENDERER,
        physicsClientId=client,
    )
    np.testing.assert_array_equal(renderer.render(CAMERA, X_WC, CAMERA.frame), before)


def test_a_unit_sees_nothing_of_itself_but_its_own_front(client: int, unit: Scene) -> None:
    """The camera sits inside the mast's channel; only the front bar's upper edge reaches into its view."""
    camera = unit.cameras.onboard.pinhole
    X_UC = optical_pose(unit.geometry("a").frame("camera"))
    image = TinyRenderer(RenderContext(client, 1, plain_floor(255.0))).render(camera, X_UC, camera.frame)
    own = image != 255
    highest = min(float(camera.project(X_UC.inverse().act([0.1, y, 0.105]))[1]) for y in (-0.08, 0.0, 0.08))
    rows = np.flatnonzero(own.any(axis=1))
    assert rows[0] == pytest.approx(highest, abs=1.0)
    assert own[rows[-1]].mean() > 0.5


def test_composited_floor_is_the_floor_of_a_mesh(client: int) -> None:
    """The usual way, a textured mesh under the bodies, gives the same picture (up to its missing filter)."""
    X_WC = SE3(R_DOWN, np.array([0.2, 0.1, 1.0]))
    window = Window(200, 140, 240, 200)
    composited = TinyRenderer(RenderContext(client, 2)).render(CAMERA, X_WC, window).astype(float)
    mesh = TinyRenderer(RenderContext(client, 2), floor="mesh").render(CAMERA, X_WC, window).astype(float)
    assert np.corrcoef(composited.ravel(), mesh.ravel())[0, 1] > 0.95
    again = TinyRenderer(RenderContext(client, 2), floor="mesh")
    assert pybullet.getNumBodies(physicsClientId=client) == 1, "one mesh serves all cameras of a client"
    np.testing.assert_array_equal(again.render(CAMERA, X_WC, window), mesh)


@pytest.mark.parametrize("floor", ["composited", "mesh"])
def test_a_plane_for_contact_does_not_hide_the_floor(client: int, floor: str) -> None:
    """TinyRenderer would paint it as a chequerboard of white and blue."""
    X_WC = optical_pose(SE3.from_xyz_rpy([0.2, 0.1, 0.155], [0.0, 0.1, 0.2]))
    choice = Choice(name="tiny", params={"floor": floor})
    context = RenderContext(client, 1)
    before = build_renderer(choice, context).render(CAMERA, X_WC, CAMERA.frame)
    plane = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=client)
    pybullet.createMultiBody(0.0, plane, physicsClientId=client)
    after = build_renderer(choice, context).render(CAMERA, X_WC, CAMERA.frame)
    np.testing.assert_array_equal(after, before)
