"""Which points a body hides from a camera."""

from __future__ import annotations

import numpy as np

from msrr_bullet.render.renderer import NEAR_M
from msrr_scenes.arrays import Array

#: A surface hides what lies farther behind it than this [m]: a tag lies on its plate.
_BEHIND_M = 1e-3


def hidden_points(points_C: Array, triangles_C: Array) -> Array:
    """Return which points have a surface between them and the camera, shape (N,), bool.

    Points, shape (N, 3), and corners of triangles, (T, 3, 3), are in its optical frame C [m]: the points in
    front of it, the corners counter-clockwise when seen from outside. A surface that is seen from within
    hides nothing, as in a picture.
    """
    if not len(points_C):
        return np.zeros(0, dtype=np.bool_)
    a, b, c = np.moveaxis(triangles_C, 1, 0)
    # The ray from the camera through a point p meets a triangle at t p with t = |a b c| / (u + v + w), where
    # u = |p b c|, v = |a p c| and w = |a b p|, within the triangle if these have the sign of |a b c|.
    normals = np.cross(b, c)
    volume = np.einsum("ti,ti->t", a, normals)
    shown = volume < 0.0
    a, b, c, volume = a[shown], b[shown], c[shown], volume[shown]
    sides = np.stack([normals[shown], np.cross(c, a), np.cross(a, b)])
    # Most triangles are beside all points: u, v or w is above zero in all of the box that holds the points.
    low, high = points_C.min(axis=0), points_C.max(axis=0)
    near = (np.minimum(sides * low, sides * high).sum(axis=2) <= 0.0).all(axis=0)
    sides, volume = sides[:, near], volume[near]
    parts = points_C @ np.swapaxes(sides, 1, 2)
    inside = (parts <= 0.0).all(axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = points_C[:, 2:] * volume / parts.sum(axis=0)
    between = (depth > NEAR_M) & (depth < points_C[:, 2:] - _BEHIND_M)
    return np.asarray((inside & between).any(axis=1))
