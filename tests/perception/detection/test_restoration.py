"""Images of a camera that blurs are restored for the search of tags, which are read from farther away."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from msrr_perception.detection.aruco_detector import ArucoDetector
from msrr_perception.detection.detector import PupilDetector, for_camera
from msrr_perception.detection.refining_detector import RefiningDetector
from msrr_perception.detection.restoration import noise_gain, restored, restoring_filter
from msrr_perception.pose.target import TargetModel, pose_vector
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import Pixels
from tests.perception.conftest import draw, project

#: Blur [px] and noise [grey levels] of cameras of the grades ``workshop`` and ``rough``, and of two others.
CAMERAS = [(1.13, 8.0), (1.6, 16.0), (1.0, 2.0), (2.5, 2.0)]


def seen(image: Pixels, blur_px: float, noise_grey: float, rng: np.random.Generator) -> Pixels:
    grey = cv2.GaussianBlur(image.astype(np.float64), (0, 0), blur_px)
    grey += rng.normal(0.0, noise_grey, image.shape)
    return np.clip(np.rint(grey), 0, 255).astype(np.uint8)


@pytest.mark.parametrize(("blur_px", "noise_grey"), CAMERAS)
def test_the_filter_keeps_the_brightness_and_has_the_symmetry_of_the_blur(
    blur_px: float, noise_grey: float
) -> None:
    by = restoring_filter(blur_px, noise_grey)
    assert by is not None
    assert by.sum() == pytest.approx(1.0)
    for other in (by.T, by[::-1], by[:, ::-1]):
        np.testing.assert_allclose(other, by, atol=1e-12)
    flat = np.full((90, 90), 128.0) + np.random.default_rng(1).normal(0.0, 4.0, (90, 90))
    filtered = restored(np.rint(flat).astype(np.uint8), by).astype(float)
    assert filtered.mean() == pytest.approx(128.0, abs=0.5)
    # 8100 numbers, of which neighbours depend on each other: their deviation is known to 3 % or so.
    assert filtered[12:-12, 12:-12].std() == pytest.approx(4.0 * noise_gain(by), rel=0.15)


@pytest.mark.parametrize(("blur_px", "noise_grey"), CAMERAS)
def test_what_is_restored_is_nearer_to_what_the_lens_has_blurred(
    target: TargetModel, blur_px: float, noise_grey: float
) -> None:
    """By the mean square of all pixels of tags, noise included."""
    frame, rng, by = target.camera.frame, np.random.default_rng(2), restoring_filter(blur_px, noise_grey)
    assert by is not None
    for x in (-0.3, -0.5):
        sharp = draw(SE2(x, 0.02, 0.1), frame)
        tags = cv2.dilate((sharp != sharp[0, 0]).astype(np.uint8), np.ones((5, 5))) > 0
        blurred = seen(sharp, blur_px, noise_grey, rng)
        before, after = (
            np.mean((image.astype(float) - sharp)[tags] ** 2) for image in (blurred, restored(blurred, by))
        )
        assert after < 0.9 * before


@pytest.mark.parametrize(
    ("plain", "blur_px", "noise_grey", "least_m"),
    [
        (PupilDetector(), 1.13, 8.0, 0.9),
        pytest.param(PupilDetector(), 1.6, 16.0, 0.6, marks=pytest.mark.nightly),
        pytest.param(ArucoDetector(refine=True), 1.13, 8.0, 0.6, marks=pytest.mark.nightly),
        (ArucoDetector(refine=True), 1.6, 16.0, 0.4),
    ],
)
def test_twice_as_many_tags_are_read_and_their_corners_are_measured_as_before(
    target: TargetModel, plain: RefiningDetector, blur_px: float, noise_grey: float, least_m: float
) -> None:
    """In 24 views of three tags from where some can no longer be read without the filter; none is wrong."""
    middle, rng = Window(160, 120, 320, 240), np.random.default_rng(3)
    detector, as_it_is = for_camera(plain, target.lens, blur_px, noise_grey), plain.for_blur(blur_px)
    before, after, errors = 0, 0, list[list[np.ndarray]]()
    for _ in range(24):
        X_DU = SE2(-rng.uniform(least_m, least_m + 0.2), *rng.normal(0.0, [0.02, 0.1]))
        image = seen(draw(X_DU, middle), blur_px, noise_grey, rng)
        old = {tag.tag_id: tag.corners for tag in as_it_is.detect(image, middle)}
        new = {tag.tag_id: tag.corners for tag in detector.detect(image, middle)}
        assert new.keys() <= set(target.port_tags)
        for tag in old.keys() & new.keys():
            _, true = project(target, pose_vector(X_DU), target.corners_D[tag])
            errors.append([old[tag] - true, new[tag] - true])
        before, after = before + len(old), after + len(new)
    assert after > max(2 * before, 24), (before, after)
    rms_old, rms_new = np.sqrt(np.mean(np.square(errors or np.ones((1, 2, 4, 2))), axis=(0, 2, 3)))
    print(before, after, len(errors), rms_old, rms_new)
    assert rms_new <= 1.15 * rms_old


def test_a_camera_that_is_sharp_is_read_as_it_is() -> None:
    assert restoring_filter(0.8, 8.0) is None
    sharp = PupilDetector().for_blur(0.8)
    assert sharp.for_noise(2.0) is sharp
    assert restoring_filter(20.0, 8.0) is not None  # as much blur as a scene may have
