"""Projection of tags with what was built otherwise than designed, and derivatives by all of it.

A filter carries errors of the calibration as states: of the camera's mount and intrinsics, of its clock, of
the print and of the places of bracket and tags. To these come errors of the edges in the image that an
approach has from its begin to its end. A corner is where lines intersect that are fitted to edges, which a
lens bends (:mod:`msrr_perception.kernels.edges`).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from msrr_perception.kernels.compiled import kernel, subroutine
from msrr_perception.kernels.edges import SECTIONS, SQUARES
from msrr_perception.kernels.project import NEAREST_M, Optics
from msrr_perception.kernels.rates import Rates, moved
from msrr_scenes.arrays import Array

#: First of the parameters on which the image of a tag depends, by group: ``(x, y, yaw, pitch, roll)`` of the
#: pair; the mount of the camera ``(x, y, z, roll, pitch, yaw)`` in its body frame; relative error of the
#: focal length; principal point (2) [px]; k1; time by which the camera's clock is ahead [s]; distance by
#: which edges look farther out than they are [px]; relative error of the print; mount of the tag, in the axes
#: of D about its middle; distances by which what lies beyond the borders moves the four edges outward, as
#: shares of the most that it may.
POSE, CAMERA, FOCAL, CENTRE, K1, CLOCK, EDGE, PRINT, TAG, BORDER = 0, 5, 11, 12, 14, 15, 16, 17, 18, 24

#: Number of those parameters.
PARAMETERS = 28

#: Distance by which a line that is fitted to the cross sections of a bow lies inside the ends of the bow, as
#: a share of four times its height.
_BOW = 0.25 - SQUARES / SECTIONS


class TargetTags(NamedTuple):
    """The T tags of a target as designed, and where a state has the errors of their calibration."""

    corners: Array  # (T, 4, 3) corners about the middle of their tag, in the axes of D [m]
    centres: Array  # (T, 3) middles of the tags in D [m]
    pivot: Array  # (3,) place in D about which the marker of the port turns [m]
    columns: NDArray[np.int64]  # (T, PARAMETERS) index in the state; -1 for what the state does not have
    considered: Array  # (T, PARAMETERS) variance of what is not in the state
    lengths: NDArray[np.int64]  # (L,) indices in the state of what is larger where all is larger
    origins: Array  # (L,) values at which these are 0


@subroutine
def rotate(angles: Array, R: Array, axes: Array) -> None:
    """Write the rotation by roll, pitch and yaw, shape (3, 3), and the axes about which each of them turns.

    The rotation is ``Rz Ry Rx``, as in :meth:`msrr_scenes.geometry.se3.SE3.from_xyz_rpy`, and ``angles`` has
    the shape (3,) [rad]. Row k of ``axes``, shape (3, 3), is the axis about which what was turned turns
    with angle k.
    """
    cr, sr = math.cos(angles[0]), math.sin(angles[0])
    cp, sp = math.cos(angles[1]), math.sin(angles[1])
    cy, sy = math.cos(angles[2]), math.sin(angles[2])
    R[0, 0], R[0, 1], R[0, 2] = cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr
    R[1, 0], R[1, 1], R[1, 2] = sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr
    R[2, 0], R[2, 1], R[2, 2] = -sp, cp * sr, cp * cr
    axes[0, 0], axes[0, 1], axes[0, 2] = cy * cp, sy * cp, -sp
    axes[1, 0], axes[1, 1], axes[1, 2] = -sy, cy, 0.0
    axes[2, 0], axes[2, 1], axes[2, 2] = 0.0, 0.0, 1.0


@subroutine
def cross(a: Array, b: Array, out: Array) -> None:
    """Write the cross product of two vectors, shape (3,) each."""
    out[0], out[1], out[2] = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@kernel
def project_tag(
    optics: Optics,
    tags: TargetTags,
    tag: int,
    border: float,
    rates: Rates,
    after: Array,
    state: Array,
    pixels: Array,
    J: Array,
) -> None:
    """Project the corners of a tag and write pixels and derivatives.

    Args:
        optics: Camera and its mounting as designed.
        tags: The tags.
        tag: Index of the tag.
        border: Distance by which what lies beyond the borders may move an edge [px].
        rates: How the unit moves about the exposure.
        after: Time from the stamp to the exposure of each corner's row, shape (4,) [s].
        state: State, shape (n,).
        pixels: Output, shape (8,), ordered u0, v0, u1, v1 ...
        J: Output, derivatives of the pixels by the parameters, shape (8, PARAMETERS).
    """
    e = np.zeros(PARAMETERS)
    for k in range(PARAMETERS):
        if tags.columns[tag, k] >= 0:
            e[k] = state[tags.columns[tag, k]]
    way, at_once = np.empty(3), np.empty(3)  # of the unit from the stamp to the exposure, and its velocity
    cp, sp = math.cos(e[3]), math.sin(e[3])
    cr, sr = math.cos(e[4]), math.sin(e[4])
    R_UD, A = np.empty((3, 3)), np.empty((3, 3))  # Rx^T Ry^T Rz^T, and from D to the camera
    tag_turn, turn = np.empty((3, 3)), np.empty((3, 3))
    tag_axes, axes = np.empty((3, 3)), np.empty((3, 3))
    rotate(e[TAG + 3 : TAG + 6], tag_turn, tag_axes)
    rotate(e[CAMERA + 3 : CAMERA + 6], turn, axes)
    # From U to the body frame V of the camera as it is mounted: x along the optical axis, y left, z up.
    R_VU = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            forward, left, up = optics.R_CU[2, j], -optics.R_CU[0, j], -optics.R_CU[1, j]
            R_VU[i, j] = turn[0, i] * forward + turn[1, i] * left + turn[2, i] * up
    x, y, cy, sy = 0.0, 0.0, 1.0, 0.0
    turned, p_D, q, p_V, v = np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    size, moment, g = 1.0 + e[PRINT], np.empty(3), np.empty((3, PARAMETERS))
    for corner in range(4):
        if corner == 0 or after[corner] != after[corner - 1]:
            moved(rates, after[corner] - e[CLOCK], way, at_once)
            x, y, yaw = e[0] + way[0], e[1] + way[1], e[2] + way[2]
            cy, sy = math.cos(yaw), math.sin(yaw)
            R_UD[0, 0], R_UD[0, 1], R_UD[0, 2] = cp * cy, cp * sy, -sp
            R_UD[1, 0], R_UD[1, 1], R_UD[1, 2] = sr * sp * cy - cr * sy, sr * sp * sy + cr * cy, sr * cp
            R_UD[2, 0], R_UD[2, 1], R_UD[2, 2] = cr * sp * cy + sr * sy, cr * sp * sy - sr * cy, cr * cp
            for i in range(3):
                for j in range(3):
                    A[i, j] = R_VU[i, 0] * R_UD[0, j] + R_VU[i, 1] * R_UD[1, j] + R_VU[i, 2] * R_UD[2, j]
        g[:, :] = 0.0
        base = tags.corners[tag, corner]
        for i in range(3):
            to_corner = tag_turn[i, 0] * base[0] + tag_turn[i, 1] * base[1] + tag_turn[i, 2] * base[2]
            turned[i] = size * to_corner  # from the middle of the tag
            p_D[i] = tags.centres[tag, i] + e[TAG + i] + turned[i]
        dx, dy, z = p_D[0] - x, p_D[1] - y, p_D[2]
        wx, wy = cy * dx + sy * dy, cy * dy - sy * dx
        ux, uy, uz = cp * wx - sp * z, wy, sp * wx + cp * z  # pitch undone
        q[0], q[1], q[2] = ux, cr * uy + sr * uz, cr * uz - sr * uy  # in U
        for i in range(3):
            R = R_VU[i]
            g[i, 0], g[i, 1] = -A[i, 0], -A[i, 1]
            g[i, 2] = A[i, 0] * dy - A[i, 1] * dx
            g[i, 3] = -R[0] * uz + R[1] * sr * ux + R[2] * cr * ux
            g[i, 4] = R[1] * q[2] - R[2] * q[1]
            g[i, CLOCK] = -(g[i, 0] * at_once[0] + g[i, 1] * at_once[1] + g[i, 2] * at_once[2])
            for j in range(3):
                g[i, TAG + j] = A[i, j]
                g[i, PRINT] += A[i, j] * turned[j] / size
        for k in range(3):
            cross(tag_axes[k], turned, moment)
            for i in range(3):
                g[i, TAG + 3 + k] = A[i, 0] * moment[0] + A[i, 1] * moment[1] + A[i, 2] * moment[2]
        for i in range(3):
            q[i] -= optics.p_UC[i]
        R = optics.R_CU
        # From where the camera is mounted, in the axes of V as designed.
        p_V[0] = R[2, 0] * q[0] + R[2, 1] * q[1] + R[2, 2] * q[2] - e[CAMERA]
        p_V[1] = -(R[0, 0] * q[0] + R[0, 1] * q[1] + R[0, 2] * q[2]) - e[CAMERA + 1]
        p_V[2] = -(R[1, 0] * q[0] + R[1, 1] * q[1] + R[1, 2] * q[2]) - e[CAMERA + 2]
        for i in range(3):
            v[i] = turn[0, i] * p_V[0] + turn[1, i] * p_V[1] + turn[2, i] * p_V[2]
        for k in range(3):
            cross(axes[k], p_V, moment)
            for i in range(3):
                g[i, CAMERA + k] = -turn[k, i]
                by_turn = turn[0, i] * moment[0] + turn[1, i] * moment[1] + turn[2, i] * moment[2]
                g[i, CAMERA + 3 + k] = -by_turn
        inverse = 1.0 / max(v[0], NEAREST_M)
        right, down = -v[1] * inverse, -v[2] * inverse
        r2 = right * right + down * down
        f, bend = optics.focal * (1.0 + e[FOCAL]), 1.0 + e[K1] * r2
        row = 2 * corner
        pixels[row] = f * bend * right + optics.cx + e[CENTRE]
        pixels[row + 1] = f * bend * down + optics.cy + e[CENTRE + 1]
        uu, uv = f * (bend + 2.0 * e[K1] * right * right), 2.0 * f * e[K1] * right * down
        vv = f * (bend + 2.0 * e[K1] * down * down)
        for k in range(BORDER):
            du, dv = -inverse * (g[1, k] + right * g[0, k]), -inverse * (g[2, k] + down * g[0, k])
            J[row, k] = uu * du + uv * dv
            J[row + 1, k] = uv * du + vv * dv
        J[row, FOCAL], J[row + 1, FOCAL] = optics.focal * bend * right, optics.focal * bend * down
        J[row, CENTRE], J[row + 1, CENTRE + 1] = 1.0, 1.0
        J[row, K1], J[row + 1, K1] = f * r2 * right, f * r2 * down
    outward, bowed = np.empty(8), np.empty(8)
    f = optics.focal * (1.0 + e[FOCAL])
    J[:, BORDER:] = 0.0
    for corner in range(4):
        previous, following = 2 * ((corner + 3) % 4), 2 * ((corner + 1) % 4)
        row = 2 * corner
        au, av = pixels[row] - pixels[previous], pixels[row + 1] - pixels[previous + 1]
        bu, bv = pixels[following] - pixels[row], pixels[following + 1] - pixels[row + 1]
        a, b = max(math.hypot(au, av), 1e-6), max(math.hypot(bu, bv), 1e-6)
        # Corners are counter-clockwise as seen, v points down: the outer side is on the right of an edge.
        nu, nv = -av / a - bv / b, au / a + bu / b
        widen = 1.0 / max(1.0 + (au * bu + av * bv) / (a * b), 0.1)
        outward[row], outward[row + 1] = widen * nu, widen * nv
        # An edge that moves takes the corner along the other edge.
        sine = (au * bv - av * bu) / (a * b)
        per_px = 1.0 / math.copysign(max(abs(sine), 0.1), sine)
        # The line that is fitted to an edge which the lens bends lies farther in than the ends of the edge.
        pu, pv = pixels[row] - optics.cx - e[CENTRE], pixels[row + 1] - optics.cy - e[CENTRE + 1]
        by_a = -_BOW * (pv * au - pu * av) * a / (f * f)
        by_b = -_BOW * (pv * bu - pu * bv) * b / (f * f)
        bowed[row] = per_px * (by_a * bu / b - by_b * au / a)
        bowed[row + 1] = per_px * (by_a * bv / b - by_b * av / a)
        far = border * per_px
        to, of = BORDER + (corner + 3) % 4, BORDER + corner  # the edge that ends here and that which begins
        J[row, to], J[row + 1, to] = far * bu / b, far * bv / b
        J[row, of], J[row + 1, of] = -far * au / a, -far * av / a
    for r in range(8):
        J[r, EDGE] = outward[r]
        J[r, K1] += bowed[r]
        pixels[r] += e[EDGE] * outward[r] + e[K1] * bowed[r]
        for k in range(BORDER, PARAMETERS):
            pixels[r] += e[k] * J[r, k]
