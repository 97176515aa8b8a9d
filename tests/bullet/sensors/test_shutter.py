"""The shutter: windows against the frame, closed forms of blur and skew, and the motion that is assumed."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np
import pybullet
import pytest
from scipy.ndimage import gaussian_filter1d

from msrr_bullet.profiler import NullProfiler
from msrr_bullet.render import Instant, RenderContext
from msrr_bullet.render.floor import Floor
from msrr_bullet.render.raster_renderer import RasterRenderer
from msrr_bullet.sensors.camera import Camera
from msrr_bullet.sensors.camera_motion import BodyMotion, CameraMotion
from msrr_bullet.sensors.shutter import Shutter, cells_of_smear, instant_after
from msrr_bullet.trial.environment import Environment, open_environment
from msrr_scenes.geometry.pinhole import PinholeCamera, Window, optical_pose
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.messages import Pixels, Twist
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.sensors import CameraSpec

Load = Callable[..., Scene]
CLEAN = {"noise_grey": 0.0, "blur_px": 0.0, "width_px": 160, "height_px": 120, "hfov_deg": 60.0}

#: Tags of the bodies, and their owners.
NO_TAGS = np.empty((0, 4, 3)), np.empty(0, dtype=np.int64)

#: Grey level of the plate's side that the camera faces, and of what is behind it.
BEHIND = 30.0


@pytest.fixture
def plate() -> Iterator[tuple[int, int]]:
    """A client with a plate of 1 x 1 m, 1 m in front of the origin, left of y = 0; the ids of both."""
    client = pybullet.connect(pybullet.DIRECT)
    shape = pybullet.createVisualShape(
        pybullet.GEOM_BOX, halfExtents=[0.01, 0.5, 0.5], rgbaColor=[1, 1, 1, 1], physicsClientId=client
    )
    body = pybullet.createMultiBody(
        0.0, baseVisualShapeIndex=shape, basePosition=[1.01, 0.5, 0.0], physicsClientId=client
    )
    yield client, body
    pybullet.disconnect(client)


def renderer_of(client: int) -> RasterRenderer:
    floor = Floor(lambda: np.full((1, 1), BEHIND, dtype=np.float32), 1.0, BEHIND)
    return RasterRenderer(RenderContext(client, floor=floor))


def seen(
    client: int, motion: CameraMotion, X_WC: SE3, window: Window | None = None, **spec: object
) -> Pixels:
    settings = CameraSpec.model_validate(CLEAN | spec)
    camera = Camera("c", settings, renderer_of(client), lambda: X_WC, 3, motion=lambda: motion)
    camera.expose(0)
    return camera.fetch(window or camera.pinhole.frame)


def edge_columns(pixels: Pixels, inside: float) -> np.ndarray:
    """Return, for each row, the column of the plate's right edge, counted from the frame's left edge."""
    return (pixels.astype(float) - BEHIND).sum(axis=1) / (inside - BEHIND)


def turning(rate: float, carrier: int = -7) -> CameraMotion:
    """A camera in the origin that turns about the vertical [rad/s]; nothing else moves."""
    motion = BodyMotion(np.zeros(3), np.zeros(3), np.array([0.0, 0.0, rate]))
    return CameraMotion({carrier: motion}, carrier, *NO_TAGS)


X_ORIGIN = optical_pose(SE3())


def test_what_stands_is_seen_as_at_one_instant(plate: tuple[int, int]) -> None:
    still = CameraMotion({}, None, *NO_TAGS)
    slow = {"exposure_ms": 20.0, "rolling_shutter_ms": 30.0}
    np.testing.assert_array_equal(seen(plate[0], still, X_ORIGIN, **slow), seen(plate[0], still, X_ORIGIN))


def test_an_exposure_blurs_an_edge_to_a_ramp_of_its_smear(plate: tuple[int, int]) -> None:
    """A box filter as wide as the smear, from a few instants: a grey level is off by a sixteenth at most."""
    rate, exposure_s = 1.2, 0.04
    still = seen(plate[0], CameraMotion({}, None, *NO_TAGS), X_ORIGIN)
    pixels = seen(plate[0], turning(rate), X_ORIGIN, exposure_ms=1e3 * exposure_s).astype(float)
    inside = float(still[60, 10])
    focal = CameraSpec.model_validate(CLEAN).pinhole.focal
    smear = focal * rate * exposure_s
    assert smear > 5.0
    columns = np.arange(160)
    # The share of the exposure in which the plate covers the middle of a pixel of the middle row.
    share = np.clip(0.5 - (columns + 0.5 - 80.0) / smear, 0.0, 1.0)
    expected = BEHIND + share * (inside - BEHIND)
    assert np.abs(pixels[60] - expected).max() < (inside - BEHIND) * (1.0 / 16.0 + 0.5 / smear)
    assert edge_columns(pixels[60:61], inside) == pytest.approx(80.0, abs=0.05)


@pytest.mark.parametrize("rate", [-1.0, 0.4, 1.0])
def test_a_rolling_shutter_skews_an_edge_by_the_exact_projection(plate: tuple[int, int], rate: float) -> None:
    readout_s = 0.05
    inside = float(seen(plate[0], CameraMotion({}, None, *NO_TAGS), X_ORIGIN)[60, 10])
    pixels = seen(plate[0], turning(rate), X_ORIGIN, rolling_shutter_ms=1e3 * readout_s)
    pinhole = CameraSpec.model_validate(CLEAN).pinhole
    times = readout_s * ((np.arange(120) + 0.5) / 120 - 0.5)
    # The plate's edge lies in the vertical plane y = 0; the camera has turned by rate x time.
    exact = pinhole.cx + 0.5 + pinhole.focal * np.tan(rate * times)
    error = edge_columns(pixels, inside) - exact
    assert np.abs(error).max() < 0.05, error


def test_a_body_that_moves_alone_is_blurred_alone(plate: tuple[int, int]) -> None:
    """The plate slides to the left of a camera that stands: its edge is at the closed form at each row."""
    client, body = plate
    speed, readout_s = 0.8, 0.05
    tag = np.array([[1.0, 0.5, -0.3], [1.0, 0.0, -0.3], [1.0, 0.0, 0.2], [1.0, 0.5, 0.2]])
    slides = BodyMotion(np.zeros(3), np.array([0.0, speed, 0.0]), np.zeros(3))
    motion = CameraMotion({body: slides}, None, tag[np.newaxis], np.array([body]))
    inside = float(seen(client, CameraMotion({}, None, *NO_TAGS), X_ORIGIN)[60, 10])
    pixels = seen(client, motion, X_ORIGIN, rolling_shutter_ms=1e3 * readout_s)
    pinhole = CameraSpec.model_validate(CLEAN).pinhole
    times = readout_s * ((np.arange(120) + 0.5) / 120 - 0.5)
    exact = pinhole.cx + 0.5 - pinhole.focal * speed * times
    assert np.abs(edge_columns(pixels, inside) - exact).max() < 0.05


@pytest.mark.parametrize(("blur_px", "instants"), [(0.0, 4), (0.8, 3)])
def test_a_frame_of_sub_exposures_is_the_mean_of_its_instants(
    plate: tuple[int, int], blur_px: float, instants: int
) -> None:
    """Both the few instants and the 16 shades of each are off by at most 1/32 of the contrast."""
    motion = turning(0.9)
    spec = CameraSpec.model_validate(CLEAN | {"exposure_ms": 30.0, "blur_px": blur_px})
    exposures = list(Shutter(spec, spec.pinhole).exposures(spec.pinhole.frame, X_ORIGIN, motion))
    assert [e.rows for e in exposures] == [spec.pinhole.frame] * instants
    np.testing.assert_allclose([e.weights for e in exposures], 1.0 / instants, atol=1e-6)
    renderer = renderer_of(plate[0])
    fine = [instant_after(0.03 * ((k + 0.5) / 64 - 0.5), X_ORIGIN, motion) for k in range(64)]
    exact = np.mean(renderer.render_instants(spec.pinhole, [(spec.pinhole.frame, i) for i in fine]), axis=0)
    exact = gaussian_filter1d(gaussian_filter1d(exact, blur_px, 0), blur_px, 1) if blur_px else exact
    error = np.abs(seen(plate[0], motion, X_ORIGIN, exposure_ms=30.0, blur_px=blur_px) - exact)
    assert error[5:-5, 5:-5].max() < 2.0 / 32.0 * 225.0 + 1.0
    assert error.mean() < 0.5


@pytest.mark.parametrize("rolls", [False, True])
@pytest.mark.parametrize("blur_px", [0.0, 0.4, 0.8, 1.6])
def test_instants_are_as_many_as_an_edge_asks_for(blur_px: float, rolls: bool) -> None:
    """An edge that smears on a fine grid: no pixel is off by more than 1/32 of the contrast.

    One instant less would miss that with a sharp lens, and a quarter of it at least behind one that blurs.
    """
    step = 0.01
    places = np.arange(-20.0, 20.0, step)
    edge = np.clip(places + 0.5, 0.0, 1.0)
    edge = gaussian_filter1d(edge, blur_px / step, mode="nearest") if blur_px else edge

    def mean(smear: float, instants: int, phase: float) -> np.ndarray:
        """Return the mean over an exposure that begins at a share ``phase`` of a cell."""
        cells = np.arange(instants + 1)
        times = smear * ((cells + 0.5 - phase) / instants - 0.5)
        weights = np.clip(cells + 1.0 - phase, 0.0, 1.0) - np.clip(cells - instants + 1.0 - phase, 0.0, 1.0)
        drawn = [np.interp(places - t, places, edge) for t in times]
        return weights / instants @ np.array(drawn)

    def error(smear: float, instants: int, exact: np.ndarray) -> float:
        phases = (0.0, 0.25, 0.5, 0.75) if rolls else (0.0,)
        return max(float(np.abs(mean(smear, instants, phase) - exact).max()) for phase in phases)

    least = 1.0 / 32.0 if blur_px == 0.0 else 0.25 / 32.0
    for smear in (0.1, 0.24, 0.26, 0.9, 1.1, 2.2, 2.3, 3.9, 7.9):
        count, exact = cells_of_smear(smear, blur_px, rolls), mean(smear, 300, 0.0)
        assert error(smear, count, exact) < 1.0 / 32.0 + 1e-3
        assert count == 1 or error(smear, count - 1, exact) > least - 1e-3


def test_a_displaced_body_is_drawn_as_if_it_stood_there(plate: tuple[int, int]) -> None:
    client, body = plate
    camera, renderer = PinholeCamera(160, 120, 140.0), renderer_of(client)
    rng = np.random.default_rng(5)
    for _ in range(5):
        D = SE3.from_xyz_rpy(rng.normal(0.0, 0.1, 3), rng.normal(0.0, 0.2, 3))
        displaced = renderer.render_instants(camera, [(camera.frame, Instant(X_ORIGIN, {body: D}))])[0]
        X_WB = SE3.from_quaternion_xyzw(*pybullet.getBasePositionAndOrientation(body, physicsClientId=client))
        there = D @ X_WB
        pybullet.resetBasePositionAndOrientation(
            body, there.p, there.quaternion_xyzw(), physicsClientId=client
        )
        stood = renderer.render(camera, X_ORIGIN, camera.frame)
        pybullet.resetBasePositionAndOrientation(body, X_WB.p, X_WB.quaternion_xyzw(), physicsClientId=client)
        # PyBullet normalises the quaternion: an edge may round to the next of 16 shades.
        assert (displaced != stood).mean() < 1e-3
        assert np.abs(displaced.astype(int) - stood).max() <= 16


def driven(environment: Environment, unit: str, twist: Twist, ticks: int) -> None:
    plant = environment.simulation.plant
    plant.command(unit, twist)
    for _ in range(ticks):
        plant.step()


def test_every_row_is_the_mean_over_its_own_exposure() -> None:
    """Weights add up to one, and the mean time of a row is the middle of its exposure."""
    for exposure, readout, rate in ((10.0, 20.0, 0.4), (25.0, 8.0, 2.0), (0.0, 30.0, 1.0), (1.0, 30.0, 0.2)):
        spec = CameraSpec(exposure_ms=exposure, rolling_shutter_ms=readout)
        motion = turning(rate)
        frame = spec.pinhole.frame
        total, mean = np.zeros(frame.height), np.zeros(frame.height)
        for part in Shutter(spec, spec.pinhole).exposures(frame, X_ORIGIN, motion):
            rows = slice(part.rows.y, part.rows.y_end)
            R = part.instant.X_WC.R @ X_ORIGIN.R.T
            total[rows] += part.weights
            mean[rows] += part.weights * math.atan2(R[1, 0], R[0, 0]) / rate
        np.testing.assert_allclose(total, 1.0, atol=1e-6)
        middle = 1e-3 * readout * ((np.arange(frame.height) + 0.5) / frame.height - 0.5)
        np.testing.assert_allclose(mean, middle, atol=1e-8)


@pytest.mark.parametrize("count", [25, pytest.param(500, marks=pytest.mark.nightly)])
def test_windows_are_the_crop_of_the_frame_with_every_effect_on(shipped: Load, count: int) -> None:
    keys = {
        "exposure_ms": "12",
        "rolling_shutter_ms": "25",
        "shot_grey": "4",
        "gain": "1.3",
        "gamma": "1.2",
        "vignetting": "0.3",
        "light_gradient": "0.3",
        "jpeg_quality": "60",
    }
    lens = {"as_built.onboard.k1": "-0.08", "as_built.onboard.p1": "0.003"}
    scene = shipped("close_range", lens | {f"cameras.onboard.{key}": value for key, value in keys.items()})
    rng = np.random.default_rng(12)
    with open_environment(scene, 0) as environment:
        step = scene.plan[0]
        driven(environment, step.unit, Twist(0.15, 0.8), 30)
        camera = environment.devices.onboard(step, SE2, NullProfiler()).camera
        camera.expose(0)
        frame = camera.fetch(camera.pinhole.frame).copy()
        for _ in range(count):
            camera._read_out = []  # or the frame would be cropped
            w, h = (int(a) for a in rng.integers(4, 80, 2))
            x, y = int(rng.integers(250, 521 - w)), int(rng.integers(120, 361 - h))
            np.testing.assert_array_equal(camera.fetch(Window(x, y, w, h)), frame[y : y + h, x : x + w])
        assert camera._motion is not None
        assert camera._motion.bodies
        assert camera._distortion is not None
