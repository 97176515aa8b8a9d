from __future__ import annotations

import math
import weakref
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from pupil_apriltags import bindings

from msrr_perception.detection import native_apriltag
from msrr_perception.detection.detector import (
    DETECTORS,
    PupilDetector,
    adapted,
    default_search_detector,
    detectors_by_size,
)
from msrr_perception.detection.native_apriltag import (
    EDGE_TO_CENTRE_PX,
    LIBRARY_BITS,
    DetectorError,
    NativeSettings,
)
from msrr_perception.detection.windows import ExpectedTag
from msrr_perception.pose.target import TargetModel, pose_vector
from msrr_scenes.errors import ParameterError
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import Pixels, TagDetection
from msrr_scenes.registry import build, resolve
from msrr_scenes.specs.spec import Choice
from tests.perception.conftest import draw, plate, project, warp


@pytest.mark.nightly
def test_corners_are_unbiased_over_many_views(target: TargetModel) -> None:
    """Mean signed residual below 0.05 px, RMS below 0.35 px, as for the rendered cameras."""
    rng = np.random.default_rng(1)
    detector, residuals = PupilDetector(), []
    for _ in range(24):
        X = SE2(-rng.uniform(0.25, 0.75), rng.uniform(-0.1, 0.1), rng.uniform(-0.2, 0.2))
        window = target.camera.frame
        for tag in detector.detect(draw(X, window), window):
            residuals.append(tag.corners - project(target, pose_vector(X), target.corners_D[tag.tag_id])[1])
    residual = np.concatenate(residuals)
    assert len(residuals) > 60
    assert np.abs(residual.mean(axis=0)).max() < 0.05
    assert np.sqrt((residual**2).mean(axis=0)).max() < 0.35


def test_a_window_gives_full_frame_corners(target: TargetModel) -> None:
    X, detector, frame = SE2(-0.5, 0.02, 0.05), PupilDetector(), target.camera.frame
    image = draw(X, frame)
    full = {t.tag_id: t.corners for t in detector.detect(image, frame)}
    assert set(full) == set(target.port_tags)
    for tag, corners in full.items():
        x, y = (np.floor((corners.min(axis=0) - 16) / 4) * 4).astype(int)
        window = Window(int(x), int(y), 96, 96)
        crop = image[window.y : window.y_end, window.x : window.x_end]
        alone = {t.tag_id: t.corners for t in detector.detect(crop, window)}
        np.testing.assert_allclose(alone[tag], corners, atol=0.35)


@pytest.mark.parametrize(
    "noise_grey", [8.0, *(pytest.param(grey, marks=pytest.mark.nightly) for grey in (16.0, 33.0)), 45.0]
)
def test_a_detector_for_noise_finds_the_same_tags_with_the_same_corners(
    target: TargetModel, noise_grey: float
) -> None:
    frame, noise = target.camera.frame, np.random.default_rng(5)
    plain, noisy = PupilDetector(), PupilDetector().for_noise(noise_grey)
    found = 0
    for x in (-0.3, -0.5, -0.8):
        image = draw(SE2(x, 0.02, 0.1), frame) + noise.normal(0.0, noise_grey, (frame.height, frame.width))
        image = np.clip(np.rint(image), 0, 255).astype(np.uint8)
        expected, here = plain.detect(image, frame), noisy.detect(image, frame)
        assert [t.tag_id for t in here] == [t.tag_id for t in expected]
        assert all(np.array_equal(a.corners, b.corners) for a, b in zip(here, expected, strict=True))
        found += len(here)
    assert found >= 6


def test_noise_alone_hardly_ever_has_the_contrast_that_the_search_asks_for() -> None:
    """The range of the 144 pixels of a tile and its neighbours: 115 of 20000 draws exceed it."""
    detector = PupilDetector().for_noise(10.0)
    assert isinstance(detector, PupilDetector)
    pixels = np.random.default_rng(6).normal(0.0, 10.0, (20_000, 144))
    passed = np.count_nonzero(np.ptp(pixels, axis=1) > detector.settings.min_white_black_diff)
    assert 0 < passed < 0.01 * len(pixels)


def test_a_contrast_is_kept_that_is_given_or_beyond_the_noise() -> None:
    given = PupilDetector(min_white_black_diff=10)
    assert given.for_noise(20.0) is given
    for detector in (PupilDetector(), default_search_detector()):
        contrast = detector.for_noise(16.0).settings.min_white_black_diff
        assert contrast == 112
        assert detector.for_noise(16.0).for_large_tags().settings.min_white_black_diff == contrast
    quiet = PupilDetector()
    assert quiet.for_noise(4.0) is quiet


def test_a_thread_has_one_native_detector_until_it_ends(target: TargetModel) -> None:
    window = Window(200, 120, 240, 200)
    image = draw(SE2(-0.5, 0.0, 0.0), window)
    natives: list[weakref.ref[object]] = []

    def count(_: int) -> set[int]:
        found = {len(PupilDetector(quad_decimate=1.0 + (i % 2)).detect(image, window)) for i in range(20)}
        natives.extend(weakref.ref(native_apriltag._native_detector("tag36h11", 2)) for _ in range(2))
        return found

    with ThreadPoolExecutor(2) as threads:
        assert list(threads.map(count, range(8))) == [{3}] * 8
        assert len({id(native()) for native in natives}) <= 2
    assert {native() for native in natives} == {None}


def test_settings_reach_the_native_detector() -> None:
    window = Window(0, 0, 120, 120)
    square = np.array([[30.0, 90.0], [90.0, 90.0], [90.0, 30.0], [30.0, 30.0]])
    sharp = warp(window, [(plate(3), square)]).astype(float)
    faint = (130 + 0.12 * (sharp - 128)).astype(np.uint8)  # 30 grey levels of contrast
    assert len(PupilDetector(min_white_black_diff=10, min_decision_margin=2.0).detect(faint, window)) == 1
    assert PupilDetector(min_white_black_diff=60, min_decision_margin=2.0).detect(faint, window) == ()
    assert PupilDetector(min_white_black_diff=10, min_decision_margin=200.0).detect(faint, window) == ()


@pytest.mark.parametrize("decimate", [1.0, 2.0])
@pytest.mark.parametrize("blur", [0.0, 0.8])
def test_the_wrapper_would_say_the_same(target: TargetModel, decimate: float, blur: float) -> None:
    """Bit for bit, on pixels that are left as they were."""
    frame = draw(SE2(-0.5, 0.02, 0.1), target.camera.frame)
    before = frame.copy()
    ours = native_apriltag.detect(frame, "tag36h11", NativeSettings(decimate, blur, 1.0, 5), LIBRARY_BITS)
    wrapper = bindings.Detector("tag36h11", quad_decimate=decimate, quad_sigma=blur, decode_sharpening=1.0)
    theirs = wrapper.detect(frame)
    wrapper.tag_detector_ptr = None  # never freed, because freeing one detector may crash another
    np.testing.assert_array_equal(frame, before)
    assert len(ours) == len(theirs) == len(target.port_tags)
    for a, b in zip(ours, theirs, strict=True):
        assert (a.tag_id, a.hamming, a.decision_margin) == (b.tag_id, b.hamming, b.decision_margin)
        np.testing.assert_array_equal(a.corners, b.corners - EDGE_TO_CENTRE_PX)


@pytest.mark.parametrize("views", [12, pytest.param(40, marks=pytest.mark.nightly)])
def test_less_resolution_gives_the_same_corners_of_large_tags(target: TargetModel, views: int) -> None:
    """Views with noise: no tag missed, corners a few hundredths of a pixel apart at most.

    A detector that misses one of ten tags passes 12 views of three large tags each in 2 % of all cases.
    """
    rng, whole = np.random.default_rng(4), PupilDetector()
    *by_size, (least_px, last) = detectors_by_size(whole)
    assert (least_px, last) == (0.0, whole)
    assert [px / d.settings.quad_decimate for px, d in by_size] == [10.0, 10.0, 10.0]
    for _ in range(views):
        window = target.camera.frame
        pixels = draw(SE2(rng.uniform(-0.5, -0.25), *rng.normal(0.0, [0.02, 0.1])), window)
        noisy = np.clip(pixels + rng.normal(0.0, 2.0, pixels.shape), 0, 255).astype(np.uint8)
        tags = whole.detect(noisy, window)
        for least_px, detector in by_size:
            found = {t.tag_id: t.corners for t in detector.detect(noisy, window)}
            for tag in tags:
                if ExpectedTag(tag.tag_id, tag.corners, tag.corners).upright_edge >= least_px:
                    np.testing.assert_allclose(found[tag.tag_id], tag.corners, atol=0.05)


def test_turned_tags_are_found_at_less_resolution_when_they_are_just_large_enough() -> None:
    """A detector that misses one in twenty of them passes 60 views in 5 % of all cases."""
    rng, (*by_size, _) = np.random.default_rng(5), detectors_by_size(PupilDetector())
    for least_px, detector in by_size:
        for angle in rng.uniform(0.0, math.pi, 20):
            c, s = math.cos(angle), math.sin(angle)
            half = 0.51 * least_px * (abs(c) + abs(s))
            size = 4 * math.ceil(0.75 * half + 7.0)
            square = half * np.array([[-1.0, 1.0], [1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]])
            corners = square @ np.array([[c, s], [-s, c]]) + 0.5 * size + rng.uniform(-2.0, 2.0, 2)
            assert ExpectedTag(7, corners, corners).upright_edge == pytest.approx(1.02 * least_px)
            window = Window(0, 0, size, size)
            pixels = warp(window, [(plate(7), corners)])
            noisy = np.clip(pixels + rng.normal(0.0, 4.0, pixels.shape), 0, 255).astype(np.uint8)
            (found,) = detector.detect(noisy, window)
            np.testing.assert_allclose(found.corners, corners, atol=0.5)


def test_the_search_finds_tags_of_every_size_at_any_angle_in_poor_light() -> None:
    """A detector that misses one in twenty of them passes 60 views in 5 % of all cases."""
    rng, frame = np.random.default_rng(6), Window(0, 0, 100, 80)
    square = np.array([[-0.5, 0.5], [0.5, 0.5], [0.5, -0.5], [-0.5, -0.5]])
    for edge in (14.0, 20.0, 27.0, 29.0, 45.0):  # at half the resolution from 28 px on
        detector = default_search_detector(smallest_px=edge, noise_grey=2.0)
        for angle in rng.uniform(0.0, math.pi, 12):
            turn = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
            corners = edge * square @ turn + [50.0, 40.0] + rng.uniform(-2.0, 2.0, 2)
            dark = 0.25 * warp(frame, [(plate(7), corners)]) + 20.0  # 60 grey levels of contrast
            noisy = np.clip(dark + rng.normal(0.0, 2.0, dark.shape), 0, 255).astype(np.uint8)
            assert [tag.tag_id for tag in detector.detect(noisy, frame)] == [7]


def test_large_tags_are_read_as_all_others_without_refinement_or_at_half_the_resolution() -> None:
    for plain in (PupilDetector(refine=False), PupilDetector(quad_decimate=2.0)):
        assert {detector for _, detector in detectors_by_size(plain)} == {plain}
    assert adapted(Blind(1), "for_large_tags").detect(np.zeros((9, 9), np.uint8), Window(0, 0, 9, 9)) == ()


def test_an_empty_or_tiny_window_holds_nothing() -> None:
    assert PupilDetector().detect(np.full((80, 80), 128, np.uint8), Window(4, 8, 80, 80)) == ()
    assert PupilDetector().detect(np.zeros((4, 40), np.uint8), Window(0, 0, 40, 4)) == ()


def test_a_crop_that_is_not_contiguous_is_read_right(target: TargetModel) -> None:
    frame, window = target.camera.frame, Window(201, 123, 239, 197)
    image = draw(SE2(-0.5, 0.0, 0.0), frame)
    view = image[window.y : window.y_end, window.x : window.x_end]
    a, b = (PupilDetector().detect(p, window) for p in (view, view.copy()))
    assert len(a) == 3
    assert all(np.array_equal(s.corners, t.corners) for s, t in zip(a, b, strict=True))


def test_misuse_is_named() -> None:
    with pytest.raises(DetectorError, match="do not fill a window"):
        PupilDetector().detect(np.zeros((10, 12), np.uint8), Window(0, 0, 10, 12))
    for wrong in (
        {"quad_decimate": 0.5},
        {"quad_sigma": -1.0},
        {"min_white_black_diff": 0},
        {"quad_decimate": None},
    ):
        with pytest.raises(ParameterError, match="has to be a number"):
            PupilDetector(**wrong)


class Blind:
    """An own detector, named by its import path."""

    def __init__(self, tag: int = 0) -> None:
        self.tag = tag

    def detect(self, pixels: Pixels, window: Window) -> tuple[TagDetection, ...]:
        return ()


def test_a_detector_is_named_in_the_scene() -> None:
    detector = build("detector", Choice(name="pupil", params={"quad_decimate": 2.0}), DETECTORS)
    assert isinstance(detector, PupilDetector)
    assert resolve("detector", "msrr_perception.detection.detector:PupilDetector", DETECTORS) is PupilDetector
