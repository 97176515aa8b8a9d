"""Variances of the corners of tags by the data sheet of a camera.

See :mod:`msrr_perception.pose.corner_errors` for what they mean. The functions of a single number are plain
ones, so that they can be called from Python too.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from msrr_perception.kernels.compiled import inlined, kernel
from msrr_perception.kernels.edge_errors import (
    BORDER_FALL,
    BORDER_PX,
    PIXEL_BLUR_PX,
    SAMPLING_PX,
    SHORT_PX,
    SMOOTH_PX,
)
from msrr_perception.kernels.edges import BY_SECTION, TAG_MODULES, reach_px
from msrr_perception.kernels.neighbours import blur_of, gain_of
from msrr_scenes.arrays import Array

#: Variance of the mean of a cross section per pixel of its length, by that of a pixel: interpolation between
#: four pixels averages their noise.
_INTERPOLATION = 0.57

#: Measured variance over the modelled one from which it counts.
SURE = 4.0

#: Share of the variance by what lies beyond the borders of a tag that an edge has all along an approach; the
#: rest changes with the view. Measured on rendered frames of tags of 15 to 60 px, with 0.8 to 1.5 px of blur.
BORDER_SHARE = 0.4

#: Standard deviation of a corner that no model of edges has [px]: of pixels that are not square by their
#: fill, of plates that are not flat.
_REST_PX = 0.005


class DataSheet(NamedTuple):
    """What the errors of the corners of tags depend on."""

    noise_grey: float  # standard deviation of a pixel halfway between black and white [grey levels]
    blur_px: float  # standard deviation of the lens blur [px]
    contrast: float  # contrast between black and white [grey levels]
    corner_px: float  # standard deviation of each corner coordinate, in place of all others; 0 for none [px]


class CornerVariances(NamedTuple):
    """Variances of the corners of K tags [px^2], and what moves whole edges."""

    noise: Array  # (K,) of a cross section of an edge, drawn anew in every exposure
    place: Array  # (K,) of a cross section, by where the edge lies between pixels
    changing: Array  # (K,) of a whole edge, by what the view changes beyond the borders of the tag
    border: Array  # (K,) distance by which what lies there may move an edge all along an approach [px]
    rest: Array  # (K, 4) of each coordinate of a corner, independent of all others


def frame_px(noise_grey: float, contrast: float, reach: float, gain: float) -> float:
    """Return the standard deviation of a cross section that is drawn anew in every frame [px].

    Args:
        noise_grey: Standard deviation of a pixel [grey levels].
        contrast: Contrast between black and white [grey levels].
        reach: Half-length of the section [px].
        gain: Share of the shift of an edge that the section shows; see
            :func:`msrr_perception.kernels.neighbours.gain_of`.
    """
    return noise_grey * math.sqrt(2.0 * _INTERPOLATION * reach) / (contrast * gain)


def sampling_px(blur_px: float, reach: float) -> float:
    """Return the standard deviation of a cross section by where the edge lies between pixels [px]."""
    short = max(SHORT_PX / reach, 1.0) ** 3
    return short * SAMPLING_PX / (1.0 + (blur_px / SMOOTH_PX) ** 2)


def border_px(blur_px: float, reach: float) -> float:
    """Return the standard deviation of a cross section by what lies beyond the borders of the tag [px]."""
    return BORDER_PX * math.exp(-BORDER_FALL * reach / math.hypot(blur_px, PIXEL_BLUR_PX))


def surplus(variance: float, modelled: float) -> float:
    """Return by how much the measured variance of a corner exceeds the modelled one, both [px^2].

    What the image shows of an edge is an estimate of 14 degrees of freedom, and for small tags it errs on the
    safe side. So it counts where it is more than both make of it: from twice the deviation on. From twice the
    variance on, the NEES of poses at 0.2 m fell from 2.3 to 1.9, where 3 is right.
    """
    return variance - modelled if variance > SURE * modelled else 0.0


_blur_of, _gain_of, _surplus = inlined(blur_of), inlined(gain_of), inlined(surplus)
_reach_px, _frame_px = inlined(reach_px), inlined(frame_px)
_sampling_px, _border_px = inlined(sampling_px), inlined(border_px)


@kernel
def variances_of_corners(corners: Array, sigma_px: Array, sheet: DataSheet, scale: float) -> CornerVariances:
    """Return the variances of the corners of K tags.

    A corner that scatters more by what the image shows of its edges counts by that.

    Args:
        corners: Measured pixels, shape (K, 8).
        sigma_px: Standard deviation of each corner as the image shows it, shape (K, 4); 0 if it does not.
        sheet: What their errors depend on.
        scale: Factor on the variances by data sheet.
    """
    count = corners.shape[0]
    noise, place, changing, border = np.zeros(count), np.zeros(count), np.zeros(count), np.zeros(count)
    rest = np.empty((count, 4))
    for t in range(count):
        if sheet.corner_px > 0.0:
            rest[t] = scale * sheet.corner_px**2
            continue
        c = corners[t]
        area = 0.5 * abs((c[4] - c[0]) * (c[7] - c[3]) - (c[5] - c[1]) * (c[6] - c[2]))
        edge = math.sqrt(max(area, 1.0))
        reach = _reach_px(edge)
        gain = _gain_of(_blur_of(sheet.blur_px, edge / TAG_MODULES), reach)
        by_frame = _frame_px(sheet.noise_grey, sheet.contrast, reach, gain) ** 2
        by_place, by_border = _sampling_px(sheet.blur_px, reach) ** 2, _border_px(sheet.blur_px, reach) ** 2
        noise[t] = scale * by_frame
        place[t] = scale * by_place
        changing[t] = scale * (1.0 - BORDER_SHARE) * by_border
        border[t] = math.sqrt(BORDER_SHARE * by_border)
        modelled = scale * BY_SECTION * (by_frame + by_place + by_border)
        for k in range(4):
            rest[t, k] = scale * _REST_PX**2 + _surplus(sigma_px[t, k] ** 2, modelled)
    return CornerVariances(noise, place, changing, border, rest)
