"""Checks of what a detector of a user's own returns."""

from __future__ import annotations

import math
from numbers import Integral, Real

import numpy as np

from msrr_scenes.arrays import Array
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.guarded import wrong
from msrr_scenes.messages import Pixels, TagDetection

#: How far beyond its window a corner may be refined to [px].
_BEYOND_PX = 2.0

#: Smallest area that two edges of a tag span [px^2]; a tag of that size holds no bits.
_SMALLEST_PX2 = 1.0

#: Numbers from here on are no ids [1].
_TOO_LARGE = 2**31


def checked_tags(result: object, pixels: Pixels, window: Window) -> tuple[TagDetection, ...]:
    """Return the tags that a detector found in a window.

    Raises:
        ValueError: They are not tags, their corners are not four finite points of the full frame inside the
            window, the corners do not run around the tag as a camera sees it, or their standard deviations
            are not four positive numbers.
    """
    if not isinstance(result, tuple | list):
        wrong(result, "a tuple of TagDetections")
    return tuple(_checked_tag(tag, window) for tag in result)


def _checked_tag(tag: object, window: Window) -> TagDetection:
    if not isinstance(tag, TagDetection):
        wrong(tag, "a TagDetection")
    for name, number in (("tag_id", tag.tag_id), ("hamming", tag.hamming)):
        if not isinstance(number, Integral) or not 0 <= int(number) < _TOO_LARGE:
            wrong(number, f"a {name} that is a whole number, not negative")
    if not isinstance(tag.decision_margin, Real) or not math.isfinite(tag.decision_margin):
        wrong(tag.decision_margin, "a decision_margin that is a finite number")
    corners = _checked_corners(np.asarray(tag.corners), window)
    sigma = None if tag.corner_sigma_px is None else _checked_sigma(np.asarray(tag.corner_sigma_px))
    return TagDetection(int(tag.tag_id), corners, float(tag.decision_margin), int(tag.hamming), sigma)


def _checked_sigma(sigma: Array) -> Array:
    if sigma.shape != (4,) or sigma.dtype.kind not in "fiu":
        raise ValueError(f"corner_sigma_px of shape {sigma.shape}; expected numbers of shape (4,), or None")
    if not (np.isfinite(sigma) & (sigma > 0.0)).all():
        wrong(sigma.tolist(), "a corner_sigma_px of positive, finite numbers")
    return sigma.astype(float)


def _checked_corners(corners: Array, window: Window) -> Array:
    if corners.shape != (4, 2) or corners.dtype.kind not in "fiu":
        raise ValueError(f"corners of shape {corners.shape}; expected numbers of shape (4, 2)")
    if not np.isfinite(corners).all():
        wrong(corners.tolist(), "corners that are finite numbers")
    first = np.array([window.x, window.y]) - _BEYOND_PX
    last = np.array([window.x_end, window.y_end]) - 1.0 + _BEYOND_PX
    if (corners < first).any() or (corners > last).any():
        wrong(np.round(corners, 1).tolist(), f"corners in pixels of the full frame, inside {window}")
    edges = np.roll(corners, -1, axis=0) - corners
    following = np.roll(edges, -1, axis=0)
    turns = edges[:, 0] * following[:, 1] - edges[:, 1] * following[:, 0]
    if not (turns < -_SMALLEST_PX2).all():  # y of an image points down
        order = "bottom left, bottom right, top right, top left of the tag"
        wrong(np.round(corners, 1).tolist(), f"corners in the order {order}")
    return corners.astype(float)
