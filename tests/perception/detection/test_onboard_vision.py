from __future__ import annotations

import numpy as np
import pytest

from msrr_perception.detection.detector import PupilDetector
from msrr_perception.detection.onboard_vision import OnboardVision
from msrr_perception.pose.target import TargetModel
from msrr_scenes.arrays import frozen
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import Detections, Exposure, Fetch, Pixels, PoseEstimate, TagDetection
from tests.perception.conftest import draw

TRUE = SE2(-0.5, 0.02, 0.05)


@pytest.fixture
def fetch() -> Fetch:
    return lambda window: draw(TRUE, window)


@pytest.fixture
def vision(target: TargetModel) -> OnboardVision:
    return OnboardVision(target, PupilDetector())


def _prediction(X: SE2, sigma: float = 0.002) -> PoseEstimate:
    return PoseEstimate(0, X, frozen(sigma**2 * np.eye(3)), 0)


def _exposure(frame: int) -> Exposure:
    return Exposure("a/onboard", frame, frame * 40_000_000)


def _ids(found: Detections) -> tuple[int, ...]:
    return tuple(t.tag_id for t in found.tags)


def test_knowing_nothing_it_looks_at_the_full_frame(
    target: TargetModel, vision: OnboardVision, fetch: Fetch
) -> None:
    found = vision.detect(_exposure(1), None, fetch)
    assert found.windows == (target.camera.frame,)
    assert _ids(found) == target.port_tags
    assert found.exposure == _exposure(1)
    for tag in found.tags:  # which all who get the message share
        assert tag.corner_sigma_px is not None
        assert not tag.corners.flags.writeable
        assert not tag.corner_sigma_px.flags.writeable
    vague = vision.detect(_exposure(2), _prediction(TRUE, 0.5), fetch)
    assert vague.windows == (target.camera.frame,)


@pytest.mark.parametrize("give", [lambda window: None, lambda window: np.zeros((4, 4), dtype=np.uint8)])
def test_what_is_no_window_of_grey_levels_is_refused(vision: OnboardVision, give: Fetch) -> None:
    """The driver of a real camera may have nothing to give, a part of it, or colours."""
    with pytest.raises(ValueError, match=r"shape \(480, 640\) and type uint8 are needed"):
        vision.detect(_exposure(1), None, give)


def test_a_good_prediction_costs_a_window_and_gives_full_frame_corners(
    target: TargetModel, vision: OnboardVision, fetch: Fetch
) -> None:
    full = vision.detect(_exposure(1), None, fetch)
    found = vision.detect(_exposure(2), _prediction(TRUE), fetch)
    assert len(found.windows) == 1
    assert found.windows[0].area < 0.06 * target.camera.frame.area
    assert _ids(found) == _ids(full)
    for a, b in zip(found.tags, full.tags, strict=True):
        np.testing.assert_allclose(a.corners, b.corners, atol=0.05)


def test_a_slightly_wrong_prediction_is_mended_in_a_larger_window(
    target: TargetModel, vision: OnboardVision
) -> None:
    X = SE2(-0.2, 0.0, 0.0)
    wrong = _prediction(X @ SE2(0.0, 0.0, 0.08), 1e-4)  # 33 px
    found = vision.detect(_exposure(1), wrong, lambda window: draw(X, window))
    assert len(found.windows) > 1
    assert target.camera.frame not in found.windows
    assert _ids(found)


def test_a_quite_wrong_prediction_ends_at_the_full_frame(
    target: TargetModel, vision: OnboardVision, fetch: Fetch
) -> None:
    found = vision.detect(_exposure(1), _prediction(TRUE @ SE2(0.0, 0.0, 0.4)), fetch)
    assert found.windows[-1] == target.camera.frame
    assert len(found.windows) > 1
    assert _ids(found) == target.port_tags


def test_an_empty_scene_is_searched_in_full_each_frame(target: TargetModel, vision: OnboardVision) -> None:
    def grey(window: Window) -> Pixels:
        return np.full((window.height, window.width), 100, np.uint8)

    first = vision.detect(_exposure(1), _prediction(TRUE), grey)
    assert first.tags == ()
    for frame in range(2, 6):
        found = vision.detect(_exposure(frame), _prediction(TRUE), grey)
        assert found.tags == ()
        assert found.windows == (target.camera.frame,)


def test_routine_looks_come_every_so_many_frames(target: TargetModel, fetch: Fetch) -> None:
    vision = OnboardVision(target, PupilDetector(), full_every=4)
    full = [
        f
        for f in range(12)
        if vision.detect(_exposure(f), _prediction(TRUE), fetch).windows == (target.camera.frame,)
    ]
    assert full == [0, 4, 8]
    always = OnboardVision(target, PupilDetector(), full_every=1)
    assert always.detect(_exposure(3), _prediction(TRUE), fetch).windows == (target.camera.frame,)


def test_looking_away_it_searches_now_and_then(target: TargetModel, fetch: Fetch) -> None:
    vision = OnboardVision(target, PupilDetector())
    away = _prediction(SE2(-0.5, 0.0, 2.5))
    looks = [f for f in range(1, 16) if vision.detect(_exposure(f), away, fetch).windows]
    assert looks == [5, 10, 15]


def test_a_hidden_tag_is_left_alone_for_a_while(target: TargetModel) -> None:
    """The left tag is painted over; the others go on, and it is asked for again now and then."""
    X = SE2(-0.16, 0.0, 0.0)
    hidden = target.port_tags[0]
    at = {t: i for i, t in enumerate(target.port_tags)}
    vision = OnboardVision(target, PupilDetector())
    asked = []

    def covered(window: Window) -> Pixels:
        picture = draw(X, window).copy()
        left = max(0, 300 - window.x)
        picture[:, :left] = 100  # everything left of column 300
        return picture

    for frame in range(1, 30):
        found = vision.detect(_exposure(frame), _prediction(X, 5e-4), covered)
        assert hidden not in _ids(found)
        asked.append(any(w.x < 200 and w != target.camera.frame for w in found.windows))
    assert at[hidden] == 0
    assert 2 <= sum(asked) < 0.5 * len(asked)  # some frames ask for it, most do not


def test_the_same_calls_give_the_same_windows_and_corners(target: TargetModel, fetch: Fetch) -> None:
    runs = []
    for _ in range(2):
        vision = OnboardVision(target, PupilDetector())
        looks = [
            vision.detect(_exposure(f), _prediction(TRUE) if f > 1 else None, fetch) for f in range(1, 6)
        ]
        runs.append([(look.windows, [t.corners.tobytes() for t in look.tags]) for look in looks])
    assert runs[0] == runs[1]


class Watched:
    """A detector that counts its calls and, at half the resolution, overlooks a tag."""

    def __init__(self, overlooked: int | None = None) -> None:
        self._whole, self._half = PupilDetector(), PupilDetector().for_large_tags()
        self.overlooked = overlooked
        self.calls = {"whole": 0, "half": 0}

    def detect(self, pixels: Pixels, window: Window) -> tuple[TagDetection, ...]:
        self.calls["whole"] += 1
        return self._whole.detect(pixels, window)

    def for_large_tags(self) -> Half:
        return Half(self)

    def at_half(self, pixels: Pixels, window: Window) -> tuple[TagDetection, ...]:
        self.calls["half"] += 1
        return tuple(t for t in self._half.detect(pixels, window) if t.tag_id != self.overlooked)


class Half:
    def __init__(self, watched: Watched) -> None:
        self._watched = watched

    def detect(self, pixels: Pixels, window: Window) -> tuple[TagDetection, ...]:
        return self._watched.at_half(pixels, window)


@pytest.mark.parametrize(("x", "large"), [(-0.3, True), (-0.9, False)])
def test_large_tags_are_searched_at_half_the_resolution(target: TargetModel, x: float, large: bool) -> None:
    X, detector = SE2(x, 0.01, 0.0), Watched()
    vision = OnboardVision(target, detector)
    found = vision.detect(_exposure(1), _prediction(X, 1e-4), lambda window: draw(X, window))
    assert _ids(found) == target.port_tags
    assert (detector.calls["half"] > 0) == large
    assert (detector.calls["whole"] > 0) == (not large)


@pytest.mark.parametrize("frame", [1, 100])
def test_a_tag_that_half_the_resolution_overlooks_is_found_in_the_same_pixels(
    target: TargetModel, frame: int
) -> None:
    """In windows, and in the full frame that is read every 100 frames."""
    X, detector = SE2(-0.3, 0.01, 0.0), Watched(overlooked=target.port_tags[0])
    vision, fetched = OnboardVision(target, detector), []

    def fetch(window: Window) -> Pixels:
        fetched.append(window)
        return draw(X, window)

    found = vision.detect(_exposure(frame), _prediction(X, 1e-4), fetch)
    assert _ids(found) == target.port_tags
    assert detector.calls["whole"] == detector.calls["half"] == len(fetched)
    assert found.windows == tuple(fetched)


def test_a_driver_may_take_the_next_picture_into_the_same_place(target: TargetModel) -> None:
    """Detectors must not write into a picture; whoever took it does, with the next one."""
    seen: list[Pixels] = []

    class Watching(PupilDetector):
        def detect(self, pixels: Pixels, window: Window) -> tuple[TagDetection, ...]:
            seen.append(pixels)
            return super().detect(pixels, window)

    camera = target.camera
    place = np.array(draw(TRUE, Window(0, 0, camera.width, camera.height)))
    OnboardVision(target, Watching()).detect(_exposure(0), None, lambda window: place)
    assert seen
    assert not any(pixels.flags.writeable for pixels in seen)
    place[:] = 0
