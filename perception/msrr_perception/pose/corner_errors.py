"""The errors of refined tag corners, from what the data sheet of a camera says.

A corner is where the lines through two edges meet, and a line goes through the cross sections of an edge
(:mod:`msrr_perception.kernels.edges`). So the errors of the four edges are independent, and those of the two
corners of one edge are not: together they move the tag less and turn it more than four independent corners.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from msrr_perception.kernels.edges import (
    GREATEST_REACH_PX,
    LEAST_REACH_PX,
    REACH_MODULES,
    SECTIONS,
    SQUARES,
    TAG_MODULES,
)
from msrr_scenes.arrays import Array
from msrr_scenes.specs.sensors import CameraSpec

#: Contrast between black and white of tags on top of a unit and of upright ones, which get less light [grey
#: levels].
LYING_CONTRAST, UPRIGHT_CONTRAST = 200.0, 150.0

#: Variance of the mean of a cross section per pixel of its length, by that of a pixel: interpolation between
#: four pixels averages their noise.
_INTERPOLATION = 0.57

#: Error of a cross section because the edge is sampled in pixels: standard deviation of a sharp edge, and the
#: blur that halves it [px].
_SAMPLING_PX, _SMOOTH_PX = 0.032, 0.75

#: Half-length of a cross section below which this error grows, with the third power [px].
_SHORT_PX = 1.8

#: Error of a cross section because what lies beyond the borders of the tag is blurred into it: deviation
#: at a length of zero [px], how it falls with the half-length by the blur, and the blur by pixels and by
#: interpolation [px].
_BORDER_PX, _BORDER_FALL, _PIXEL_BLUR_PX = 0.9, 1.55, 0.45

#: Share of the offset and of the slope of a line in each of its ends, by the error of one cross section.
BY_OFFSET = 1.0 / math.sqrt(SECTIONS)
BY_SLOPE = 0.5 / math.sqrt(SQUARES)


@dataclass(frozen=True, slots=True)
class CornerErrors:
    """The errors of the cross sections of the edges of a tag.

    The constants were measured on rendered frames without noise, at tags of 27, 42 and 66 px and 0 to 2 px of
    blur, and at 2 and 8 grey levels of noise.

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
        """Return the standard deviation of a cross section that is drawn anew in every frame [px].

        Args:
            edge_px: Length of the edges of the tag in the image [px].
        """
        return self.noise_grey * math.sqrt(2.0 * _INTERPOLATION * _reach(edge_px)) / self.contrast

    def lasting_px(self, edge_px: float) -> float:
        """Return the standard deviation that stays the same in all frames of a tag that stands still [px].

        It depends on where the edges lie between the pixels, and on what lies beyond the borders of the tag.

        Args:
            edge_px: Length of the edges of the tag in the image [px].
        """
        return math.hypot(self.sampling_px(edge_px), self.border_px(edge_px))

    def sampling_px(self, edge_px: float) -> float:
        """Return the standard deviation of a cross section by where the edge lies between pixels [px].

        Args:
            edge_px: Length of the edges of the tag in the image [px].
        """
        short = max(_SHORT_PX / _reach(edge_px), 1.0) ** 3
        return short * _SAMPLING_PX / (1.0 + (self.blur_px / _SMOOTH_PX) ** 2)

    def border_px(self, edge_px: float) -> float:
        """Return the standard deviation of a cross section by what lies beyond the borders of the tag [px].

        It is the same wherever the edge lies in the image.

        Args:
            edge_px: Length of the edges of the tag in the image [px].
        """
        blur = math.hypot(self.blur_px, _PIXEL_BLUR_PX)
        return _BORDER_PX * math.exp(-_BORDER_FALL * _reach(edge_px) / blur)


def _reach(edge_px: float) -> float:
    """Return half the length of a cross section [px]."""
    return min(max(REACH_MODULES * edge_px / TAG_MODULES, LEAST_REACH_PX), GREATEST_REACH_PX)


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
