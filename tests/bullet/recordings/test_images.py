"""Raw images of ROS in the encodings in which cameras deliver them."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from msrr_bullet.recordings.images import pixels_of

GREY = np.random.default_rng(3).integers(0, 256, (18, 24), dtype=np.uint8)
#: Colour of every second pixel in the encodings of two bytes a pixel, of which no grey level depends.
CHROMA = np.full_like(GREY, 77)


@pytest.mark.parametrize(
    ("encoding", "image"),
    [
        ("mono8", GREY),
        ("mono16", GREY.astype("<u2") * 257),
        ("bgr8", np.stack([GREY] * 3, axis=2)),
        ("rgb16", np.stack([GREY.astype("<u2") * 257] * 3, axis=2)),
        ("yuv422", np.stack([CHROMA, GREY], axis=2)),
        ("uyvy", np.stack([CHROMA, GREY], axis=2)),
        ("yuv422_yuy2", np.stack([GREY, CHROMA], axis=2)),
        ("yuyv", np.stack([GREY, CHROMA], axis=2)),
    ],
)
def test_grey_levels_are_those_of_the_camera(encoding: str, image: np.ndarray) -> None:
    height, width = GREY.shape
    step = image.nbytes // height
    message = SimpleNamespace(data=image.tobytes(), encoding=encoding, width=width, height=height, step=step)
    pixels = pixels_of(message, "image")
    # The brightest pixel in a thousand may be cut off, and others round.
    assert np.abs(pixels.astype(int) - GREY).max() <= 1
