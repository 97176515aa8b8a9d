"""Corners of a tag to a few hundredths of a pixel: straight lines through its four black edges, intersected.

The AprilTag library samples whole pixels along each edge, which leaves a bias of some 0.05 px that depends on
the edge's direction. Here the image is interpolated, each cross section gives the place where the grey level
passes from black to white as an area (unbiased under any symmetric blur), and a line is fitted through all of
them.
"""

from __future__ import annotations

import cv2
import numpy as np

from msrr_scenes.messages import Array, Pixels

#: Cross sections per edge, and the share of the edge at both ends that is left out (corners are rounded).
_SECTIONS = 16
_END_SHARE = 0.12

#: Half-length of a cross section in modules (bits) of the tag, its bounds in pixels, and its samples.
_REACH_MODULES = 0.7
_REACH_PX = (1.5, 3.0)
_SAMPLES = 13

#: An edge that would move farther than this is not the edge of a printed square [px].
_LARGEST_SHIFT_PX = 1.5

#: Indices of the next corner (edge) and of the one before, around a tag.
_NEXT, _BEFORE = [1, 2, 3, 0], [3, 0, 1, 2]

#: Least mean contrast across an edge [grey levels].
_LEAST_CONTRAST = 8.0


def refine_corners(pixels: Pixels, corners: Array) -> Array:
    """Return tag corners moved to the intersections of their edges.

    Args:
        pixels: Mono8 image, shape (height, width).
        corners: Corners of T tags, shape (T, 4, 2), in pixels of this image counted from pixel centres, in
            either sense of rotation.

    Returns:
        Shape (T, 4, 2). A tag that has an edge with too little contrast, too near the image's border, or too
        far from where it should be keeps its corners.
    """
    ends = corners[:, _NEXT]
    along = ends - corners
    length = np.linalg.norm(along, axis=2)
    normal = np.stack([along[..., 1], -along[..., 0]], axis=2) / length[..., None]
    outward = np.sign(((corners - corners.mean(axis=1, keepdims=True)) * normal).sum(axis=2))
    normal = normal * outward[..., None]

    # How far it is across the tag at each edge says how wide a module is there.
    across = 0.5 * (length[:, _BEFORE] + length[:, _NEXT])
    slant = np.abs((along[:, _NEXT] * normal).sum(axis=2)) / length[:, _NEXT]
    reach = np.clip(_REACH_MODULES * across * slant / 8.0, *_REACH_PX)

    s = np.linspace(_END_SHARE, 1.0 - _END_SHARE, _SECTIONS)
    n = np.linspace(-1.0, 1.0, _SAMPLES)
    foot = corners[:, :, None] + s[:, None] * along[:, :, None]  # (T, 4, S, 2)
    offset = reach[..., None] * n  # (T, 4, M)
    where = foot[:, :, :, None] + offset[:, :, None, :, None] * normal[:, :, None, None]
    height, width = pixels.shape
    inside = ((where >= 0.0) & (where <= [width - 1.0, height - 1.0])).all(axis=(1, 2, 3, 4))
    flat = where.reshape(-1, _SECTIONS * _SAMPLES, 2).astype(np.float32)
    grey = cv2.remap(
        pixels.astype(np.float32),
        flat[..., 0],
        flat[..., 1],
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE,
    ).reshape(where.shape[:-1])

    shift, contrast = _crossings(np.asarray(grey, dtype=np.float64), reach)
    slope, level = _line(s, shift)
    ok = inside & (contrast.min(axis=1) > _LEAST_CONTRAST)
    ok &= (np.abs(level) + 0.5 * np.abs(slope)).max(axis=1) < _LARGEST_SHIFT_PX
    # The line of each edge: through its two ends moved along the normal.
    a = corners + (level - 0.5 * slope)[..., None] * normal
    b = ends + (level + 0.5 * slope)[..., None] * normal
    refined = _intersections(a, b)
    return np.where(ok[:, None, None], refined, corners)


def _crossings(grey: Array, reach: Array) -> tuple[Array, Array]:
    """Return where the cross sections turn from black to white, (T, 4, S) [px], and contrasts, (T, 4)."""
    black = grey[..., :2].mean(axis=(2, 3))[..., None]
    white = grey[..., -2:].mean(axis=(2, 3))[..., None]
    contrast = white - black
    # Mean brightness by the trapezium rule is the share of white; the border lies as far from the outer end.
    mean = (grey[..., 1:-1].sum(axis=3) + 0.5 * (grey[..., 0] + grey[..., -1])) / (_SAMPLES - 1)
    share = (mean - black) / np.where(np.abs(contrast) > 1.0, contrast, 1.0)
    return reach[..., None] * (1.0 - 2.0 * share), contrast[..., 0]


def _line(s: Array, shift: Array) -> tuple[Array, Array]:
    """Return slope over the whole edge and level at its middle of the line through ``shift``, each (T, 4)."""
    t = s - 0.5
    return (shift * t).sum(axis=2) / float(t @ t), shift.mean(axis=2)


def _intersections(a: Array, b: Array) -> Array:
    """Return where each edge's line a-b meets the one before it: the tag's corners, (T, 4, 2)."""
    d = b - a
    p, e = a[:, _BEFORE], d[:, _BEFORE]
    r = a - p
    cross = e[..., 0] * d[..., 1] - e[..., 1] * d[..., 0]
    t = (r[..., 0] * d[..., 1] - r[..., 1] * d[..., 0]) / cross
    return p + t[..., None] * e
