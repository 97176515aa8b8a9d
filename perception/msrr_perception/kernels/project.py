"""Projection of the target's points into the docking unit's camera, with derivatives, and the expected tags.

The planar pose X_DU has three degrees of freedom. A small pitch and roll of the docking unit against the
target are carried along, because 0.2 degrees of pitch look like 10 mm of distance at 0.8 m: U stands in D at
``Rz(yaw) Ry(pitch) Rx(roll)`` and (x, y, 0).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from msrr_perception.kernels.compiled import inlined, kernel
from msrr_scenes.arrays import Array

#: Smallest depth of a point [m]. Points behind the camera are taken to lie this far in front of it, which
#: gives a huge residual instead of a mirrored image.
NEAREST_M = 0.01


class Optics(NamedTuple):
    """A camera and its mounting on the unit, in the form that kernels take."""

    R_CU: Array  # (3, 3)
    p_UC: Array  # (3,) [m]
    focal: float  # [px]
    cx: float  # [px]
    cy: float  # [px]


@inlined
def project_into(optics: Optics, pose: Array, points: Array, pixels: Array, J: Array) -> None:
    """Project points and write the pixels and their derivatives.

    Args:
        optics: Camera and its mounting.
        pose: ``(x, y, yaw, pitch, roll)`` [m, rad]; further entries are ignored.
        points: Points in D, shape (N, 3) [m].
        pixels: Output, shape (2 N,), ordered u0, v0, u1, v1 ...
        J: Output, derivatives of the pixels by the pose, shape (2 N, 5).
    """
    x, y = pose[0], pose[1]
    cy, sy = math.cos(pose[2]), math.sin(pose[2])
    cp, sp = math.cos(pose[3]), math.sin(pose[3])
    cr, sr = math.cos(pose[4]), math.sin(pose[4])
    R, p, f = optics.R_CU, optics.p_UC, optics.focal
    # Columns: the point with the tilt undone, then its derivative by each entry of the pose.
    q = np.empty((3, 6))
    for i in range(points.shape[0]):
        dx, dy, z = points[i, 0] - x, points[i, 1] - y, points[i, 2]
        wx, wy = cy * dx + sy * dy, cy * dy - sy * dx
        for k in range(5):
            if k == 0:
                a, b, c = wx, wy, z
            elif k == 1:
                a, b, c = -cy, sy, 0.0
            elif k == 2:
                a, b, c = -sy, -cy, 0.0
            elif k == 3:
                a, b, c = wy, -wx, 0.0
            else:  # d(Ry^T w) / dpitch, pulled back through Ry
                a, b, c = -z, 0.0, wx
            q[0, k] = cp * a - sp * c
            q[1, k] = sr * sp * a + cr * b + sr * cp * c
            q[2, k] = cr * sp * a - sr * b + cr * cp * c
        q[0, 5], q[1, 5], q[2, 5] = 0.0, q[2, 0], -q[1, 0]
        for k in range(3):
            q[k, 0] -= p[k]
        inverse = 1.0 / max(R[2, 0] * q[0, 0] + R[2, 1] * q[1, 0] + R[2, 2] * q[2, 0], NEAREST_M)
        u = (R[0, 0] * q[0, 0] + R[0, 1] * q[1, 0] + R[0, 2] * q[2, 0]) * inverse
        v = (R[1, 0] * q[0, 0] + R[1, 1] * q[1, 0] + R[1, 2] * q[2, 0]) * inverse
        pixels[2 * i], pixels[2 * i + 1] = f * u + optics.cx, f * v + optics.cy
        scale = f * inverse
        for k in range(1, 6):
            gx = R[0, 0] * q[0, k] + R[0, 1] * q[1, k] + R[0, 2] * q[2, k]
            gy = R[1, 0] * q[0, k] + R[1, 1] * q[1, k] + R[1, 2] * q[2, k]
            gz = R[2, 0] * q[0, k] + R[2, 1] * q[1, k] + R[2, 2] * q[2, k]
            J[2 * i, k - 1] = scale * (gx - u * gz)
            J[2 * i + 1, k - 1] = scale * (gy - v * gz)


@kernel
def predict_tags(
    optics: Optics,
    width: int,
    height: int,
    pose: Array,
    covariance: Array,
    corners: Array,
    least_edge: float,
) -> tuple[Array, Array, Array]:
    """Predict where the corners of tags appear in the image.

    Args:
        optics: Camera and its mounting.
        width: Width of the image [px].
        height: Height of the image [px].
        pose: ``(x, y, yaw, pitch, roll)`` [m, rad].
        covariance: Covariance of (x, y, yaw), shape (3, 3).
        corners: Corners of all tags in D, shape (T, 4, 3) [m].
        least_edge: Shortest edge with which a tag can be read [px].

    Returns:
        Pixels and their standard deviations, each of shape (T, 4, 2), and for each tag 1 if it faces the
        camera, lies wholly inside the image and is large enough, else 0.
    """
    tags = corners.shape[0]
    pixels, sigma, expected = np.empty((tags, 4, 2)), np.empty((tags, 4, 2)), np.zeros(tags)
    flat, J = np.empty(8), np.empty((8, 5))
    x, y, c, s = pose[0], pose[1], math.cos(pose[2]), math.sin(pose[2])
    p_D = np.empty(3)  # position of the camera in D without the tilt
    p_D[0] = x + c * optics.p_UC[0] - s * optics.p_UC[1]
    p_D[1] = y + s * optics.p_UC[0] + c * optics.p_UC[1]
    p_D[2] = optics.p_UC[2]
    axis_x = c * optics.R_CU[2, 0] - s * optics.R_CU[2, 1]
    axis_y = s * optics.R_CU[2, 0] + c * optics.R_CU[2, 1]
    axis_z = optics.R_CU[2, 2]
    for t in range(tags):
        p = corners[t]
        ax, ay, az = p[1, 0] - p[0, 0], p[1, 1] - p[0, 1], p[1, 2] - p[0, 2]
        bx, by, bz = p[0, 0] - p[3, 0], p[0, 1] - p[3, 1], p[0, 2] - p[3, 2]
        # The printed side is visible if z of T, which points into the tag, points away from the camera.
        facing = (
            (ay * bz - az * by) * (p[0, 0] - p_D[0])
            + (az * bx - ax * bz) * (p[0, 1] - p_D[1])
            + (ax * by - ay * bx) * (p[0, 2] - p_D[2])
        )
        nearest = np.inf
        for k in range(4):
            ahead = axis_x * (p[k, 0] - p_D[0]) + axis_y * (p[k, 1] - p_D[1]) + axis_z * (p[k, 2] - p_D[2])
            nearest = min(nearest, ahead)
        if facing <= 0.0 or nearest < NEAREST_M:
            continue
        project_into(optics, pose, p, flat, J)
        inside = True
        for k in range(4):
            u, v = flat[2 * k], flat[2 * k + 1]
            pixels[t, k, 0], pixels[t, k, 1] = u, v
            inside &= -0.5 <= u <= width - 0.5 and -0.5 <= v <= height - 0.5
            before = (k + 3) % 4
            inside &= math.hypot(u - flat[2 * before], v - flat[2 * before + 1]) >= least_edge
            for i in range(2):
                variance = 0.0
                for a in range(3):
                    for b in range(3):
                        variance += J[2 * k + i, a] * covariance[a, b] * J[2 * k + i, b]
                sigma[t, k, i] = math.sqrt(max(variance, 0.0))
        expected[t] = 1.0 if inside else 0.0
    return pixels, sigma, expected


@kernel
def tag_extent(
    pixels: Array, sigma: Array, sigmas: float, margin: float, quiet_zone: float, widen: float
) -> tuple[int, int, int, int]:
    """Return first column and row, and those after the last, of the pixels that should hold a tag.

    Args:
        pixels: Predicted corners, shape (4, 2) [px].
        sigma: Standard deviations of the corners, shape (4, 2) [px].
        sigmas: Margin of a corner in standard deviations.
        margin: Additional margin [px].
        quiet_zone: Margin for the white border, as a share of the longest edge.
        widen: Factor on all margins.
    """
    longest = 0.0
    for k in range(4):
        before = (k + 3) % 4
        edge = math.hypot(pixels[k, 0] - pixels[before, 0], pixels[k, 1] - pixels[before, 1])
        longest = max(longest, edge)
    room = margin + quiet_zone * longest
    x0, y0, x1, y1 = np.inf, np.inf, -np.inf, -np.inf
    for k in range(4):
        room_u = widen * (sigmas * sigma[k, 0] + room)
        room_v = widen * (sigmas * sigma[k, 1] + room)
        x0, x1 = min(x0, pixels[k, 0] - room_u), max(x1, pixels[k, 0] + room_u)
        y0, y1 = min(y0, pixels[k, 1] - room_v), max(y1, pixels[k, 1] + room_v)
    return math.floor(x0), math.floor(y0), math.ceil(x1) + 1, math.ceil(y1) + 1
