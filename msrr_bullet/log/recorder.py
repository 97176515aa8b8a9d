"""What the loop writes to, without knowing whether or where it is kept."""

from __future__ import annotations

from types import TracebackType
from typing import Protocol

from msrr_bullet.log.records import CameraWindow
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.messages import Exposure, Pixels


class Recorder(Protocol):
    """Takes messages in the order in which they happen. That order is part of the log."""

    def write(self, topic: str, stamp_ns: int, message: object) -> None:
        """Record a message.

        Args:
            topic: One of :mod:`msrr_bullet.log.topics`.
            stamp_ns: Simulated time at which it happened or arrived. (A measurement's own stamp is its
                exposure's.)
            message: A message of :mod:`msrr_scenes.messages` or of :mod:`msrr_bullet.log.records`.

        Raises:
            LogError: The log cannot be written; the error names the file.
            UnknownNameError: No log holds messages of this type.
        """
        ...

    def window(self, exposure: Exposure, window: Window, pixels: Pixels) -> None:
        """Record the pixels, shape (height, width), that were read from a window of an exposure."""
        ...

    def close(self) -> None:
        """Finish the log. Closing twice does nothing."""
        ...


class NullRecorder:
    """Keeps nothing: what a trial of a sweep writes to."""

    def write(self, topic: str, stamp_ns: int, message: object) -> None:
        """Do nothing."""

    def window(self, exposure: Exposure, window: Window, pixels: Pixels) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Do nothing."""

    def __enter__(self) -> NullRecorder:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Do nothing."""


class MemoryRecorder:
    """Keeps the messages in a list, in order: for tests and notebooks."""

    def __init__(self) -> None:
        self.messages: list[tuple[str, int, object]] = []

    def write(self, topic: str, stamp_ns: int, message: object) -> None:
        """Append (topic, stamp, message)."""
        self.messages.append((topic, stamp_ns, message))

    def window(self, exposure: Exposure, window: Window, pixels: Pixels) -> None:
        """Append a copy of the pixels as a :class:`CameraWindow`."""
        from msrr_bullet.log import topics

        record = CameraWindow(exposure, window, pixels.copy())
        self.write(topics.window(exposure.camera), exposure.stamp_ns, record)

    def close(self) -> None:
        """Do nothing."""
