"""What the perception tests share: a target, images warped from exact corners, a simulated approach."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from functools import cache, partial

import cv2
import numpy as np
import pytest

from msrr_perception.kernels.project import NEAREST_M, project_into
from msrr_perception.pose.target import TargetModel, pose_vector
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.messages import Detections, Exposure, Pixels, TagDetection, WheelOdometry
from msrr_scenes.specs.scene import Scene

SUPERSAMPLING = 8
BLUR_PX = 0.4
TICK_NS = 10_000_000  # encoders at 100 Hz
FRAME_TICKS = 4  # camera at 25 Hz


SCENE = Scene.model_validate(
    {
        "name": "pair",
        "units": {"a": {"number": 1}, "b": {"number": 2}},
        "plan": [{"unit": "a", "to": "b.rear"}],
    }
)
TARGET = TargetModel.from_scene(SCENE, SCENE.docks[0])


@pytest.fixture(scope="session")
def scene() -> Scene:
    return SCENE


@pytest.fixture(scope="session")
def careful() -> Scene:
    """The same, of robots that are built with care."""
    return Scene.model_validate({**SCENE.model_dump(exclude={"as_built"}), "as_built": "careful"})


@pytest.fixture(scope="session")
def target() -> TargetModel:
    return TARGET


def project(target: TargetModel, pose: np.ndarray, points_D: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return points, shape (N, 3), in C by the chain of frames, and their pixels, shape (N, 2).

    It is what the kernels compute, written down in another way.
    """
    x, y, yaw, pitch, roll = (float(a) for a in pose)
    X_DU = SE3.from_xyz_rpy([x, y, 0.0], [roll, pitch, yaw])
    p_C = (target.X_CU @ X_DU.inverse()).act(points_D)
    in_front = p_C.copy()
    in_front[:, 2] = np.maximum(p_C[:, 2], NEAREST_M)
    return p_C, target.camera.project(in_front)


@pytest.fixture(scope="session")
def leaning(target: TargetModel) -> TargetModel:
    """A target that is seen by a camera which is pitched, rolled and turned on its mount."""
    return replace(target, X_UC=target.X_UC @ SE3.from_xyz_rpy([0.01, -0.02, 0.03], [0.3, -0.2, 0.1]))


def jacobian(
    pose: np.ndarray, points_D: np.ndarray, by: TargetModel = TARGET
) -> tuple[np.ndarray, np.ndarray]:
    """Return pixels, shape (2 N,), and derivatives, shape (2 N, 5), as the kernels compute them."""
    pixels, J = np.empty(2 * len(points_D)), np.empty((2 * len(points_D), 5))
    project_into(by.optics, pose, np.ascontiguousarray(points_D), pixels, J)
    return pixels, J


@cache
def plate(tag_id: int) -> Pixels:
    """The print of a tag: 10 x 10 modules, black square 8 x 8; OpenCV's are upside down."""
    family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    square = cv2.aruco.generateImageMarker(family, tag_id, 8, borderBits=1)
    bits = np.pad(np.rot90(square, 2), 1, constant_values=255)
    return np.kron(bits, np.ones((24, 24), dtype=np.uint8))


def warp(window: Window, prints: Iterable[tuple[Pixels, np.ndarray]], background: int = 110) -> Pixels:
    """Draw prints (bitmap, pixels of the black square's corners) into a window, as a lens would."""
    prints = list(prints)
    picture = np.full((window.height, window.width), background, dtype=np.uint8)
    around = np.concatenate([corners for _, corners in prints]) - [window.x, window.y]
    border = 0.3 * np.ptp(around, axis=0).max() + 2.0  # wider than the white border of any print
    size = (window.width, window.height)
    x, y = np.clip(around.min(axis=0) - border, 0, size).astype(int).tolist()
    x_end, y_end = np.clip(around.max(axis=0) + border, 0, size).astype(int).tolist()
    if x < x_end and y < y_end:
        seen = Window(window.x + x, window.y + y, x_end - x, y_end - y)
        picture[y:y_end, x:x_end] = _drawn(seen, prints, background)
    return np.asarray(cv2.GaussianBlur(picture, (0, 0), BLUR_PX), dtype=np.uint8)


def _drawn(window: Window, prints: Iterable[tuple[Pixels, np.ndarray]], background: int) -> Pixels:
    """Draw prints as a sharp lens would: every pixel is the mean of many samples."""
    s = SUPERSAMPLING
    canvas = np.full((window.height * s, window.width * s), background, dtype=np.uint8)
    for bitmap, corners in prints:
        n = bitmap.shape[0]
        lo, hi = 0.1 * n - 0.5, 0.9 * n - 0.5  # the black square inside the white border
        source = np.array([[lo, hi], [hi, hi], [hi, lo], [lo, lo]], dtype=np.float32)
        where = (corners - [window.x, window.y] + 0.5) * s - 0.5
        H = cv2.getPerspectiveTransform(source, where.astype(np.float32))
        size = (canvas.shape[1], canvas.shape[0])
        inside = cv2.warpPerspective(np.full_like(bitmap, 255), H, size, flags=cv2.INTER_NEAREST) > 0
        canvas[inside] = cv2.warpPerspective(bitmap, H, size, flags=cv2.INTER_LINEAR)[inside]
    return cv2.resize(canvas, (window.width, window.height), interpolation=cv2.INTER_AREA)


def draw(X_DU: SE2, window: Window) -> Pixels:
    """Return a picture of the tags of the target port from a pose."""
    corners = [project(TARGET, pose_vector(X_DU), TARGET.corners_D[tag])[1] for tag in TARGET.port_tags]
    return warp(window, zip(map(plate, TARGET.port_tags), corners, strict=True))


def see_target(
    target: TargetModel,
    pose: np.ndarray,
    tags: Iterable[int],
    rng: np.random.Generator | None = None,
    sigma: float = 0.3,
) -> tuple[TagDetection, ...]:
    """Detections at exact or noisy corners."""
    found = []
    for tag in tags:
        _, pixels = project(target, pose, target.corners_D[tag])
        found.append(TagDetection(tag, pixels if rng is None else pixels + rng.normal(0.0, sigma, (4, 2))))
    return tuple(found)


@dataclass
class Drive:
    """A unit that drives towards the target, with what its encoders and its camera say.

    Truth is integrated exactly; the wheels' radii are off by a drawn share, as the encoder spec says.
    """

    target: TargetModel
    seed: int
    X_DU: SE2 = field(default_factory=lambda: SE2(-0.8, 0.05, 0.1))
    speed: Callable[[SE2], tuple[float, float]] = lambda X: (0.11, -3.0 * X.y - 1.5 * X.yaw)
    scale_error: float = 0.02
    sigma: float = 0.3
    tags: tuple[int, ...] | None = None
    blocked: bool = False  # the wheels turn, the unit stands
    tick: int = 0
    under_way: list[tuple[int, Detections]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.rng = np.random.default_rng(self.seed)
        self._scale = self.rng.normal(0.0, self.scale_error, 2)
        self._wheels = np.zeros(2)
        self._tilt = self.rng.normal(0.0, math.radians(0.2), 2)

    @property
    def now_ns(self) -> int:
        return self.tick * TICK_NS

    def step(self) -> tuple[WheelOdometry, Detections | None]:
        """Advance one tick; return the encoders' reading and, when one is due, the picture's tags."""
        self.tick += 1
        v, w = self.speed(self.X_DU)
        half = 0.5 * w * self.target.track
        way = np.array([v - half, v + half]) * TICK_NS * 1e-9
        if not self.blocked:
            turn = float(way[1] - way[0]) / self.target.track
            self.X_DU = self.X_DU @ SE2.exp(float(way.mean()), 0.0, turn)
        self._wheels += way / (1.0 + self._scale) / self.target.wheel_radius
        quantum = 2.0 * math.pi / 4096
        left, right = np.round(self._wheels / quantum) * quantum
        reading = WheelOdometry("a", self.now_ns, float(left), float(right))
        return reading, self.look() if self.tick % FRAME_TICKS == 0 else None

    def look(self) -> Detections:
        pose = pose_vector(self.X_DU, *self._tilt)
        tags = see_target(self.target, pose, self.tags or self.target.port_tags, self.rng, self.sigma)
        return Detections(Exposure("a/onboard", self.tick // FRAME_TICKS, self.now_ns), tags, ())


see, make_drive = partial(see_target, TARGET), partial(Drive, TARGET)
