"""The errors of refined tag corners, from what the data sheet of a camera says.

A corner is where the lines through two edges meet, and a line goes through the cross sections of an edge
(:mod:`msrr_perception.kernels.edges`). So the errors of the four edges are independent, and those of the two
corners of one edge are not: together they move the tag less and turn it more than four independent corners.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from msrr_perception.kernels.edges import BY_OFFSET, BY_SECTION, BY_SLOPE, TAG_MODULES, reach_px
from msrr_perception.kernels.neighbours import blur_of, gain_of
from msrr_perception.kernels.section_errors import border_px, frame_px, sampling_px
from msrr_scenes.arrays import Array
from msrr_scenes.specs.sensors import CameraSpec

#: Contrast between black and white of tags on top of a unit and of upright ones, which get less light [grey
#: levels].
LYING_CONTRAST, UPRIGHT_CONTRAST = 200.0, 150.0


@dataclass(frozen=True, slots=True)
class CornerErrors:
    """The errors of the cross sections of the edges of a tag.

    The constants were measured on rendered frames without noise, at tags of 27, 42 and 66 px and 0 to 2 px of
    blur, and at 2 and 8 grey levels of noise. ``edge_px`` is the length of the edges of the tag in the image.

    Attributes:
        noise_grey: Standard deviation of a pixel halfway between black and white [grey levels].
        blur_px: Standard deviation of the lens blur [px].
        contrast: Contrast between black and white [grey levels].
    """

    noise_grey: float
    blur_px: float
    contrast: float = LYING_CONTRAST

    @classmethod
    def from_spec(cls, spec: CameraSpec, contrast: float = LYING_CONTRAST) -> CornerErrors:
        """Take blur, noise and rounding to whole grey levels from the data sheet of a camera."""
        noise = math.sqrt(spec.noise_grey**2 + 0.5 * spec.shot_grey**2 + 1.0 / 12.0)
        return cls(noise, spec.blur_px, contrast)

    def frame_px(self, edge_px: float) -> float:
        """Return the standard deviation of a cross section that is drawn anew in every frame [px]."""
        reach = reach_px(edge_px)
        gain = gain_of(blur_of(self.blur_px, edge_px / TAG_MODULES), reach)
        return frame_px(self.noise_grey, self.contrast, reach, gain)

    def lasting_px(self, edge_px: float) -> float:
        """Return the standard deviation that stays the same in all frames of a tag that stands still [px].

        It depends on where the edges lie between the pixels, and on what lies beyond the borders of the tag.
        """
        reach = reach_px(edge_px)
        return math.hypot(sampling_px(self.blur_px, reach), border_px(self.blur_px, reach))

    def corner_variance(self, edge_px: float) -> float:
        """Return the variance of each coordinate of a corner in one frame [px^2]."""
        return BY_SECTION * (self.frame_px(edge_px) ** 2 + self.lasting_px(edge_px) ** 2)


def corners_by_sections(corners: Array) -> Array:
    """Return how the errors of the edges move the corners, shape (8, 8) [px by px].

    The columns are offset and slope of each edge for an error of one standard deviation of a cross section;
    the matrix times its transpose is the covariance of ``(u, v)`` of all corners for a deviation of 1 px.

    Args:
        corners: Corners of a tag that is nearly a square in the image, shape (4, 2) [px].
    """
    following = np.roll(corners, -1, axis=0)
    along = following - corners
    normals = np.stack([along[:, 1], -along[:, 0]], axis=1) / np.hypot(along[:, 0], along[:, 1])[:, None]
    out = np.zeros((4, 2, 4, 2))  # corner, coordinate, edge, offset or slope
    for e in range(4):
        for corner, end in ((e, -1.0), ((e + 1) % 4, 1.0)):
            out[corner, :, e, 0] = BY_OFFSET * normals[e]
            out[corner, :, e, 1] = end * BY_SLOPE * normals[e]
    return out.reshape(8, 8)
