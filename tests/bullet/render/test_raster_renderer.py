"""The raster renderer: what TinyRenderer converges to, windows that are crops, the same bits everywhere."""

from __future__ import annotations

import hashlib
import json
import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pybullet
import pybullet_data
import pytest

from msrr_bullet.bench.renderer_measurements import compare_pixels, measure_corners
from msrr_bullet.bench.renderer_scenes import add_clutter, facing_units, random_view
from msrr_bullet.render import Instant, RenderContext, Renderer
from msrr_bullet.render.floor import concrete_floor
from msrr_bullet.render.raster.rasterizer import compile_kernels
from msrr_bullet.render.raster_renderer import RasterRenderer
from msrr_bullet.render.tiny_renderer import TinyRenderer
from msrr_bullet.simulation.tag_plates import load_tag_plate
from msrr_perception.detection.detector import PupilDetector
from msrr_scenes.geometry.distortion import Distortion
from msrr_scenes.geometry.pinhole import PinholeCamera, Window, optical_pose
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.messages import Pixels
from tests.bullet.render.conftest import add_box, place, plain_floor

CAMERA = PinholeCamera.from_hfov(640, 480, math.radians(75.0))
SMALL = PinholeCamera.from_hfov(320, 240, math.radians(75.0))
X_OVERHEAD = SE3(np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, 2.0]))


def against_tiny(client: int, camera: PinholeCamera, X_WC: SE3) -> tuple[Pixels, Pixels]:
    context = RenderContext(client, 4)
    raster = RasterRenderer(context).render(camera, X_WC, camera.frame)
    return raster, TinyRenderer(context).render(camera, X_WC, camera.frame)


def test_no_pixel_of_random_clutter_is_off() -> None:
    """Boxes that pierce each other, tags, near-plane crossings, any roll, against 8 x 8 samples per pixel."""
    row = compare_pixels(range(3))
    assert row.off == 0, row
    assert row.mean < 1.0, row  # TinyRenderer rounds every sample down: half a grey level


@pytest.mark.nightly
def test_no_pixel_of_forty_scenes_of_clutter_is_off() -> None:
    row = compare_pixels(range(40))
    assert row.off == 0, row


@pytest.mark.nightly
def test_corners_lie_where_the_pinhole_model_says() -> None:
    """Over 80 views with any roll: RMS 0.017 px, so the mean of 320 corners scatters by 0.001 px."""
    rows = {row.renderer: row for row in measure_corners(80, seed=3)}
    raster = rows["raster"]
    assert raster.found == 80
    assert max(abs(b) for b in raster.bias_px) < 0.02, raster
    assert raster.rms_px <= rows["tiny 4x"].rms_px, (raster, rows["tiny 4x"])


def test_the_same_tags_are_found_behind_a_passing_occluder(client: int, tmp_path: Path) -> None:
    load_tag_plate(client, tmp_path, 7, 0.06, SE3.from_xyz_rpy([-0.05, 0.0, 1.5], [math.pi, 0.0, 0.0]))
    load_tag_plate(client, tmp_path, 8, 0.06, SE3.from_xyz_rpy([0.05, 0.02, 1.5], [math.pi, 0.0, 0.3]))
    bar = add_box([0.012, 0.2, 0.01], SE3(), 0.5)
    detector, window = PupilDetector(), Window(220, 170, 200, 140)
    context = RenderContext(client, 2)
    renderers: tuple[Renderer, ...] = (RasterRenderer(context), TinyRenderer(context))
    seen: list[list[tuple[int, ...]]] = [[], []]
    for x in np.linspace(-0.12, 0.12, 29):
        place(bar, SE3(p=np.array([x, 0.0, 1.6])))
        for ids, renderer in zip(seen, renderers, strict=True):
            tags = detector.detect(renderer.render(CAMERA, X_OVERHEAD, window), window)
            ids.append(tuple(t.tag_id for t in tags))
    assert seen[0] == seen[1]
    assert {(7, 8), (7,), (8,)} <= set(seen[0])


@pytest.mark.parametrize("width_px", [0.1, 0.45, 0.9])
def test_a_wire_thinner_than_a_pixel_is_as_bright_as_it_is_thick(client: int, width_px: float) -> None:
    """Whatever its direction: what falls between the corners of pixels is not lost."""
    distance, length = 0.5, 0.2
    thickness = width_px * distance / CAMERA.focal
    wire = add_box([length, thickness, 1e-5], SE3(), grey=1.0)
    renderer = RasterRenderer(RenderContext(client, floor=plain_floor(0.0)))
    area = length * thickness * (CAMERA.focal / distance) ** 2
    shares = []
    for angle in np.linspace(0.0, math.pi, 25):
        place(wire, SE3.from_xyz_rpy([0.003, 0.002, 1.5], [0.0, 0.0, angle]))
        image = renderer.render(CAMERA, X_OVERHEAD, CAMERA.frame).astype(float)
        shares.append(image.sum() / (area * image_grey_of_a_level_face()))
    assert np.mean(shares) == pytest.approx(1.0, abs=0.03)
    if width_px > 0.4:  # a thinner one falls between samples where it runs along a row or a column
        assert np.abs(np.array(shares) - 1.0).max() < 0.2, shares


@pytest.mark.parametrize("lens", [None, Distortion(k1=-0.1)], ids=str)
def test_a_wire_is_seen_in_the_last_column_of_a_window(client: int, lens: Distortion | None) -> None:
    """A wire that runs down the right half of a column of pixels and reaches no corner of them."""
    metre = 0.5 / CAMERA.focal  # per pixel, at the distance of the wire
    wire = np.array([(350.3 - CAMERA.cx) * metre, 0.0, 1.5])
    add_box([0.2 * metre, 0.2, 1e-5], SE3(p=wire), grey=1.0)
    renderer = RasterRenderer(RenderContext(client, floor=plain_floor(0.0)))
    views = [(window, Instant(X_OVERHEAD)) for window in (Window(340, 230, 11, 20), CAMERA.frame)]
    part, frame = renderer.render_instants(CAMERA, views, lens)
    assert part[:, -1].min() > 20
    np.testing.assert_array_equal(part, frame[230:250, 340:351])


def image_grey_of_a_level_face() -> float:
    """A white face that looks up: ambient 0.6, diffuse 0.4 times the cosine to the light."""
    return 255.0 * (0.6 + 0.4 * 0.86 / float(np.linalg.norm([-0.45, 0.25, 0.86])))


def test_specks_smaller_than_a_pixel_are_not_lost(client: int) -> None:
    """A plate of 0.4 px, anywhere within a pixel, on a wall that fills the view.

    300 places; one picture scatters by about 40 %, the mean by 2.5 %: odds of a false alarm below 1e-4.
    """
    add_box([2.0, 2.0, 0.01], SE3(p=np.array([0.0, 0.0, 1.4])), grey=0.2)
    edge = 0.4 * 0.5 / CAMERA.focal
    speck = add_box([edge, edge, 1e-5], SE3(), grey=1.0)
    renderer, window = RasterRenderer(RenderContext(client)), Window(310, 230, 20, 20)
    pybullet.resetBasePositionAndOrientation(speck, [0.0, 0.0, -1.0], [0.0, 0.0, 0.0, 1.0])
    without = renderer.render(CAMERA, X_OVERHEAD, window).astype(float)
    rng = np.random.default_rng(4)
    gains = []
    for _ in range(300):
        offset = rng.uniform(-2.0, 2.0, 2) * 0.5 / CAMERA.focal
        place(speck, SE3.from_xyz_rpy([*offset, 1.5], [0.0, 0.0, rng.uniform(0.0, math.pi)]))
        gains.append((renderer.render(CAMERA, X_OVERHEAD, window) - without).sum())
    contrast = 0.8 * image_grey_of_a_level_face()
    assert np.mean(gains) == pytest.approx(0.16 * contrast, rel=0.1)


def test_a_camera_inside_the_scene_sees_what_crosses_its_near_plane(client: int) -> None:
    """A tunnel through which the camera looks: all four walls pass the image plane and go on behind it."""
    for side in range(4):
        wall = SE3.from_xyz_rpy([0.0, 0.0, 1.0], [side * math.pi / 2.0, 0.0, 0.0])
        add_box([2.0, 0.2, 0.02], wall @ SE3(p=np.array([0.0, 0.0, 0.1])), grey=0.3 + 0.2 * side)
    X_WC = optical_pose(SE3.from_xyz_rpy([0.0, 0.02, 1.0], [0.2, 0.1, 0.15]))
    raster, tiny = against_tiny(client, SMALL, X_WC)
    assert np.abs(raster.astype(int) - tiny).max() < 40


def test_a_sphere_is_round_and_shaded_from_the_light(client: int) -> None:
    shape = pybullet.createVisualShape(pybullet.GEOM_SPHERE, radius=0.1, rgbaColor=[1, 1, 1, 1])
    pybullet.createMultiBody(0.0, baseVisualShapeIndex=shape, basePosition=[0.1, -0.05, 1.2])
    renderer = RasterRenderer(RenderContext(client, floor=plain_floor(0.0)))
    image = renderer.render(CAMERA, X_OVERHEAD, CAMERA.frame).astype(float)
    # Outline: the cone of rays that touch the sphere, cut by the image plane.
    u, v = np.meshgrid(np.arange(640), np.arange(480))
    rays = CAMERA.rays(np.stack([u, v], axis=-1))
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    centre = X_OVERHEAD.inverse().act([0.1, -0.05, 1.2])
    along = rays @ centre
    depth2 = 0.1**2 - (centre @ centre - along**2)
    inside = depth2 > 0.0
    assert abs(int((image > 0).sum()) - inside.sum()) < 0.02 * inside.sum()
    hit = rays * (along - np.sqrt(np.maximum(depth2, 0.0)))[..., None]
    normals = ((hit - centre) / 0.1) @ X_OVERHEAD.R.T
    light = np.array([-0.45, 0.25, 0.86]) / np.linalg.norm([-0.45, 0.25, 0.86])
    expected = 255.0 * (0.6 + 0.4 * np.maximum(normals @ light, 0.0))
    well_inside = depth2 > 0.1 * 0.1**2
    assert np.abs(image - expected)[well_inside].max() < 3.0


@pytest.mark.parametrize(
    ("xyz", "rpy"),
    [
        ([0.3, -0.2, 0.155], [0.0, 0.0, 0.4]),
        ([0.0, 0.1, 0.4], [0.3, 0.4, -1.0]),
        ([0.0, 0.0, 3.0], [0.0, 1.57, 0.7]),
    ],
)
def test_the_floor_is_the_one_that_tiny_composites(client: int, xyz: list[float], rpy: list[float]) -> None:
    X_WC = optical_pose(SE3.from_xyz_rpy(xyz, rpy))
    own = RasterRenderer(RenderContext(client)).render(CAMERA, X_WC, CAMERA.frame)
    difference = np.abs(own - concrete_floor().image(CAMERA, X_WC, CAMERA.frame))
    # The horizon is sampled here and a ramp there; elsewhere the filter is half a step off at most.
    assert np.mean(difference > 4.0) < 0.005
    assert difference.mean() < 0.6


def test_the_floor_hides_what_lies_below_it(client: int) -> None:
    add_box([0.4, 0.4, 0.1], SE3(p=np.array([0.0, 0.0, -0.1])))
    renderer = RasterRenderer(RenderContext(client))
    with_box = renderer.render(SMALL, X_OVERHEAD, SMALL.frame)
    pybullet.resetSimulation(physicsClientId=client)
    np.testing.assert_array_equal(with_box, renderer.render(SMALL, X_OVERHEAD, SMALL.frame))


def test_five_hundred_windows_are_crops_of_the_frame_bit_for_bit() -> None:
    rng = np.random.default_rng(8)
    with facing_units(SE2(-0.35, 0.01, 0.05)) as (scene, world):
        camera = scene.cameras.onboard.pinhole
        X_WC = optical_pose(world.link_pose("a", "camera")) @ SE3.from_xyz_rpy([0, 0, 0], [0.02, 0.0, 0.1])
        renderer = RasterRenderer(RenderContext(world.client))
        whole = camera.frame.padded(16)
        frame = renderer.render(camera, X_WC, whole)
        for _ in range(500):
            w, h = (int(a) for a in rng.integers(1, 160, 2))
            x, y = int(rng.integers(-16, 657 - w)), int(rng.integers(-16, 497 - h))
            part = renderer.render(camera, X_WC, Window(x, y, w, h))
            np.testing.assert_array_equal(part, frame[y + 16 : y + 16 + h, x + 16 : x + 16 + w])


_PICTURE = f"""
import sys
sys.path.insert(0, {str(Path(__file__).parent)!r})
import test_raster_renderer
test_raster_renderer.print_hash()
"""


def print_hash() -> None:
    """Print the hash of the pictures, and what is said of compilation before they are drawn."""
    messages: list[str] = []
    compile_kernels(messages.append, [False, True])
    print(json.dumps([picture_hash(), messages]))


def picture_hash() -> str:
    """Return the hash of pictures with everything in them: clutter, textured meshes, round bodies, floor."""
    client = pybullet.connect(pybullet.DIRECT)
    try:
        pybullet.setAdditionalSearchPath(pybullet_data.getDataPath(), physicsClientId=client)
        rng = np.random.default_rng(5)
        with tempfile.TemporaryDirectory() as folder:
            add_clutter(client, rng, Path(folder))
            pybullet.loadURDF("duck_vhacd.urdf", [0.0, 0.0, 0.5], globalScaling=2.0, physicsClientId=client)
            pybullet.loadURDF("sphere_small.urdf", [0.2, 0.0, 0.7], globalScaling=2.0, physicsClientId=client)
            renderer = RasterRenderer(RenderContext(client))
            digest = hashlib.sha256()
            for lens in (None, Distortion(k1=-0.1)):
                for _ in range(4):
                    instants = [(SMALL.frame, Instant(random_view(rng)))]
                    digest.update(renderer.render_instants(SMALL, instants, lens)[0].tobytes())
        return digest.hexdigest()
    finally:
        pybullet.disconnect(client)


def pictures_elsewhere(environment: Mapping[str, str]) -> tuple[str, list[str]]:
    """Return the hash of the same pictures in another process, and what it said of compilation."""
    done = subprocess.run(
        [sys.executable, "-c", _PICTURE], env=environment, capture_output=True, text=True, check=True
    )
    found, messages = json.loads(done.stdout.splitlines()[-1])
    return found, messages


@pytest.mark.nightly
def test_another_process_loads_the_kernels_and_computes_equal_pictures() -> None:
    here = picture_hash()
    assert pictures_elsewhere(os.environ) == (here, [])


@pytest.mark.nightly
def test_equal_hashes_cold_cached_and_in_other_processes(tmp_path: Path) -> None:
    """Compiled by one process, loaded by the next, and here; only the one that compiles says so.

    The home folder does not exist and the package may not be written to: the cache goes where it may.
    """
    environment = {**os.environ, "HOME": str(tmp_path / "none"), "TMPDIR": str(tmp_path)}
    environment["XDG_CACHE_HOME"] = str(Path(__file__))  # a file: nothing can be put below it
    environment.pop("NUMBA_CACHE_DIR", None)
    cold, messages = pictures_elsewhere(environment)
    assert len(messages) == 2  # each kind of lens has machine code of its own
    assert all("ompiling" in message for message in messages)
    assert pictures_elsewhere(environment) == (cold, [])
    assert cold == picture_hash()
