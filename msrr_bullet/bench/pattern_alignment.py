"""Reference corners of tags on photographs: the whole pattern aligned with the picture.

Nobody knows where the corners of a tag on a photograph are. All edges between its modules together determine
them better than its four outer edges do, and do not depend on any detector: the print is warped by a
homography, blurred, and compared with the grey levels. Blur is free, and so are the levels of black and white
with their slopes over the tag.
"""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from msrr_scenes.arrays import Array
from msrr_scenes.messages import Pixels

#: Samples of a pixel and of a module along each axis; the print is drawn with them and averaged.
_PER_PIXEL, _PER_MODULE = 4, 16

#: Modules of the outermost ring that take no part: what lies beyond the print is blurred into its rim.
_RIM = 0.5

#: Blur at the start and its bounds [px], and steps of the numerical derivatives [px].
_BLUR, _LEAST_BLUR, _GREATEST_BLUR, _STEP = 0.7, 0.2, 4.0, 0.05

#: Most steps of the least squares, the change at which they end, relative to the places in the picture, and
#: the largest distance of a corner from where they began [px].
_STEPS, _SETTLED, _FARTHEST_PX = 50, 3e-6, 3.0


def align_pattern(pixels: Pixels, bits: NDArray[np.bool_], edge_modules: int, corners: Array) -> Array | None:
    """Return the corners of a tag as the whole of its pattern shows them, shape (4, 2) [px], in their order.

    It is None if the tag is not wholly in the picture or there is no alignment nearby.

    Args:
        pixels: Mono8 picture, shape (height, width).
        bits: Modules of the print, shape (N, N), white true.
        edge_modules: Modules along the edge of the square whose corners are meant.
        corners: First guess of these corners, shape (4, 2) [px], in the order of
            :class:`msrr_scenes.messages.TagDetection`.
    """
    difference = _comparison(pixels, bits, edge_modules, corners)
    if difference is None:
        return None

    def derivatives(p: Array) -> Array:
        # The drawing is sampled, so that they need steps as large as a part of a pixel.
        steps = _STEP * np.eye(len(p))
        return np.stack([difference(p + h) - difference(p - h) for h in steps], axis=1) / (2.0 * _STEP)

    start = np.append(corners.ravel(), _BLUR)
    bounds = [-np.inf] * 8 + [_LEAST_BLUR], [np.inf] * 8 + [_GREATEST_BLUR]
    found = least_squares(difference, start, derivatives, bounds, xtol=_SETTLED, max_nfev=_STEPS)
    if not found.success or np.abs(found.x - start)[:8].max() > _FARTHEST_PX:
        return None
    return np.asarray(found.x[:8].reshape(4, 2))


def _comparison(
    pixels: Pixels, bits: NDArray[np.bool_], edge_modules: int, corners: Array
) -> Callable[[Array], Array] | None:
    """Return the function of corners and blur that gives the differences of the grey levels."""
    n = len(bits)
    margin = 4.0 + 0.5 * (n - edge_modules) / edge_modules * float(np.ptp(corners, axis=0).max())
    first = np.floor(corners.min(axis=0) - margin).astype(int)
    last = np.ceil(corners.max(axis=0) + margin).astype(int) + 1
    if (first < 0).any() or (last > pixels.shape[::-1]).any():
        return None
    width, height = (int(edge) for edge in last - first)
    part = pixels[first[1] : last[1], first[0] : last[0]].astype(np.float64)
    fine = np.asarray(np.kron(bits, np.ones((_PER_MODULE, _PER_MODULE))), dtype=np.float32)
    a = 0.5 * (n - edge_modules)
    b = a + edge_modules
    square = np.array([[a, b], [b, b], [b, a], [a, a]])
    to_modules = cv2.getPerspectiveTransform((corners - first).astype(np.float32), square.astype(np.float32))
    grid = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1).astype(np.float64)
    modules = cv2.perspectiveTransform(grid, to_modules)
    used = ((modules > _RIM) & (modules < n - _RIM)).all(axis=-1)
    x, y = (modules[used] / (0.5 * n) - 1.0).T
    seen, texels = part[used], (square * _PER_MODULE - 0.5).astype(np.float32)

    def difference(p: Array) -> Array:
        places = ((p[:8].reshape(4, 2) - first + 0.5) * _PER_PIXEL - 0.5).astype(np.float32)
        size = (width * _PER_PIXEL, height * _PER_PIXEL)
        H = cv2.getPerspectiveTransform(texels, places)
        drawn = cv2.warpPerspective(fine, H, size, borderMode=cv2.BORDER_REPLICATE)
        drawn = cv2.GaussianBlur(drawn, (0, 0), float(p[8]) * _PER_PIXEL, borderType=cv2.BORDER_REPLICATE)
        light = cv2.resize(drawn, (width, height), interpolation=cv2.INTER_AREA)[used].astype(np.float64)
        levels = np.stack([1.0 - light, light], axis=1)
        A = np.concatenate([levels, levels * x[:, None], levels * y[:, None]], axis=1)
        return np.asarray(seen - A @ np.linalg.lstsq(A, seen, rcond=None)[0])

    return difference
