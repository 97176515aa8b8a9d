"""A camera that is mounted askew of its calibration: which way, and by how much, everything it sees moves."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from msrr_bullet.profiler import NullProfiler
from msrr_bullet.simulation.simulation import camera_pose
from msrr_bullet.trial.environment import open_environment
from msrr_perception.detection.detector import PupilDetector
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import Detections, Exposure, Fetch, PoseMeasurement
from msrr_scenes.placement.placement import draw_placement
from msrr_scenes.random_streams import stream
from msrr_scenes.specs.scene import Scene

YAW_DEG = 5.0


def _scene(yaw_deg: float, **changes: Any) -> Scene:
    """Unit a looks at the rear of b from 0.3 m away, a little from the side."""
    return Scene.model_validate(
        {
            "name": "askew",
            "plant": "unicycle",
            "units": {
                "b": {"number": 1, "pose": {"x_m": 0.4}},
                "a": {"number": 0, "pose": {"frame": "b.rear", "x_m": -0.4, "y_m": 0.02, "yaw_deg": 3}},
            },
            "cameras": {"onboard": {"renderer": "raster", "samples": 1, "noise_grey": 0.0}},
            "faults": [{"kind": "camera_misaligned", "unit": "a", "yaw_deg": yaw_deg}],
            "plan": [{"unit": "a", "to": "b.rear"}],
            **changes,
        }
    )


class _Reader:
    """Reads every tag of the whole frame."""

    def __init__(self, scene: Scene) -> None:
        self._frame = scene.cameras.onboard.pinhole.frame
        self._detector = PupilDetector()

    def expose(self, exposure: Exposure, fetch: Fetch) -> Detections:
        return Detections(exposure, self._detector.detect(fetch(self._frame), self._frame), (self._frame,))


def _seen(yaw_deg: float) -> dict[int, np.ndarray]:
    """Corners of the tags in the rendered frame, by tag, each of shape (4, 2) [px]."""
    scene = _scene(yaw_deg)
    with open_environment(scene, 3, draw_placement(scene, lambda name: stream(3, name))) as environment:
        (onboard,) = environment.devices.cameras(scene.plan[0], SE2, NullProfiler())
        (found,) = onboard.capture(0, _Reader(scene))
    assert isinstance(found, Detections)
    return {tag.tag_id: tag.corners for tag in found.tags}


@pytest.fixture(scope="module")
def straight() -> dict[int, np.ndarray]:
    return _seen(0.0)


@pytest.mark.parametrize("yaw_deg", [YAW_DEG, -YAW_DEG])
def test_turned_to_the_left_it_sees_everything_further_to_the_right(
    straight: dict[int, np.ndarray], yaw_deg: float
) -> None:
    """Every corner's direction across the image moves by the whole angle; the middle by some 40 px."""
    pinhole, askew = _scene(0.0).cameras.onboard.pinhole, _seen(yaw_deg)
    assert set(askew) == set(straight)
    assert len(straight) >= 2
    for tag, corners in straight.items():
        moved = askew[tag] - corners
        assert np.all(math.copysign(1.0, yaw_deg) * moved[:, 0] > 10.0)  # columns count to the right
        before, after = (np.arctan((c[:, 0] - pinhole.cx) / pinhole.focal) for c in (corners, askew[tag]))
        np.testing.assert_allclose(after - before, math.radians(yaw_deg), atol=math.radians(0.05))


def test_what_the_robot_believes_of_its_camera_is_unmoved() -> None:
    """The fault is in the world: what the makers tell the robot is the geometry without it."""
    scene = _scene(YAW_DEG)
    X_UB = scene.geometry("a").frame("camera")
    X_BB = (X_UB.inverse() @ camera_pose(scene, "a")).to_se2()
    assert (X_BB.x, X_BB.y, X_BB.yaw) == pytest.approx((0.0, 0.0, math.radians(YAW_DEG)))
    assert camera_pose(scene, "b").to_se2() == X_UB.to_se2()


@pytest.mark.parametrize("yaw_deg", [YAW_DEG, -YAW_DEG])
def test_the_model_of_the_camera_is_askew_the_same_way(yaw_deg: float) -> None:
    """Bearings are positive to the left: seen by a camera turned left, all of them fall."""
    edges = []
    for yaw in (0.0, yaw_deg):
        exact = {"sigma_xy_m": 0.0, "sigma_yaw_deg": 0.0, "sigma_bearing_deg": 0.0}
        scene = _scene(yaw, perception="parametric", parametric=exact)
        with open_environment(scene, 3, draw_placement(scene, lambda name: stream(3, name))) as environment:
            cameras = environment.devices.cameras
            (onboard,) = cameras(scene.plan[0], lambda: SE2(-0.5, 0.02, 0.05), NullProfiler())
            (found,) = onboard.capture(0, _Reader(scene))
        assert isinstance(found, PoseMeasurement)
        left, right = found.edge_bearings
        assert left is not None
        assert right is not None
        assert left > right
        edges.append(np.array([left, right]))
    np.testing.assert_allclose(edges[1] - edges[0], -math.radians(yaw_deg), atol=1e-12)
