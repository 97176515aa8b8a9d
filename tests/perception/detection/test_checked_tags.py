"""What a detector of a user's own may return, and what is refused with the mend."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from msrr_perception.detection.checked_tags import checked_tags
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.messages import TagDetection

WINDOW = Window(100, 50, 80, 60)
PIXELS = np.zeros((60, 80), dtype=np.uint8)

#: Bottom left, bottom right, top right, top left of a tag, in pixels of the full frame.
CORNERS = np.array([[110.0, 90.0], [140.0, 92.0], [141.0, 61.0], [109.0, 60.0]])
TAG = TagDetection(7, CORNERS, 50.0, 0)


def test_a_tag_passes_and_its_numbers_become_plain_ones() -> None:
    numpy = TagDetection(np.int64(7), CORNERS.astype(np.float32), np.float32(50.0), np.int8(0))
    (tag,) = checked_tags([numpy], PIXELS, WINDOW)
    assert (type(tag.tag_id), type(tag.decision_margin), type(tag.hamming)) == (int, float, int)
    assert tag.corners.dtype == float
    assert tag.corner_sigma_px is None
    (sure,) = checked_tags([replace(numpy, corner_sigma_px=np.ones(4, np.float32))], PIXELS, WINDOW)
    assert sure.corner_sigma_px is not None
    assert sure.corner_sigma_px.dtype == float
    assert checked_tags((), PIXELS, WINDOW) == ()


@pytest.mark.parametrize("turns", [1, 2, 3])
def test_a_tag_that_lies_turned_passes(turns: int) -> None:
    """A tag may be mounted in any direction, and only a mirrored one cannot be seen."""
    turned = replace(TAG, corners=np.roll(CORNERS, turns, axis=0))
    assert checked_tags((turned,), PIXELS, WINDOW)[0].tag_id == 7


@pytest.mark.parametrize(
    ("result", "why"),
    [
        (None, "None; expected a tuple of TagDetections"),
        (iter(()), "expected a tuple of TagDetections"),
        ((None,), "expected a TagDetection"),
        ((7, CORNERS), "expected a TagDetection"),
        ((replace(TAG, tag_id=-1),), "a tag_id that is a whole number, not negative"),
        ((replace(TAG, tag_id=10**5000),), "a tag_id that is a whole number|digits"),
        ((replace(TAG, hamming=0.5),), "a hamming that is a whole number"),
        ((replace(TAG, decision_margin=np.nan),), "a decision_margin that is a finite number"),
        ((replace(TAG, corner_sigma_px=np.ones(3)),), r"corner_sigma_px of shape \(3,\)"),
        ((replace(TAG, corner_sigma_px=np.array([1.0, 0.0, 1.0, 1.0])),), "positive, finite numbers"),
        (
            (replace(TAG, corners=CORNERS[:3]),),
            r"corners of shape \(3, 2\); expected numbers of shape \(4, 2\)",
        ),
        ((replace(TAG, corners=CORNERS.T),), r"corners of shape \(2, 4\)"),
        ((replace(TAG, corners=np.full((4, 2), "x")),), r"expected numbers of shape \(4, 2\)"),
        ((replace(TAG, corners=np.full((4, 2), np.nan)),), "corners that are finite numbers"),
        (
            (replace(TAG, corners=CORNERS[::-1]),),
            "in the order bottom left, bottom right, top right, top left",
        ),
        ((replace(TAG, corners=CORNERS[[0, 2, 1, 3]]),), "in the order bottom left"),
        ((replace(TAG, corners=np.tile(CORNERS[0], (4, 1))),), "in the order bottom left"),
        ((replace(TAG, corners=CORNERS - [100.0, 50.0]),), "corners in pixels of the full frame, inside"),
    ],
)
def test_what_is_no_tag_is_refused(result: Any, why: str) -> None:
    with pytest.raises(ValueError, match=why):
        checked_tags(result, PIXELS, WINDOW)
