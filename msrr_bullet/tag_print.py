"""The print of an AprilTag plate as a bitmap, which the simulator textures bodies with and viewers draw."""

from __future__ import annotations

import numpy as np

from msrr_perception.detection.native_apriltag import tag_bitmap
from msrr_scenes.messages import Pixels
from msrr_scenes.specs.tag_families import TAG36H11, TagFamily

#: Grey levels of the print: paper does not saturate the sensor, and ink reflects some light.
WHITE, BLACK = 240, 15

#: Texels per module. TinyRenderer takes the nearest texel, so that one would do; viewers interpolate.
_TEXELS = 16


def plate_texture(tag_id: int | None, family: TagFamily = TAG36H11) -> Pixels:
    """Return the RGB image of a plate, shape (16 N, 16 N, 3) for N modules; ``None`` is a blank plate.

    Raises:
        DetectorError: The family has no such tag.
    """
    n = family.plate_modules
    white = np.ones((n, n), dtype=np.bool_) if tag_id is None else tag_bitmap(family.name, tag_id)
    grey = np.where(white, WHITE, BLACK).astype(np.uint8)
    return np.repeat(np.kron(grey, np.ones((_TEXELS, _TEXELS), dtype=np.uint8))[..., None], 3, axis=2)
