"""Whole frames: windows come back exactly by cropping, and the files are PNG to any reader."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from msrr_bullet.log import LogError
from msrr_bullet.log.foxglove import compressed_image
from msrr_bullet.log.frames import UNREAD, FrameComposer, LoggedFrame
from msrr_scenes.geometry.pinhole import Window

SIZE = Window(0, 0, 90, 60)


@st.composite
def windows(draw: st.DrawFn) -> list[Window]:
    found = []
    for _ in range(draw(st.integers(0, 4))):
        x, y = draw(st.integers(0, SIZE.width - 1)), draw(st.integers(0, SIZE.height - 1))
        width, height = draw(st.integers(1, SIZE.width - x)), draw(st.integers(1, SIZE.height - y))
        found.append(Window(x, y, width, height))
    return found


@settings(deadline=None, derandomize=True)
@given(frames=st.lists(windows(), min_size=1, max_size=3), seed=st.integers(0, 99))
def test_a_frame_shows_what_was_read_and_nothing_else(frames: list[list[Window]], seed: int) -> None:
    composer, rng = FrameComposer(SIZE), np.random.default_rng(seed)
    for read in frames:
        truth = rng.integers(0, 256, (SIZE.height, SIZE.width), dtype=np.uint8)
        expected = np.full_like(truth, UNREAD)
        for w in read:
            expected[w.y : w.y_end, w.x : w.x_end] = truth[w.y : w.y_end, w.x : w.x_end]
        png = composer.png([(w, truth[w.y : w.y_end, w.x : w.x_end]) for w in read])
        decoded = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_UNCHANGED)
        assert np.array_equal(decoded, expected)
        frame = LoggedFrame(compressed_image(5, "a/onboard", png).encode())
        for w in read:
            assert np.array_equal(frame.crop(w), truth[w.y : w.y_end, w.x : w.x_end])


def test_what_a_frame_does_not_hold_is_refused() -> None:
    frame = LoggedFrame(FrameComposer(SIZE).png([]))
    for outside in (Window(-1, 0, 5, 5), Window(0, 56, 5, 5)):
        with pytest.raises(LogError, match="outside of its frame of 90 x 60 pixels"):
            frame.crop(outside)
    for damaged in (b"no image", b"\x89PNG\r\n\x1a\n and no more"):
        with pytest.raises(LogError, match="not a PNG file"):
            LoggedFrame(damaged).crop(SIZE)
