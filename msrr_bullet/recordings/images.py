"""Pixels of the image messages of Foxglove and of ROS 2."""

from __future__ import annotations

import base64
import binascii
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from msrr_perception.photographs.picture_files import PictureError, decoded_picture, mono8
from msrr_scenes.messages import Pixels

#: Encodings of raw images: type of a number, numbers in a pixel, and conversion to grey; None is grey.
_ENCODINGS: dict[str, tuple[str, int, int | None]] = {
    "mono8": ("u1", 1, None),
    "8UC1": ("u1", 1, None),
    "mono16": ("u2", 1, None),
    "16UC1": ("u2", 1, None),
    "rgb8": ("u1", 3, cv2.COLOR_RGB2GRAY),
    "8UC3": ("u1", 3, cv2.COLOR_BGR2GRAY),
    "bgr8": ("u1", 3, cv2.COLOR_BGR2GRAY),
    "rgba8": ("u1", 4, cv2.COLOR_RGBA2GRAY),
    "bgra8": ("u1", 4, cv2.COLOR_BGRA2GRAY),
    "rgb16": ("u2", 3, cv2.COLOR_RGB2GRAY),
    "bgr16": ("u2", 3, cv2.COLOR_BGR2GRAY),
    "uyvy": ("u1", 2, cv2.COLOR_YUV2GRAY_UYVY),
    "yuv422": ("u1", 2, cv2.COLOR_YUV2GRAY_UYVY),
    "yuyv": ("u1", 2, cv2.COLOR_YUV2GRAY_YUY2),
    "yuv422_yuy2": ("u1", 2, cv2.COLOR_YUV2GRAY_YUY2),
    "bayer_rggb8": ("u1", 1, cv2.COLOR_BayerRGGB2GRAY),
    "bayer_bggr8": ("u1", 1, cv2.COLOR_BayerBGGR2GRAY),
    "bayer_gbrg8": ("u1", 1, cv2.COLOR_BayerGBRG2GRAY),
    "bayer_grbg8": ("u1", 1, cv2.COLOR_BayerGRBG2GRAY),
}


def pixels_of(message: Any, name: str) -> Pixels:
    """Return the pixels of an image message, mono8 of shape (height, width).

    The message is a decoded ``CompressedImage`` or ``RawImage`` of Foxglove, or a ``CompressedImage`` or
    ``Image`` of ROS 2. Messages to the user call it ``name``.

    Raises:
        PictureError: The image is damaged, or in a form that is not known.
    """
    try:
        return _pixels(message, name)
    except (AttributeError, TypeError, ValueError, OverflowError, cv2.error) as error:
        raise PictureError(f"{name}: not an image: {error}") from None


def _pixels(message: Any, name: str) -> Pixels:
    data = _bytes(message.data, name)
    if not hasattr(message, "encoding"):
        pixels = decoded_picture(data, name)
        # The transport of ROS 2 compresses the mosaic of a Bayer sensor as if it was a grey picture.
        mosaic = _ENCODINGS.get(str(getattr(message, "format", "")).partition(";")[0].strip())
        if mosaic is None or mosaic[1] != 1 or mosaic[2] is None:
            return pixels
        return np.asarray(cv2.cvtColor(pixels, mosaic[2]), dtype=np.uint8)
    known = _ENCODINGS.get(message.encoding)
    if known is None:
        text = f"an image in the encoding {message.encoding!r:.40}; convert it to one of"
        raise PictureError(f"{name}: {text} {', '.join(_ENCODINGS)}")
    kind, channels, conversion = known
    stored = np.dtype(f"{'>' if getattr(message, 'is_bigendian', 0) else '<'}{kind}")
    rows = _rows(data, message, stored, channels, name)
    if conversion is None:
        return mono8(rows, name)
    return mono8(np.asarray(cv2.cvtColor(np.asarray(rows), conversion)), name)


def _bytes(data: Any, name: str) -> Pixels:
    try:
        content = base64.b64decode(data, validate=True) if isinstance(data, str) else memoryview(data)
    except binascii.Error:
        raise PictureError(f"{name}: the image is not in base 64") from None
    if not len(content):
        raise PictureError(f"{name}: the image is empty")
    return np.frombuffer(content, dtype=np.uint8)


def _rows(data: Pixels, message: Any, kind: np.dtype[Any], channels: int, name: str) -> NDArray[np.generic]:
    """Return raw pixels, shape (height, width) or (height, width, channels), without the ends of the rows."""
    width, height, step = int(message.width), int(message.height), int(message.step)
    wide = width * channels * kind.itemsize
    if min(width, height) < 1 or step < wide or step * height != data.size:
        text = f"{data.size} bytes are no image of {width} x {height} px with {step} bytes in a row"
        raise PictureError(f"{name}: {text}")
    rows = np.ascontiguousarray(data.reshape(height, step)[:, :wide]).view(kind)
    native = rows.astype(kind.newbyteorder("="))
    return native if channels == 1 else native.reshape(height, width, channels)
