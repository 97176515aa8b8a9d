"""Recorders of messages: the interface that a trial writes to, and the two that write no file."""

from __future__ import annotations

from typing import Protocol

from msrr_bullet.log import topics
from msrr_bullet.log.records import CameraWindow
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.messages import Exposure, Pixels


class Recorder(Protocol):
    """Recorder of messages. The order in which it receives them is part of the log."""

    def write(self, topic: str, stamp_ns: int, message: object) -> None:
        """Record a message.

        Args:
            topic: One of :mod:`msrr_bullet.log.topics`.
            stamp_ns: Simulated time at which the message was sent or arrived. The stamp inside a measurement
                is its time of exposure.
            message: Message of :mod:`msrr_scenes.messages` or of :mod:`msrr_bullet.log.records`.

        Raises:
            LogError: The log cannot be written. The error names the file.
            UnknownNameError: Logs hold no messages of this type.
        """

    def window(self, exposure: Exposure, window: Window, pixels: Pixels) -> None:
        """Record the pixels, shape (height, width), that were read from a window of an exposure."""

    def close(self) -> None:
        """Finish the log. A second call does nothing."""


class NullRecorder:
    """Recorder that discards everything, for the trials of a sweep."""

    def write(self, topic: str, stamp_ns: int, message: object) -> None:
        """Do nothing."""

    def window(self, exposure: Exposure, window: Window, pixels: Pixels) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Do nothing."""


class MemoryRecorder:
    """Recorder that keeps the messages in a list, for tests and notebooks."""

    def __init__(self) -> None:
        self.messages: list[tuple[str, int, object]] = []

    def write(self, topic: str, stamp_ns: int, message: object) -> None:
        """Append (topic, stamp, message)."""
        self.messages.append((topic, stamp_ns, message))

    def window(self, exposure: Exposure, window: Window, pixels: Pixels) -> None:
        """Append a copy of the pixels as a :class:`CameraWindow`."""
        record = CameraWindow(exposure, window, pixels.copy())
        self.write(topics.window(exposure.camera), exposure.stamp_ns, record)

    def close(self) -> None:
        """Do nothing."""
