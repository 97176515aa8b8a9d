"""Whole frames of a camera, put together from the windows that were read, as PNG files.

A log holds one image of every exposure, of the size of the camera's frame. What was read lies where it was
read; the rest was never rendered, and is drawn in black. So every window comes back exactly by
cropping, and clients that know nothing of windows show a picture.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Sequence
from functools import cached_property

import cv2
import numpy as np

from msrr_bullet.log.codec import LogError
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.messages import Pixels

#: Key under which the channel of a camera's frames holds the name of the camera.
FRAMES_OF = "frames_of"

#: Grey level of pixels that were not read: black, so that rows of them are zero bytes.
UNREAD = 0

_SIGNATURE = b"\x89PNG\r\n\x1a\n"

#: Modulus of the checksum Adler-32 (RFC 1950).
_ADLER = 65521


class FrameComposer:
    """Puts the frames of one camera together, and keeps their memory and what is the same in many of them.

    Most rows of a frame hold nothing that was read. They are runs of zero bytes, whose compressed form is
    kept by their number, so that the cost goes with the windows and not with the frame.
    """

    def __init__(self, size: Window) -> None:
        """Set up for the full frame ``size``."""
        # Each row of a PNG begins with the number of its filter; 0 is none.
        self._rows = np.zeros((size.height, 1 + size.width), dtype=np.uint8)
        # Width, height, 8 bits, grey levels; compression, filters and order have one method each.
        self._header = _chunk(b"IHDR", struct.pack(">IIBBBBB", size.width, size.height, 8, 0, 0, 0, 0))
        self._blank: dict[int, bytes] = {}

    def png(self, windows: Sequence[tuple[Window, Pixels]]) -> bytes:
        """Return the frame in which ``windows`` were read, each with its pixels of shape (height, width).

        Source: ISO/IEC 15948 (PNG), RFC 1950 (zlib): parts that end with a full flush can be joined.
        """
        for window, pixels in windows:
            self._rows[window.y : window.y_end, window.x + 1 : window.x_end + 1] = pixels
        parts, adler, row = [b"\x78\x01"], 1, 0
        for first, end in _bands(windows):
            parts.append(self._blank_rows(first - row))
            adler = _past_zeros(adler, (first - row) * self._rows.shape[1])
            band = self._rows[first:end].tobytes()
            parts.append(_deflated(band, zlib.Z_FULL_FLUSH))
            adler, row = zlib.adler32(band, adler), end
        left = len(self._rows) - row
        adler = _past_zeros(adler, left * self._rows.shape[1])
        parts += [self._blank_rows(left), _deflated(b"", zlib.Z_FINISH), adler.to_bytes(4, "big")]
        for window, _ in windows:
            self._rows[window.y : window.y_end, window.x + 1 : window.x_end + 1] = UNREAD
        return b"".join([_SIGNATURE, self._header, _chunk(b"IDAT", b"".join(parts)), _chunk(b"IEND", b"")])

    def _blank_rows(self, count: int) -> bytes:
        if count not in self._blank:
            self._blank[count] = _deflated(bytes(count * self._rows.shape[1]), zlib.Z_FULL_FLUSH)
        return self._blank[count]


def _bands(windows: Sequence[tuple[Window, Pixels]]) -> list[tuple[int, int]]:
    """Return the ranges of rows that windows touch, ascending and apart from each other."""
    bands: list[tuple[int, int]] = []
    for first, end in sorted((window.y, window.y_end) for window, _ in windows):
        if bands and first <= bands[-1][1]:
            bands[-1] = bands[-1][0], max(end, bands[-1][1])
        else:
            bands.append((first, end))
    return bands


def _deflated(data: bytes, end: int) -> bytes:
    # The noise of a sensor hardly compresses, so runs of equal bytes are all that is worth looking for.
    stream = zlib.compressobj(1, zlib.DEFLATED, -zlib.MAX_WBITS, zlib.DEF_MEM_LEVEL, zlib.Z_RLE)
    return stream.compress(data) + stream.flush(end)


def _past_zeros(adler: int, count: int) -> int:
    """Return the checksum Adler-32 after ``count`` more zero bytes."""
    low, high = adler & 0xFFFF, adler >> 16
    return (high + low * count) % _ADLER << 16 | low


def _chunk(kind: bytes, data: bytes) -> bytes:
    return b"".join(
        [len(data).to_bytes(4, "big"), kind, data, zlib.crc32(data, zlib.crc32(kind)).to_bytes(4, "big")]
    )


class LoggedFrame:
    """A frame of a log, decoded when its first window is asked for."""

    def __init__(self, message: bytes) -> None:
        """Keep a message ``foxglove.CompressedImage`` in protobuf; the picture in it is a PNG file."""
        self._message = message

    @cached_property
    def pixels(self) -> Pixels:
        """All pixels of the frame.

        Raises:
            LogError: There is no PNG file in the message, or a damaged one.
        """
        start = self._message.find(_SIGNATURE)
        if start < 0:
            raise LogError("an image in the log is not a PNG file")
        return from_png(self._message[start:])

    def crop(self, window: Window) -> Pixels:
        """Return the pixels of a window, shape (height, width).

        Raises:
            LogError: The window is not inside the frame, or the frame is damaged.
        """
        height, width = self.pixels.shape
        if min(window.x, window.y) < 0 or window.x_end > width or window.y_end > height:
            raise LogError(f"{window} lies outside of its frame of {width} x {height} pixels")
        return self.pixels[window.y : window.y_end, window.x : window.x_end]


def from_png(data: bytes) -> Pixels:
    """Return the mono8 pixels of a PNG file.

    Raises:
        LogError: The data are no PNG file.
    """
    pixels = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), cv2.IMREAD_GRAYSCALE)
    if pixels is None:
        raise LogError("an image in the log is not a PNG file")
    return pixels.astype(np.uint8, copy=False)
