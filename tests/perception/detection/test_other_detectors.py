"""Detectors by way of other libraries: order and place of corners, corrected bits, names in scenes."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from msrr_perception.detection.aruco_detector import ArucoDetector
from msrr_perception.detection.detector import DETECTORS, Detector, PupilDetector, scene_detector
from msrr_perception.detection.native_apriltag import tag_bitmap
from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.messages import Pixels
from msrr_scenes.registry import build
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.spec import Choice
from tests.perception.conftest import plate, warp

WINDOW = Window(0, 0, 160, 160)
SQUARE = np.array([[48.0, 112.0], [112.0, 112.0], [112.0, 48.0], [48.0, 48.0]])


@pytest.mark.parametrize(
    ("name", "params", "rms_px"),
    [
        ("pupil", {}, 0.02),
        ("pupil", {"refine": False}, 0.12),
        ("aruco", {}, 0.25),
        ("aruco", {"corner_refinement": "apriltag"}, 0.3),
        ("aruco", {"refine": True}, 0.01),
        pytest.param("pyapriltags", {}, 0.05, marks=pytest.mark.nightly),
        pytest.param("pyapriltags", {"refine": True}, 0.01, marks=pytest.mark.nightly),
    ],
)
def test_corners_come_in_the_order_of_the_tag_and_count_from_pixel_centres(
    name: str, params: dict, rms_px: float
) -> None:
    """A tag of 64 px at known pixels, 20 times: half a pixel, a turn or a mirror would all show."""
    detector: Detector = build("detector", Choice(name=name, params=params), DETECTORS)
    rng, errors, told = np.random.default_rng(0), [], []
    for _ in range(20):
        square = SQUARE + rng.uniform(0.0, 2.0, 2) + rng.normal(0.0, 1.0, (4, 2))
        (found,) = detector.detect(warp(WINDOW, [(plate(7), square)]), WINDOW)
        assert (found.tag_id, found.hamming) == (7, 0)
        assert found.decision_margin > 50.0
        errors.append(found.corners - square)
        assert found.corner_sigma_px is not None
        told.append(found.corner_sigma_px)
    assert np.abs(np.mean(errors, axis=(0, 1))).max() < 0.1
    assert np.sqrt(np.mean(np.square(errors))) < rms_px
    normalised = errors / np.array(told)[:, :, None]
    assert np.sqrt(np.mean(np.square(normalised))) < 1.1, "they are less precise than the detector says"


def test_the_detector_that_a_page_writes_has_the_order_of_corners_that_it_names() -> None:
    """A reader who kept OpenCV's order got no pose, and was not told why."""
    page = Path(__file__).resolve().parents[3] / "docs" / "reference" / "extension_points.md"
    (text,) = re.findall(r"```python\n(import cv2\n.*?)```", page.read_text(), re.DOTALL)
    names: dict[str, Any] = {}
    exec(compile(text, str(page), "exec"), names)
    window, place = Window(30, 20, 160, 160), np.array([30.0, 20.0])
    (found,) = names["MyDetector"]().detect(warp(window, [(plate(7), SQUARE + place)]), window)
    assert found.tag_id == 7
    assert np.abs(found.corners - SQUARE - place).max() < 0.5
    # The filter takes corners without it to be those of ``pupil``, and rejects many exposures.
    assert found.corner_sigma_px is not None


def damaged(bits: int) -> Pixels:
    """Return the print of tag 7 with some wrong modules."""
    out = plate(7).copy()
    for k in range(bits):
        row, column = 24 * (3 + k), 24 * (4 + k)
        out[row : row + 24, column : column + 24] ^= 255
    return out


@pytest.mark.parametrize("detector", [PupilDetector, ArucoDetector])
def test_wrong_bits_are_counted_and_bounded(detector: Callable[..., Detector]) -> None:
    for bits, kept in ((0, True), (1, True), (2, False)):
        image = warp(WINDOW, [(damaged(bits), SQUARE)])
        found = detector().detect(image, WINDOW)
        assert [(t.tag_id, t.hamming) for t in found] == ([(7, bits)] if kept else [])
    assert len(detector(max_hamming=2).detect(image, WINDOW)) == 1


@pytest.mark.parametrize("family", ["tag16h5", "tag25h9"])
def test_opencv_reads_the_families_that_it_knows(family: str) -> None:
    """The prints of the AprilTag library are the same tags, turned the same way, in OpenCV's dictionaries."""
    bits = tag_bitmap(family, 5).astype(np.uint8) * 255
    n, edge = len(bits), 8 * (len(bits) - 2)
    image = np.pad(np.kron(bits, np.ones((8, 8), np.uint8)), 24, constant_values=255)
    (found,) = ArucoDetector(family).detect(image, Window(0, 0, 8 * n + 48, 8 * n + 48))
    assert (found.tag_id, found.hamming) == (5, 0)
    expected = 31.5 + edge * np.array([[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]])
    np.testing.assert_allclose(found.corners, expected, atol=0.5)


def test_a_scene_names_them_and_mistakes_are_named(scene: Scene) -> None:
    def with_detector(name: str, **params: object) -> Scene:
        control = scene.control.model_copy(update={"detector": Choice(name=name, params=params)})
        return scene.model_copy(update={"control": control})

    assert isinstance(scene_detector(with_detector("aruco", corner_refinement="none")), ArucoDetector)
    with pytest.raises(SceneError, match="corner_refinement: detector 'aruco': has to be one of none"):
        scene_detector(with_detector("aruco", corner_refinement="best"))
    with pytest.raises(SceneError, match="family: detector 'aruco': has to be one of tag16h5"):
        scene_detector(with_detector("aruco", family="tagStandard41h12"))


def test_a_missing_extra_is_named_with_the_mend(monkeypatch: pytest.MonkeyPatch) -> None:
    """Asked for a family that no other test has loaded."""
    monkeypatch.setitem(sys.modules, "pyapriltags", None)
    said = r"^control\.detector: detector 'pyapriltags' .* pip install 'msrr-bullet\[pyapriltags\]'"
    with pytest.raises(SceneError, match=said):
        build("control.detector", Choice(name="pyapriltags", params={"family": "tag25h9"}), DETECTORS)
