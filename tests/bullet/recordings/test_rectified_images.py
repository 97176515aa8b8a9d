"""Rectified images have the calibration in P; what is no calibration is refused, unless one is given."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml

from msrr_bullet.recordings.recording import RecordingError
from msrr_bullet.recordings.run import Options, perceive
from msrr_scenes.specs.sensors import CalibrationSpec
from tests.bullet.recordings.conftest import Trial
from tests.bullet.recordings.mcap_files import FOCAL, write_ros2

IDEAL = CalibrationSpec(fx_px=FOCAL, fy_px=FOCAL, cx_px=319.5, cy_px=239.5)

#: Calibration of the raw images of a camera whose rectified ones are those of the trial.
RAW = {"k": [480.0, 0.0, 310.0, 0.0, 480.0, 245.0, 0.0, 0.0, 1.0], "d": [-0.3, 0.1, 0.0, 0.0, 0.0]}
P = [FOCAL, 0.0, 319.5, 0.0, 0.0, FOCAL, 239.5, 0.0, 0.0, 0.0, 1.0, 0.0]


@pytest.fixture
def target(trial: Trial, tmp_path: Path) -> Path:
    """A target file that does not tell of the camera."""
    told = yaml.safe_load(trial.target.read_text())
    del told["camera"]["hfov_deg"]
    path = tmp_path / "target.yaml"
    path.write_text(yaml.safe_dump(told))
    return path


@pytest.mark.parametrize(
    "topic", ["/camera/image_rect", "/camera/image_rect_color/compressed", "/camera/image_rectified"]
)
def test_rectified_images_are_read_by_the_projection_matrix(
    trial: Trial, target: Path, tmp_path: Path, topic: str
) -> None:
    frames = trial.frames()[:3]
    path = write_ros2(tmp_path / "film.mcap", frames, [], image_topic=topic, p=P, **RAW)
    right = perceive(path, target, Options(IDEAL)).last_pose
    assert right is not None
    assert perceive(path, target).last_pose == pytest.approx(right, abs=1e-9)
    # The calibration of the raw images is not what they were taken with, and counts for topics of others.
    topics: Any = {"image_topic": "/image_rectifier/image", "info_topics": ("/image_rectifier/camera_info",)}
    raw = write_ros2(tmp_path / "raw.mcap", frames, [], **topics, p=P, **RAW)
    assert perceive(raw, target).last_pose != pytest.approx(right, abs=1e-4)


@pytest.mark.parametrize(
    ("images", "others"),
    [
        ("/camera/image_raw", "/camera/aligned/camera_info"),
        ("/front/image_raw", "/rear/camera_info"),
        ("/camera/color/image_raw/compressed", "/camera/depth/camera_info"),
    ],
)
def test_the_calibration_is_that_of_the_camera_by_its_name(
    trial: Trial, target: Path, tmp_path: Path, images: str, others: str
) -> None:
    """That of another camera was taken where it came first in the alphabet, or was the only one."""
    frames, topics = trial.frames()[:2], (images.partition("/image")[0] + "/camera_info", others)
    both = write_ros2(tmp_path / "both.mcap", frames, [], image_topic=images, info_topics=topics, k=RAW["k"])
    found, right = perceive(both, target), perceive(both, target, Options(IDEAL))
    assert found.last_pose == pytest.approx(right.last_pose, abs=1e-9)
    assert found.recording.endswith(f", calibration on {topics[0]}")
    assert "calibration on" not in right.recording


@pytest.mark.parametrize(
    ("images", "info", "own"),
    [
        ("/camera/image_raw", "/camera/camera_info", True),
        ("/camera/image_raw/compressed", "/camera/camera_info", True),
        ("/camera/image_raw", "/camera/image_raw/camera_info", True),
        ("/camera/image_raw", "/camera_info", True),
        ("/camera/image_raw", "/camera/depth/camera_info", False),
        ("/image_raw", "/stereo/left/camera_info", False),
    ],
)
def test_a_calibration_in_another_folder_is_of_another_camera(
    trial: Trial, target: Path, tmp_path: Path, images: str, info: str, own: bool
) -> None:
    """That of the depth camera was used for the images beside it, and put the robot 25 cm off."""
    path = tmp_path / "two.mcap"
    write_ros2(path, trial.frames()[:2], [], image_topic=images, info_topics=(info,))
    if own:
        assert perceive(path, target).used == 2
    else:
        with pytest.raises(RecordingError, match=rf"{info} is the calibration of {images}, their names do"):
            perceive(path, target)


def test_calibrations_of_other_cameras_are_refused(trial: Trial, target: Path, tmp_path: Path) -> None:
    topics: Any = {
        "image_topic": "/front/image_raw",
        "info_topics": ("/left/camera_info", "/rear/camera_info"),
    }
    path = write_ros2(tmp_path / "film.mcap", trial.frames()[:1], [], **topics)
    with pytest.raises(RecordingError, match=r"which of /left/camera_info, /rear/camera_info is the calib"):
        perceive(path, target)
    assert perceive(path, target, Options(IDEAL)).used == 1


@pytest.mark.parametrize(
    ("topic", "told", "text"),
    [
        ("image_rect", RAW, "P, by which rectified images are read, is 0; give --calibration FILE"),
        ("image", {"k": [0.0] * 9}, "K is 0; give --calibration FILE"),
        ("image", {"binning_x": 2}, "binned or cut pictures; give --calibration FILE"),
        ("image", {"roi": {"x_offset": 0, "y_offset": 8, "width": 640, "height": 472}}, "binned or cut"),
    ],
)
def test_what_is_no_calibration_is_refused_unless_one_is_given(
    trial: Trial, target: Path, tmp_path: Path, topic: str, told: dict[str, Any], text: str
) -> None:
    path = write_ros2(tmp_path / "film.mcap", trial.frames()[:1], [], image_topic=f"/camera/{topic}", **told)
    with pytest.raises(RecordingError, match=f"/camera/camera_info: .*{text}"):
        perceive(path, target)
    assert perceive(path, target, Options(IDEAL)).used == 1
