"""Cameras: the place of corners, windows against full frames, lost frames, and what is refused."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pybullet
import pytest

from msrr_bullet.render import RenderContext, Renderer, build_renderer
from msrr_bullet.sensors.camera import Camera, CameraError
from msrr_bullet.simulation.tagged_bodies import TagVisuals
from msrr_perception.detection.detector import PupilDetector
from msrr_scenes.geometry.pinhole import PinholeCamera, Window, optical_pose
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.unit_geometry import tag_corners
from msrr_scenes.messages import Exposure, Pixels
from msrr_scenes.specs.faults import CameraBlackout, Fault
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.sensors import CameraSpec, OverheadCameraSpec


@pytest.fixture(scope="module")
def scene() -> Scene:
    return Scene.model_validate(
        {
            "name": "views",
            "units": {"a": {"number": 1}, "b": {"number": 0}},
            "plan": [{"unit": "a", "to": "b.rear"}],
        }
    )


@pytest.fixture(scope="module")
def client(scene: Scene) -> Iterator[int]:
    """A client with unit b, its axle in the world's origin."""
    client = pybullet.connect(pybullet.DIRECT)
    with tempfile.TemporaryDirectory() as name:
        tags = TagVisuals(scene, Path(name))
        body = pybullet.loadURDF(str(tags.unit_urdf("b")), useFixedBase=True, physicsClientId=client)
        inertial = pybullet.getDynamicsInfo(body, -1, physicsClientId=client)
        pybullet.resetBasePositionAndOrientation(body, inertial[3], inertial[4], physicsClientId=client)
        tags.add_to_unit(client, body, "b")
        yield client
    pybullet.disconnect(client)


def onboard_pose(scene: Scene, gap: float, lateral: float = 0.0, yaw: float = 0.0) -> SE3:
    """The onboard camera of a unit whose front is ``gap`` before the rear face of unit b."""
    X_WU = SE3.from_xyz_rpy([-0.2 - gap, lateral, 0.0], [0.0, 0.0, yaw])
    return optical_pose(X_WU @ scene.geometry("a").frame("camera"))


def renderer_of(client: int, spec: CameraSpec) -> Renderer:
    return build_renderer(spec.renderer, RenderContext(client, spec.samples))


def open_camera(client: int, spec: CameraSpec, X_WC: SE3, name: str = "a/onboard") -> Camera:
    return Camera(name, spec, renderer_of(client, spec), lambda: X_WC, seed=4)


def test_corners_appear_at_the_exact_projection_in_120_views(client: int, scene: Scene) -> None:
    """Detected corners against the exact projection; default camera with noise and blur.

    Corners of one view share errors; with 120 views of 3 tags the standard error of a mean is below 0.011 px.
    """
    geometry, ids, detector = scene.geometry("b"), scene.tag_ids("b"), PupilDetector()
    slot = {tag_id: name for name, tag_id in ids.items()}
    spec = CameraSpec()
    renderer = renderer_of(client, spec)
    rng = np.random.default_rng(2024)
    errors = []
    for _ in range(120):
        gap, side = rng.uniform(0.15, 0.9), rng.uniform(-0.45, 0.45)
        lateral = gap * math.tan(side)
        tilt = SE3.from_xyz_rpy([0.0, 0.0, 0.0], rng.normal(0.0, 0.02, 3))
        aim = -side + rng.uniform(-0.15, 0.15)
        X_WC = onboard_pose(scene, gap, lateral, aim) @ tilt
        camera = Camera("a/onboard", spec, renderer, lambda X=X_WC: X, int(rng.integers(1 << 30)))
        truth = {
            tag_id: camera.pinhole.project(
                (X_WC.inverse() @ geometry.frame(name)).act(tag_corners(scene.tag_size("b", name)))
            )
            for tag_id, name in slot.items()
        }
        wanted = Window.around(np.concatenate([truth[i] for i in (1, 2, 3)]), 10)
        window = wanted.intersection(camera.pinhole.frame)
        assert window is not None
        camera.expose(0)
        for tag in detector.detect(camera.fetch(window), window):
            errors.append(tag.corners - truth[tag.tag_id])
    e = np.concatenate(errors)
    mean, rms = e.mean(axis=0), np.sqrt((e**2).mean(axis=0))
    print(f"{len(e)} corners: mean {mean.round(4)} px, RMS {rms.round(4)} px")
    assert len(errors) > 300
    assert np.abs(mean).max() < 0.012, mean
    assert rms.max() < 0.06, rms


VIEWS = (
    ("a/onboard", CameraSpec(), 0.8),
    ("a/onboard", CameraSpec(noise_grey=8.0, blur_px=1.0), 0.4),
    ("a/onboard", CameraSpec(), 0.2),
    ("a/onboard", CameraSpec(), 0.05),
    ("overhead", OverheadCameraSpec(), None),
)


def test_500_windows_equal_the_crop_of_the_full_frame(client: int, scene: Scene) -> None:
    """With noise and blur, bit for bit."""
    rng = np.random.default_rng(77)
    for name, spec, gap in VIEWS:
        X_WC = (
            SE3(np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, 3.0]))
            if gap is None
            else onboard_pose(scene, gap, 0.03 * gap, 0.02)
        )
        whole, lazy = (open_camera(client, spec, X_WC, name) for _ in range(2))
        assert whole.expose(0) == lazy.expose(0)
        frame = whole.fetch(whole.pinhole.frame)
        for k in range(100):
            w, h = (int(a) for a in rng.integers(8, 96, 2))
            # Half of them about the unit, where the edges are.
            middle = np.array([0.5 * lazy.pinhole.width, 0.5 * lazy.pinhole.height])
            spread = np.array([90.0, 70.0]) if k % 2 else middle
            corner = middle + rng.uniform(-1.0, 1.0, 2) * spread - np.array([w, h]) / 2
            x = int(np.clip(corner[0], 0, lazy.pinhole.width - w))
            y = int(np.clip(corner[1], 0, lazy.pinhole.height - h))
            part = lazy.fetch(Window(x, y, w, h))
            np.testing.assert_array_equal(part, frame[y : y + h, x : x + w])


class ColumnRenderer:
    """A renderer that keeps the windows and whose pixels are the column numbers."""

    def __init__(self) -> None:
        self.windows: list[Window] = []

    def render(self, camera: PinholeCamera, X_WC: SE3, window: Window) -> Pixels:
        self.windows.append(window)
        return np.tile(np.arange(window.x, window.x_end).astype(np.uint8), (window.height, 1))


def small(renderer: ColumnRenderer, faults: tuple[Fault, ...] = (), seed: int = 0, **spec: object) -> Camera:
    settings = {"width_px": 64, "height_px": 48, "noise_grey": 0.0, "blur_px": 0.0, **spec}
    return Camera("a/onboard", CameraSpec.model_validate(settings), renderer, SE3, seed, faults)


def test_a_window_inside_an_earlier_one_is_not_rendered_again() -> None:
    renderer = ColumnRenderer()
    camera = small(renderer)
    camera.expose(0)
    first = camera.fetch(Window(10, 10, 20, 20))
    np.testing.assert_array_equal(camera.fetch(Window(12, 15, 4, 3)), first[5:8, 2:6])
    assert renderer.windows == [Window(10, 10, 20, 20)]
    assert not first.flags.writeable
    camera.expose(1)
    camera.fetch(Window(12, 15, 4, 3))
    assert len(renderer.windows) == 2


def test_nothing_is_rendered_before_it_is_fetched() -> None:
    renderer = ColumnRenderer()
    camera = small(renderer)
    for k in range(5):
        assert camera.expose(k) == Exposure("a/onboard", k, k)
    assert renderer.windows == []


def test_blur_needs_pixels_outside_the_frame() -> None:
    renderer = ColumnRenderer()
    camera = small(renderer, blur_px=0.6)
    camera.expose(0)
    camera.fetch(camera.pinhole.frame)
    assert renderer.windows == [camera.pinhole.frame.padded(2)]


def test_a_sensor_without_regions_of_interest_reads_out_full_frames() -> None:
    renderer = ColumnRenderer()
    camera = small(renderer, readout="frames")
    camera.expose(0)
    part = camera.fetch(Window(30, 5, 4, 2))
    assert part.tolist() == [[30, 31, 32, 33]] * 2
    assert renderer.windows == [camera.pinhole.frame]
    camera.fetch(Window(0, 0, 4, 2))
    assert len(renderer.windows) == 1


@pytest.mark.parametrize(
    "window", [Window(-1, 0, 5, 5), Window(60, 0, 5, 5), Window(0, 44, 5, 5), Window(3, 3, 0, 4)]
)
def test_windows_outside_the_frame_are_refused(window: Window) -> None:
    camera = small(ColumnRenderer())
    camera.expose(0)
    with pytest.raises(CameraError, match="64 x 48"):
        camera.fetch(window)


def test_a_window_of_a_lost_frame_cannot_be_fetched() -> None:
    camera = small(ColumnRenderer(), dropout=1.0)
    with pytest.raises(CameraError, match="no exposure"):
        camera.fetch(Window(0, 0, 4, 4))
    assert camera.expose(0) is None
    with pytest.raises(CameraError, match="no exposure"):
        camera.fetch(Window(0, 0, 4, 4))


def test_the_lost_frames_depend_on_seed_and_blackouts_alone() -> None:
    """2,000 frames at 30 %: a fair stream leaves 600 +- 103 (5 sigma) once in 1.7 million seeds."""

    def lost(**options: object) -> list[bool]:
        camera = small(ColumnRenderer(), dropout=0.3, **options)  # any of its keywords
        return [camera.expose(k * 40_000_000) is None for k in range(2000)]

    plain = lost()
    assert abs(sum(plain) - 600) < 103
    assert lost(noise_grey=4.0) == plain
    assert lost(seed=1) != plain
    dark = CameraBlackout(kind="camera_blackout", camera="a/onboard", from_s=10.0, to_s=20.0)
    other = CameraBlackout(kind="camera_blackout", camera="b/onboard", from_s=30.0, to_s=40.0)
    blacked = lost(faults=(dark, other))
    assert all(blacked[250:500])
    assert blacked[:250] == plain[:250]
    assert blacked[500:] == plain[500:]


def test_the_pose_is_taken_at_the_exposure(client: int, scene: Scene) -> None:
    """A window fetched after the camera has moved shows the view of the exposure."""
    poses = [onboard_pose(scene, 0.4), onboard_pose(scene, 0.3)]
    spec = CameraSpec(noise_grey=0.0)
    renderer = build_renderer(spec.renderer, RenderContext(client, spec.samples))
    moving = Camera("a/onboard", spec, renderer, lambda: poses[0], 4)
    moving.expose(0)
    poses.pop(0)
    window = Window(260, 180, 120, 80)
    still = open_camera(client, spec, onboard_pose(scene, 0.4))
    still.expose(0)
    np.testing.assert_array_equal(moving.fetch(window), still.fetch(window))
