"""The way of light to delivered pixels: shading, gain and tone curve of a camera, and JPEG compression.

As everywhere in the sensor, a pixel depends on its place in the full frame and never on the window that is
read out. JPEG codes blocks of 8 x 8 pixels each by itself, so this holds for windows of whole blocks.
"""

from __future__ import annotations

import math

import cv2
import numpy as np

from msrr_bullet.sensors.kernels.readout import Shading
from msrr_scenes.geometry.pinhole import PinholeCamera, Window
from msrr_scenes.messages import Pixels
from msrr_scenes.specs.sensors import CameraSpec

#: Edge of a block of JPEG [px].
_BLOCK = 8

#: Largest number of the analogue-to-digital converter, which has 12 bits as usual; the tone curve maps its
#: numbers to 8 bits, so that neither gain nor gamma leaves gaps between grey levels.
_CONVERTER_MAX = 4095


class ImageResponse:
    """Shading of the image, gain and tone curve of a camera.

    Attributes:
        shading: Where in the frame less light arrives; None if all light arrives everywhere.
        per_grey: Numbers of the converter for each grey level of light.
        tone: Grey level for every number of 16 bits, so that nothing has to be clipped at the converter's
            largest one before, shape (65536,).
    """

    def __init__(self, spec: CameraSpec, pinhole: PinholeCamera) -> None:
        """Prepare the tone curve.

        Vignetting is centred on the principal point of the true intrinsics.
        """
        self.shading = None
        if spec.vignetting > 0.0 or spec.light_gradient > 0.0:
            direction = math.radians(spec.light_gradient_deg)
            rise = spec.light_gradient / pinhole.width
            self.shading = Shading(
                loss=spec.vignetting / math.hypot(0.5 * pinhole.width, 0.5 * pinhole.height) ** 2,
                cx=pinhole.cx,
                cy=pinhole.cy,
                rise_x=rise * math.cos(direction),
                rise_y=rise * math.sin(direction),
                middle_x=0.5 * (pinhole.width - 1),
                middle_y=0.5 * (pinhole.height - 1),
            )
        self.per_grey = spec.gain * _CONVERTER_MAX / 255.0
        levels = np.minimum(np.arange(1 << 16), _CONVERTER_MAX) / _CONVERTER_MAX
        self.tone: Pixels = np.rint(255.0 * levels ** (1.0 / spec.gamma)).astype(np.uint8)


def image_response(spec: CameraSpec, pinhole: PinholeCamera) -> ImageResponse | None:
    """Return the response of a camera; None if light and pixels are the same."""
    plain = spec.gain == 1.0 and spec.gamma == 1.0 and spec.vignetting == 0.0 and spec.light_gradient == 0.0
    return None if plain else ImageResponse(spec, pinhole)


def whole_blocks(window: Window, frame: Window) -> Window:
    """Return the smallest window of whole blocks of JPEG around ``window``, cut at the edge of the frame."""
    x, y = window.x // _BLOCK * _BLOCK, window.y // _BLOCK * _BLOCK
    x_end, y_end = -(-window.x_end // _BLOCK) * _BLOCK, -(-window.y_end // _BLOCK) * _BLOCK
    return Window(x, y, min(x_end, frame.x_end) - x, min(y_end, frame.y_end) - y)


def jpeg_round_trip(pixels: Pixels, quality: int) -> Pixels:
    """Return mono8 pixels after compression and decompression.

    They are those of a window of :func:`whole_blocks`, shape (height, width); the quality is that of libjpeg,
    1 to 100.
    """
    coded = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, quality])[1]
    decoded: Pixels = np.asarray(cv2.imdecode(coded, cv2.IMREAD_GRAYSCALE), dtype=np.uint8)
    return decoded
