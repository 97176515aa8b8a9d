"""The reading of tags from the windows of one exposure."""

from __future__ import annotations

import numpy as np
import pytest

from msrr_perception.detection.detector import PupilDetector
from msrr_perception.detection.frame_reader import FrameReader
from msrr_perception.kernels.lens import NO_LENS
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.messages import Exposure
from tests.perception.conftest import plate, warp

FRAME = Window(0, 0, 320, 160)


def square(x: float) -> np.ndarray:
    return np.array([[x, 98.0], [x + 48.0, 98.0], [x + 48.0, 50.0], [x, 50.0]])


@pytest.mark.parametrize(("clear", "pale"), [(40.0, 200.0), (200.0, 40.0)])
def test_of_two_tags_with_one_id_the_clearer_one_is_found(clear: float, pale: float) -> None:
    """A search found the other one, and the next window was put around it."""
    picture = warp(FRAME, [(plate(7), square(clear))])
    weak = warp(FRAME, [(plate(7), square(pale))]).astype(float)
    half = slice(0, 160) if pale < 160 else slice(160, 320)
    picture[:, half] = (110 + 0.35 * (weak - 110)).astype(np.uint8)[:, half]

    reader = FrameReader(lambda w: picture[w.y : w.y_end, w.x : w.x_end], NO_LENS)
    found = reader.search(FRAME, PupilDetector())
    reader.read([FRAME], PupilDetector())
    (read,) = reader.detections(Exposure("c", 0, 0)).tags
    assert abs(read.corners[:, 0].mean() - clear - 24.0) < 2.0
    np.testing.assert_array_equal(found[7], read.corners)
