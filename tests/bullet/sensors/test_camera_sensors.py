"""Camera sensors: the image of a misaligned camera, lost frames, and errors of a global localisation."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from msrr_bullet.profiler import NullProfiler
from msrr_bullet.trial.environment import open_environment
from msrr_perception.detection.detector import PupilDetector
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import Detections, Exposure, Fetch, Localisation, PoseMeasurement
from msrr_scenes.specs.scene import Scene

YAW_DEG = 5.0


def _scene(yaw_deg: float, **changes: Any) -> Scene:
    """Unit a looks at the rear of b from 0.3 m away, a little from the side."""
    return Scene.model_validate(
        {
            "name": "misaligned",
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


class _FullFrameReader:
    """Detects every tag in the full frame."""

    def __init__(self, scene: Scene) -> None:
        self.frame = scene.cameras.onboard.pinhole.frame
        self._detector = PupilDetector()

    def expose(self, exposure: Exposure, fetch: Fetch) -> Detections:
        return Detections(exposure, self._detector.detect(fetch(self.frame), self.frame), (self.frame,))


def _corners(yaw_deg: float) -> dict[int, np.ndarray]:
    """Corners of the tags in the rendered frame, by tag, each of shape (4, 2) [px]."""
    scene = _scene(yaw_deg)
    with open_environment(scene, 3) as environment:
        (onboard,) = environment.devices.cameras(scene.plan[0], SE2, NullProfiler())
        (measured,) = onboard.capture(0, _FullFrameReader(scene))
    assert isinstance(measured, Detections)
    return {tag.tag_id: tag.corners for tag in measured.tags}


@pytest.fixture(scope="module")
def straight() -> dict[int, np.ndarray]:
    return _corners(0.0)


@pytest.mark.parametrize("yaw_deg", [YAW_DEG, -YAW_DEG])
def test_a_camera_turned_left_shows_everything_further_to_the_right(
    straight: dict[int, np.ndarray], yaw_deg: float
) -> None:
    """The bearing of every corner changes by the whole angle; the middle of the image moves by 40 px."""
    pinhole, turned = _scene(0.0).cameras.onboard.pinhole, _corners(yaw_deg)
    assert set(turned) == set(straight)
    assert len(straight) >= 2
    for tag, corners in straight.items():
        moved = turned[tag] - corners
        assert np.all(math.copysign(1.0, yaw_deg) * moved[:, 0] > 10.0)  # columns count to the right
        before, after = (np.arctan((c[:, 0] - pinhole.cx) / pinhole.focal) for c in (corners, turned[tag]))
        np.testing.assert_allclose(after - before, math.radians(yaw_deg), atol=math.radians(0.05))


@pytest.mark.parametrize("yaw_deg", [YAW_DEG, -YAW_DEG])
def test_the_model_of_a_misaligned_camera_is_turned_the_same_way(yaw_deg: float) -> None:
    """Bearings are positive to the left, so that those of a camera turned left decrease."""
    edges = []
    for yaw in (0.0, yaw_deg):
        exact = {"sigma_xy_m": 0.0, "sigma_yaw_deg": 0.0, "sigma_bearing_deg": 0.0}
        scene = _scene(yaw, perception="parametric", parametric=exact)
        with open_environment(scene, 3) as environment:
            cameras = environment.devices.cameras
            (onboard,) = cameras(scene.plan[0], lambda: SE2(-0.5, 0.02, 0.05), NullProfiler())
            (measured,) = onboard.capture(0, _FullFrameReader(scene))
        assert isinstance(measured, PoseMeasurement)
        left, right = measured.edge_bearings
        assert left is not None
        assert right is not None
        assert left > right
        edges.append(np.array([left, right]))
    np.testing.assert_allclose(edges[1] - edges[0], -math.radians(yaw_deg), atol=1e-12)


def test_a_lost_frame_gives_no_message_and_the_robot_is_not_asked() -> None:
    scene = _scene(0.0, cameras={"onboard": {"renderer": "raster", "samples": 1, "dropout": 1.0}})

    class Unused(_FullFrameReader):
        def expose(self, exposure: Exposure, fetch: Fetch) -> Detections:
            raise AssertionError("a lost frame reached the robot")

    with open_environment(scene, 3) as environment:
        (onboard,) = environment.devices.cameras(scene.plan[0], SE2, NullProfiler())
        assert onboard.capture(0, Unused(scene)) == ()


def test_a_robot_that_detects_nothing_sends_nothing() -> None:
    class Blind(_FullFrameReader):
        def expose(self, exposure: Exposure, fetch: Fetch) -> Detections | None:
            return None

    scene = _scene(0.0)
    with open_environment(scene, 3) as environment:
        (onboard,) = environment.devices.cameras(scene.plan[0], SE2, NullProfiler())
        assert onboard.capture(0, Blind(scene)) == ()


def test_a_localisation_error_moves_the_tag_of_the_docking_unit_alone() -> None:
    """The overhead camera delivers a localisation: the corners in the image, less those that are moved."""
    overhead = {"renderer": "raster", "samples": 1}
    tags = []
    for error in ({}, {"bias_x_m": 0.03}):
        cameras = {"overhead": {**overhead, "localisation": error}}
        scene = _scene(0.0, cameras=cameras)
        reader = _FullFrameReader(scene)
        assert scene.cameras.overhead is not None
        reader.frame = scene.cameras.overhead.pinhole.frame
        with open_environment(scene, 3) as environment:
            camera, _ = environment.devices.cameras(scene.plan[0], SE2, NullProfiler())
            (message,) = camera.capture(0, reader)
        assert isinstance(message, Localisation if error else Detections)
        detections = message.detections if isinstance(message, Localisation) else message
        tags.append({tag.tag_id: tag.corners for tag in detections.tags})
    top = {scene.tag_ids(unit)["tag_top"] for unit in "ab"}
    own = scene.tag_ids("a")["tag_top"]
    assert tags[0].keys() == tags[1].keys() >= top
    for tag_id, corners in tags[0].items():
        shift = np.abs(tags[1][tag_id] - corners).max()
        assert (shift > 5.0) if tag_id == own else (shift == 0.0)
