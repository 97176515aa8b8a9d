"""Projection of tags with what was built otherwise than designed, and derivatives by all of it.

A filter carries errors of the calibration as states: of the camera's mount and intrinsics, of its clock, of
the print and of the places of bracket and tags. All are small, so that turns of mounts enter to first order.
To these come errors of the edges in the image that an approach has from its begin to its end.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from msrr_perception.kernels.compiled import kernel
from msrr_perception.kernels.project import NEAREST_M, Optics
from msrr_perception.kernels.rates import Rates, moved
from msrr_scenes.arrays import Array

#: First of the parameters on which the image of a tag depends, by group: ``(x, y, yaw, pitch, roll)`` of the
#: pair; the mount of the camera ``(x, y, z, roll, pitch, yaw)`` in its body frame; relative error of the
#: focal length; principal point (2) [px]; k1; time by which the camera's clock is ahead [s]; distance by
#: which edges look farther out than they are [px]; relative error of the print; mounts of the bracket, in D
#: about the middle of the marker, and of the tag, in its own frame; distances by which what lies beyond the
#: borders moves the four edges outward, as shares of the most that it may.
POSE, CAMERA, FOCAL, CENTRE, K1, CLOCK, EDGE, PRINT, BRACKET, TAG, BORDER = (
    0,
    5,
    11,
    12,
    14,
    15,
    16,
    17,
    18,
    24,
    30,
)

#: Number of those parameters.
PARAMETERS = 34


class TargetTags(NamedTuple):
    """The T tags of a target as designed, and where a state has the errors of their calibration."""

    local: Array  # (T, 4, 3) corners in the frame of their tag [m]
    centres: Array  # (T, 3) middles of the tags in D [m]
    axes: Array  # (T, 3, 3) R_DT
    pivot: Array  # (3,) middle of the marker of the port, about which its bracket turns [m]
    columns: NDArray[np.int64]  # (T, PARAMETERS) index in the state; -1 for what the state does not have
    considered: Array  # (T, PARAMETERS) variance of what is not in the state


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
    x, y, cy, sy = 0.0, 0.0, 1.0, 0.0
    T, size = tags.axes[tag], 1.0 + e[PRINT]
    local, arm, p_D, q, g = np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty((3, PARAMETERS))
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
                    A[i, j] = 0.0
                    for k in range(3):
                        A[i, j] += optics.R_CU[i, k] * R_UD[k, j]
        g[:, :] = 0.0
        base = tags.local[tag, corner]
        lx, ly = size * base[0], size * base[1]
        # Turned by the angles of the tag's mount, then moved by it.
        local[0] = lx - e[TAG + 5] * ly + e[TAG]
        local[1] = ly + e[TAG + 5] * lx + e[TAG + 1]
        local[2] = e[TAG + 3] * ly - e[TAG + 4] * lx + e[TAG + 2]
        for i in range(3):
            arm[i] = tags.centres[tag, i] - tags.pivot[i]
            for j in range(3):
                arm[i] += T[i, j] * local[j]
        ax, ay, az = arm[0], arm[1], arm[2]
        p_D[0] = tags.pivot[0] + e[BRACKET] + ax - e[BRACKET + 5] * ay + e[BRACKET + 4] * az
        p_D[1] = tags.pivot[1] + e[BRACKET + 1] + ay + e[BRACKET + 5] * ax - e[BRACKET + 3] * az
        p_D[2] = tags.pivot[2] + e[BRACKET + 2] + az - e[BRACKET + 4] * ax + e[BRACKET + 3] * ay
        dx, dy, z = p_D[0] - x, p_D[1] - y, p_D[2]
        wx, wy = cy * dx + sy * dy, cy * dy - sy * dx
        ux, uy, uz = cp * wx - sp * z, wy, sp * wx + cp * z  # pitch undone
        q[0], q[1], q[2] = ux, cr * uy + sr * uz, cr * uz - sr * uy  # in U
        for i in range(3):
            R = optics.R_CU[i]
            g[i, 0], g[i, 1] = -A[i, 0], -A[i, 1]
            g[i, 2] = A[i, 0] * dy - A[i, 1] * dx
            g[i, 3] = -R[0] * uz + R[1] * sr * ux + R[2] * cr * ux
            g[i, 4] = R[1] * q[2] - R[2] * q[1]
            g[i, CLOCK] = -(g[i, 0] * at_once[0] + g[i, 1] * at_once[1] + g[i, 2] * at_once[2])
            for j in range(3):
                g[i, BRACKET + j] = A[i, j]
                along = A[i, 0] * T[0, j] + A[i, 1] * T[1, j] + A[i, 2] * T[2, j]
                g[i, TAG + j] = along
                g[i, PRINT] += along * base[j]
            g[i, BRACKET + 3] = A[i, 2] * ay - A[i, 1] * az
            g[i, BRACKET + 4] = A[i, 0] * az - A[i, 2] * ax
            g[i, BRACKET + 5] = A[i, 1] * ax - A[i, 0] * ay
            g[i, TAG + 3] = g[i, TAG + 2] * ly
            g[i, TAG + 4] = -g[i, TAG + 2] * lx
            g[i, TAG + 5] = g[i, TAG + 1] * lx - g[i, TAG] * ly
        for i in range(3):
            q[i] -= optics.p_UC[i]
        R = optics.R_CU
        xc = R[0, 0] * q[0] + R[0, 1] * q[1] + R[0, 2] * q[2]
        yc = R[1, 0] * q[0] + R[1, 1] * q[1] + R[1, 2] * q[2]
        zc = R[2, 0] * q[0] + R[2, 1] * q[1] + R[2, 2] * q[2]
        # The body frame of the camera: x along the optical axis, y left, z up. Moved, then turned back.
        bx, by, bz = zc - e[CAMERA], -xc - e[CAMERA + 1], -yc - e[CAMERA + 2]
        roll, pitch, turn = e[CAMERA + 3], e[CAMERA + 4], e[CAMERA + 5]
        vx = bx + turn * by - pitch * bz
        vy = by - turn * bx + roll * bz
        vz = bz + pitch * bx - roll * by
        inverse = 1.0 / max(vx, NEAREST_M)
        u, v = -vy * inverse, -vz * inverse
        r2 = u * u + v * v
        f, bend = optics.focal * (1.0 + e[FOCAL]), 1.0 + e[K1] * r2
        row = 2 * corner
        pixels[row] = f * bend * u + optics.cx + e[CENTRE]
        pixels[row + 1] = f * bend * v + optics.cy + e[CENTRE + 1]
        uu, uv = f * (bend + 2.0 * e[K1] * u * u), 2.0 * f * e[K1] * u * v
        vv = f * (bend + 2.0 * e[K1] * v * v)
        for k in range(BORDER):
            if CAMERA <= k <= CAMERA + 2:
                kx, ky, kz = 0.0, 0.0, 0.0
                if k == CAMERA:
                    kx, ky, kz = -1.0, turn, -pitch
                elif k == CAMERA + 1:
                    kx, ky, kz = -turn, -1.0, roll
                else:
                    kx, ky, kz = pitch, -roll, -1.0
            elif k == CAMERA + 3:
                kx, ky, kz = 0.0, bz, -by
            elif k == CAMERA + 4:
                kx, ky, kz = -bz, 0.0, bx
            elif k == CAMERA + 5:
                kx, ky, kz = by, -bx, 0.0
            else:
                hx, hy, hz = g[2, k], -g[0, k], -g[1, k]
                kx = hx + turn * hy - pitch * hz
                ky = hy - turn * hx + roll * hz
                kz = hz + pitch * hx - roll * hy
            du, dv = -inverse * (ky + u * kx), -inverse * (kz + v * kx)
            J[row, k] = uu * du + uv * dv
            J[row + 1, k] = uv * du + vv * dv
        J[row, FOCAL], J[row + 1, FOCAL] = optics.focal * bend * u, optics.focal * bend * v
        J[row, CENTRE], J[row + 1, CENTRE + 1] = 1.0, 1.0
        J[row, K1], J[row + 1, K1] = f * r2 * u, f * r2 * v
    outward = np.empty(8)
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
        far = border / math.copysign(max(abs(sine), 0.1), sine)
        to, of = BORDER + (corner + 3) % 4, BORDER + corner  # the edge that ends here and that which begins
        J[row, to], J[row + 1, to] = far * bu / b, far * bv / b
        J[row, of], J[row + 1, of] = -far * au / a, -far * av / a
    for r in range(8):
        J[r, EDGE] = outward[r]
        pixels[r] += e[EDGE] * outward[r]
        for k in range(BORDER, PARAMETERS):
            pixels[r] += e[k] * J[r, k]
