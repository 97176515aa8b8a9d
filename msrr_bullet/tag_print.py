"""The print of an AprilTag plate as a bitmap, which the simulator textures bodies with and viewers draw."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from msrr_scenes.errors import GeometryError
from msrr_scenes.messages import Pixels

#: Modules (bits) along the edge of the black square, and along the plate with its white border.
TAG_MODULES = 8
PLATE_MODULES = TAG_MODULES + 2

#: Edge of a plate over the edge of its tag's black square.
PLATE_RATIO = PLATE_MODULES / TAG_MODULES

#: Grey levels of the print: paper does not saturate the sensor, and ink reflects some light.
WHITE, BLACK = 240, 15

#: Texels per module. TinyRenderer takes the nearest texel, so that one would do; viewers interpolate.
_TEXELS = 16


def tag_bitmap(tag_id: int) -> NDArray[np.bool_]:
    """Return the modules of a tag36h11 plate, shape (10, 10), white true, as AprilRobotics print it.

    The tags in OpenCV are turned by 180 deg; they are turned back here, so that the corner order of the
    AprilTag detector begins at the bottom left of the bitmap.

    Raises:
        GeometryError: The family has no such tag.
    """
    family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    if not 0 <= tag_id < len(family.bytesList):
        raise GeometryError(
            f"tag id {tag_id} is not in tag36h11, which has ids 0 .. {len(family.bytesList) - 1}"
        )
    black_square = cv2.aruco.generateImageMarker(family, tag_id, TAG_MODULES, borderBits=1)
    return np.pad(np.rot90(black_square, 2) > 127, 1, constant_values=True)


def plate_texture(tag_id: int | None) -> Pixels:
    """Return the RGB image of a plate, shape (160, 160, 3); ``None`` is a blank plate."""
    white = np.ones((PLATE_MODULES, PLATE_MODULES), dtype=np.bool_) if tag_id is None else tag_bitmap(tag_id)
    grey = np.where(white, WHITE, BLACK).astype(np.uint8)
    return np.repeat(np.kron(grey, np.ones((_TEXELS, _TEXELS), dtype=np.uint8))[..., None], 3, axis=2)
