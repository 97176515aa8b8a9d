"""The metrics of tag detection count what is found, what is false and what was not looked for."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from msrr_bullet.bench.detection_metrics import (
    Candidate,
    DetectionRow,
    FullFrameReader,
    LabelledExposure,
    RecordingDetector,
    evaluate,
)
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.messages import Detections, Exposure, Pixels, TagDetection

SQUARE = np.array([[40.0, 56.0], [56.0, 56.0], [56.0, 40.0], [40.0, 40.0]])
FRAME = Window(0, 0, 96, 96)


class FixedDetector:
    """A detector that always finds the same tags."""

    def __init__(self, *tags: TagDetection) -> None:
        self.tags = tags

    def detect(self, pixels: Pixels, window: Window) -> tuple[TagDetection, ...]:
        return self.tags


def moved(dx: float, dy: float) -> Array:
    shifted: Array = SQUARE + np.array([dx, dy])
    return shifted


def evaluated(*tags: TagDetection, frame: Window = FRAME) -> DetectionRow:
    """Let a detector that finds ``tags`` read ``frame`` three times; tag 1 is in view, tag 2 is beside it."""

    def views() -> Iterator[LabelledExposure[None]]:
        for number in range(3):
            yield LabelledExposure(
                exposure=Exposure("camera", number, number),
                fetch=lambda window: np.zeros((window.height, window.width), np.uint8),
                prediction=None,
                corners={1: SQUARE, 2: moved(0.0, 30.0)},
                in_view=frozenset({1}),
                pose_errors=lambda found: [(0.002, 0.1)] * len(found.tags),
                first=number == 0,
            )

    recording = RecordingDetector(FixedDetector(*tags))
    candidate = Candidate(FullFrameReader(recording, frame), recording)
    (row,) = evaluate({"all": candidate}, views(), np.random.default_rng(0))
    return row


def test_errors_are_the_detectors_own() -> None:
    row = evaluated(TagDetection(1, moved(0.3, -0.4)))
    assert (row.exposures, row.recall.rate, row.tags, row.false, row.poseless) == (3, 1.0, 1.0, 0, 0)
    assert row.bias_px == pytest.approx((0.3, -0.4))
    assert row.rms_px == pytest.approx(np.sqrt((0.3**2 + 0.4**2) / 2))
    assert row.distance_mm.p95 == pytest.approx(2.0)
    assert row.pixels == FRAME.area


def test_a_tag_elsewhere_or_nowhere_is_false() -> None:
    astray = evaluated(TagDetection(1, moved(4.0, 4.0)), TagDetection(77, SQUARE))
    assert (astray.false, astray.recall.rate, astray.rms_px) == (6, 0.0, None)
    blind = evaluated()
    assert (blind.false, blind.poseless, blind.recall.rate) == (0, 3, 0.0)


def test_a_tag_beyond_what_must_be_read_may_be_found() -> None:
    row = evaluated(TagDetection(2, moved(0.0, 30.0)))
    assert (row.false, row.tags, row.recall.rate) == (0, 1.0, 0.0)


def test_a_tag_counts_as_looked_for_when_its_white_border_is_in_the_window() -> None:
    """The border of a 16 px tag is 2 px wide: the window from column 38 holds it, that from 39 does not."""
    held, cut = (evaluated(frame=Window(x, 30, 40, 40)) for x in (38, 39))
    assert (held.recall.low, held.recall.high < 1.0) == (0.0, True)
    assert (cut.recall.low, cut.recall.high) == (0.0, 1.0)


def test_a_whole_frame_is_one_window() -> None:
    recording = RecordingDetector(FixedDetector())
    seen = FullFrameReader(recording, FRAME).detect(
        Exposure("camera", 0, 0), None, lambda w: np.zeros((96, 96), np.uint8)
    )
    assert isinstance(seen, Detections)
    assert seen.windows == tuple(recording.windows) == (FRAME,)
