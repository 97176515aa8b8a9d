"""Recorder in memory."""

from __future__ import annotations

import numpy as np

from msrr_bullet.log import CameraWindow, MemoryRecorder
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.messages import Exposure


def test_pixels_are_copied() -> None:
    recorder, buffer = MemoryRecorder(), np.full((4, 5), 7, dtype=np.uint8)
    recorder.window(Exposure("a/onboard", 3, 40), Window(1, 2, 5, 4), buffer)
    buffer[:] = 0
    ((topic, stamp_ns, message),) = recorder.messages
    assert (topic, stamp_ns) == ("/camera/a/onboard/window", 40)
    assert isinstance(message, CameraWindow)
    assert (message.pixels == 7).all()
