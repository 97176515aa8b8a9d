"""Where tags are, and how fast their image moves."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from msrr_bullet.sensors.kernels.compiler import kernel
from msrr_scenes.arrays import Array


@kernel
def place_tags(tags_B: Array, which: NDArray[np.int64], planar: Array) -> Array:
    """Return corners of tags in W, shape (T, 4, 3) [m].

    Args:
        tags_B: The corners in the frames of their bodies, shape (T, 4, 3) [m].
        which: Index of the body of each tag, shape (T,).
        planar: Cosine and sine of the heading of each body, and its place in W [m], shape (B, 4).
    """
    out = np.empty_like(tags_B)
    for t in range(len(tags_B)):
        cos, sin, x, y = planar[which[t]]
        for k in range(4):
            out[t, k, 0] = cos * tags_B[t, k, 0] - sin * tags_B[t, k, 1] + x
            out[t, k, 1] = sin * tags_B[t, k, 0] + cos * tags_B[t, k, 1] + y
            out[t, k, 2] = tags_B[t, k, 2]
    return out


@kernel
def fastest_corner(
    tags_W: Array,
    motions: Array,
    own: Array,
    R_WC: Array,
    p_WC: Array,
    focal: float,
    half_width: float,
    half_height: float,
    offset_x: float,
    offset_y: float,
    nearest: float,
) -> float:
    """Return the largest speed in the image of the corners of tags that face the camera [px/s], or 0.

    A tag counts if a corner of it is inside the frame.

    Args:
        tags_W: Corners of the tags, shape (T, 4, 3) [m], in the order of
            :func:`~msrr_scenes.geometry.unit_geometry.tag_corners`.
        motions: Of the body of each tag, shape (T, 9): a point [m], its velocity [m/s] and the angular
            velocity [rad/s], all in W.
        own: Of the camera, shape (9,).
        R_WC: Rotation of the camera, shape (3, 3).
        p_WC: Position of the camera, shape (3,) [m].
        focal: Focal length [px].
        half_width: Half the width of the frame [px].
        half_height: Half its height.
        offset_x: Column of the principal point from the middle of the frame [px].
        offset_y: Row, likewise.
        nearest: Depth that is not fallen below, nor counts as inside the frame [m].
    """
    fastest = 0.0
    x, y, speed = np.empty(4), np.empty(4), np.empty(4)
    relative, velocity = np.empty(3), np.empty(3)
    for t in range(len(tags_W)):
        inside = False
        for k in range(4):
            p = tags_W[t, k]
            for a in range(3):
                relative[a] = 0.0
                for b in range(3):
                    relative[a] += (p[b] - p_WC[b]) * R_WC[b, a]
            z = max(relative[2], nearest)
            x[k], y[k] = relative[0] / z, relative[1] / z
            inside |= (
                relative[2] > nearest
                and abs(focal * x[k] + offset_x) < half_width
                and abs(focal * y[k] + offset_y) < half_height
            )
            for a in range(3):
                b, c = (a + 1) % 3, (a + 2) % 3
                m = motions[t]
                velocity[a] = m[3 + a] + m[6 + b] * (p[c] - m[c]) - m[6 + c] * (p[b] - m[b])
                velocity[a] -= own[3 + a] + own[6 + b] * (p[c] - own[c]) - own[6 + c] * (p[b] - own[b])
            for a in range(3):
                relative[a] = velocity[0] * R_WC[0, a] + velocity[1] * R_WC[1, a] + velocity[2] * R_WC[2, a]
            speed[k] = np.hypot(relative[0] - x[k] * relative[2], relative[1] - y[k] * relative[2]) / z
        # The corners of a tag that faces the camera go round counter-clockwise.
        faces = (x[1] - x[0]) * (y[3] - y[0]) < (y[1] - y[0]) * (x[3] - x[0])
        if inside and faces:
            fastest = max(fastest, focal * speed.max())
    return fastest
