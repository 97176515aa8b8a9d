"""Projection: which faces may be seen in a window, as linear forms over the image plane.

For a point of a plane ``n . p = -h`` (h > 0: distance of the camera in front of it) and the ray
``r = (x, y, 1)`` of a pixel, ``1 / z = -(n . r) / h``: the inverse depth of a face is *linear* over the
image. So are the tests that bound it: the plane through the camera and an edge A -> B has the normal
``B x A``, and a ray lies inside the face where ``(B x A) . r >= 0`` for all its edges. These forms need no
clipping: they hold when corners lie behind the camera (Olano and Greer, "Triangle scan conversion using 2D
homogeneous coordinates", 1997). The near plane is one more linear form, ``1 / near - 1 / z >= 0``.

Two faces that share an edge compute forms that are exact negatives of each other, bit for bit, so a sample
belongs to one of them and never to none.

Pixels are counted from their edges here: pixel i spans [i, i + 1].
"""

from __future__ import annotations

import numpy as np

from msrr_bullet.render.raster.kernels.compiler import inlined, subroutine
from msrr_bullet.render.raster.kernels.records import (
    SMOOTH,
    TEXTURED,
    Geometry,
    Indices,
    Light,
    ProjectedFaces,
    View,
)
from msrr_scenes.arrays import Array


@inlined
def form(view: View, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return the linear form over the image of ``(x, y, z) . r``."""
    a, b = x / view.focal, y / view.focal
    return a, b, z - (a * view.middle_x + b * view.middle_y)


@inlined
def in_view(view: View, x: float, y: float, z: float, radius: float) -> bool:
    """Say whether a ball at (x, y, z) in C may touch the window; in doubt, it may."""
    slack = radius + 1e-6
    if z + slack < view.near:
        return False
    f = view.focal
    left, right = (view.x - view.middle_x) / f, (view.x + view.width - view.middle_x) / f
    top, bottom = (view.y - view.middle_y) / f, (view.y + view.height - view.middle_y) / f
    if x - left * z < -slack * np.sqrt(1.0 + left * left):
        return False
    if right * z - x < -slack * np.sqrt(1.0 + right * right):
        return False
    if y - top * z < -slack * np.sqrt(1.0 + top * top):
        return False
    return bottom * z - y >= -slack * np.sqrt(1.0 + bottom * bottom)


@subroutine
def project(
    view: View,
    light: Light,
    geometry: Geometry,
    R_CM: Array,
    p_CM: Array,
    R_WM: Array,
    projected: Array,
    out: ProjectedFaces,
) -> int:
    """Fill ``out`` with the faces that may be seen in the bounds of the view; return their number.

    Args:
        view: Camera and window.
        light: Light of the scene.
        geometry: All faces, in their moving frames.
        R_CM: Rotations of the moving frames seen from the camera, shape (M, 3, 3).
        p_CM: Origins of the moving frames seen from the camera, shape (M, 3) [m].
        R_WM: Rotations of the moving frames in the world, shape (M, 3, 3).
        projected: Memory for the vertices in C and in the image, shape (V, 5).
        out: Memory for all faces.
    """
    count, edge = 0, 0
    out.edge_start[0] = 0
    shapes, depths = np.empty(len(geometry.shape_frame), np.int64), np.empty(len(geometry.shape_frame))
    found = 0
    for s in range(len(geometry.shape_frame)):
        R, t = R_CM[geometry.shape_frame[s]], p_CM[geometry.shape_frame[s]]
        bx, by, bz = geometry.shape_ball[s, 0], geometry.shape_ball[s, 1], geometry.shape_ball[s, 2]
        x = R[0, 0] * bx + R[0, 1] * by + R[0, 2] * bz + t[0]
        y = R[1, 0] * bx + R[1, 1] * by + R[1, 2] * bz + t[1]
        z = R[2, 0] * bx + R[2, 1] * by + R[2, 2] * bz + t[2]
        if in_view(view, x, y, z, geometry.shape_ball[s, 3]):
            shapes[found], depths[found] = s, z
            found += 1
    # What is near is drawn first, so that little is drawn in vain behind it. The order is the same in every
    # window: equal depths stay in the order of the bodies.
    for k in np.argsort(depths[:found], kind="mergesort"):
        s = shapes[k]
        m = geometry.shape_frame[s]
        R, t = R_CM[m], p_CM[m]
        for i in range(geometry.shape_vertex[s], geometry.shape_vertex[s + 1]):
            px, py, pz = geometry.vertices[i]
            for k in range(3):
                projected[i, k] = R[k, 0] * px + R[k, 1] * py + R[k, 2] * pz + t[k]
            if projected[i, 2] >= view.near:
                scale = view.focal / projected[i, 2]
                projected[i, 3] = projected[i, 0] * scale + view.middle_x
                projected[i, 4] = projected[i, 1] * scale + view.middle_y
        # The camera and the light in M.
        ox = -(R[0, 0] * t[0] + R[1, 0] * t[1] + R[2, 0] * t[2])
        oy = -(R[0, 1] * t[0] + R[1, 1] * t[1] + R[2, 1] * t[2])
        oz = -(R[0, 2] * t[0] + R[1, 2] * t[1] + R[2, 2] * t[2])
        Q, d = R_WM[m], light.direction
        lx = Q[0, 0] * d[0] + Q[1, 0] * d[1] + Q[2, 0] * d[2]
        ly = Q[0, 1] * d[0] + Q[1, 1] * d[1] + Q[2, 1] * d[2]
        lz = Q[0, 2] * d[0] + Q[1, 2] * d[1] + Q[2, 2] * d[2]
        for face in range(geometry.shape_face[s], geometry.shape_face[s + 1]):
            nx, ny, nz, offset = geometry.planes[face]
            height = nx * ox + ny * oy + nz * oz - offset
            if height <= 0.0:  # seen from behind
                continue
            first, end = geometry.corner_start[face], geometry.corner_start[face + 1]
            if not bounds(view, geometry.corners, first, end, projected, out, count):
                continue
            for i in range(first, end):
                other = geometry.across[i]
                out.inner[edge + i - first] = (
                    other >= 0
                    and geometry.planes[other, 0] * ox
                    + geometry.planes[other, 1] * oy
                    + geometry.planes[other, 2] * oz
                    > geometry.planes[other, 3]
                )
            edge = edge_forms(view, geometry.corners, first, end, projected, out, edge)
            wx = -(R[0, 0] * nx + R[0, 1] * ny + R[0, 2] * nz) / height
            wy = -(R[1, 0] * nx + R[1, 1] * ny + R[1, 2] * nz) / height
            wz = -(R[2, 0] * nx + R[2, 1] * ny + R[2, 2] * nz) / height
            a, b, c = form(view, wx, wy, wz)
            out.inverse_depth[count, 0], out.inverse_depth[count, 1], out.inverse_depth[count, 2] = a, b, c
            if out.nearest[count] * view.near > 1.0:  # a corner is nearer than the near plane
                out.edges[edge, 0], out.edges[edge, 1], out.edges[edge, 2] = -a, -b, 1.0 / view.near - c
                out.inner[edge] = False
                edge += 1
                out.nearest[count] = 1.0 / view.near
            out.edge_start[count + 1] = edge
            kind = geometry.kind[face]
            grey = geometry.grey[face]
            out.kind[count] = kind
            out.texture[count] = geometry.texture[face]
            out.surface[count] = geometry.surface[face]
            for k in range(4):
                out.cells[count, k] = geometry.cells[face, k]
            if kind & SMOOTH:
                row = geometry.smooth[face]
                normals, weights = geometry.corner_normals[row], geometry.weights[row]
                one = intensity(light, normals[0], lx, ly, lz)
                two = intensity(light, normals[1], lx, ly, lz) - one
                three = intensity(light, normals[2], lx, ly, lz) - one
                gx = grey * (two * weights[0, 0] + three * weights[1, 0])
                gy = grey * (two * weights[0, 1] + three * weights[1, 1])
                gz = grey * (two * weights[0, 2] + three * weights[1, 2])
                g0 = grey * (one + two * weights[0, 3] + three * weights[1, 3])
                affine_form(view, R, t, gx, gy, gz, g0, wx, wy, wz, out.shade[count])
                out.grey[count] = grey
            else:
                out.grey[count] = grey * (
                    light.ambient + light.diffuse * max(0.0, nx * lx + ny * ly + nz * lz)
                )
            if kind & TEXTURED:
                for k in range(2):
                    g = geometry.uv[face, k]
                    affine_form(view, R, t, g[0], g[1], g[2], g[3], wx, wy, wz, out.uv[count, k])
            count += 1
    return count


@inlined
def intensity(light: Light, normal: Array, lx: float, ly: float, lz: float) -> float:
    """Return the brightness of a surface from its normal and the direction (lx, ly, lz) to the light in M."""
    return light.ambient + light.diffuse * max(0.0, normal[0] * lx + normal[1] * ly + normal[2] * lz)


@inlined
def affine_form(
    view: View,
    R: Array,
    t: Array,
    gx: float,
    gy: float,
    gz: float,
    g0: float,
    wx: float,
    wy: float,
    wz: float,
    out: Array,
) -> None:
    """Write the form of ``(g . p + g0) / z`` on a face, p in M, whose 1 / z along a ray r is ``w . r``."""
    x = R[0, 0] * gx + R[0, 1] * gy + R[0, 2] * gz
    y = R[1, 0] * gx + R[1, 1] * gy + R[1, 2] * gz
    z = R[2, 0] * gx + R[2, 1] * gy + R[2, 2] * gz
    k = g0 - (x * t[0] + y * t[1] + z * t[2])
    out[0], out[1], out[2] = form(view, x + k * wx, y + k * wy, z + k * wz)


@inlined
def bounds(
    view: View, corners: Indices, first: int, end: int, projected: Array, out: ProjectedFaces, count: int
) -> bool:
    """Write the bounds of a face's part beyond the near plane; say whether that may touch the window."""
    u0, u1, v0, v1 = np.inf, -np.inf, np.inf, -np.inf
    nearest_z, cut = np.inf, False
    k = corners[end - 1]
    ax, ay, az = projected[k, 0], projected[k, 1], projected[k, 2]
    for i in range(first, end):
        k = corners[i]
        bx, by, bz = projected[k, 0], projected[k, 1], projected[k, 2]
        if (az < view.near) != (bz < view.near):  # the edge crosses the near plane
            part = (view.near - az) / (bz - az)
            u = view.focal * (ax + part * (bx - ax)) / view.near + view.middle_x
            v = view.focal * (ay + part * (by - ay)) / view.near + view.middle_y
            u0, u1, v0, v1 = min(u0, u), max(u1, u), min(v0, v), max(v1, v)
            cut = True
        if bz >= view.near:
            u, v = projected[k, 3], projected[k, 4]
            u0, u1, v0, v1 = min(u0, u), max(u1, u), min(v0, v), max(v1, v)
            nearest_z = min(nearest_z, bz)
        ax, ay, az = bx, by, bz
    # Rounding must not make the bounds narrower than the face.
    u0, v0 = u0 - 1e-6 * (1.0 + abs(u0)), v0 - 1e-6 * (1.0 + abs(v0))
    u1, v1 = u1 + 1e-6 * (1.0 + abs(u1)), v1 + 1e-6 * (1.0 + abs(v1))
    out.box[count, 0], out.box[count, 1], out.box[count, 2], out.box[count, 3] = u0, u1, v0, v1
    out.nearest[count] = 2.0 / view.near if cut else 1.0 / nearest_z  # more than possible marks a cut face
    return u1 >= view.x and u0 <= view.x + view.width and v1 >= view.y and v0 <= view.y + view.height


@inlined
def edge_forms(
    view: View, corners: Indices, first: int, end: int, projected: Array, out: ProjectedFaces, edge: int
) -> int:
    """Write the forms of a face's edges from row ``edge`` on; return the row after the last."""
    k = corners[end - 1]
    ax, ay, az = projected[k, 0], projected[k, 1], projected[k, 2]
    for i in range(first, end):
        k = corners[i]
        bx, by, bz = projected[k, 0], projected[k, 1], projected[k, 2]
        a, b, c = form(view, by * az - bz * ay, bz * ax - bx * az, bx * ay - by * ax)
        out.edges[edge, 0], out.edges[edge, 1], out.edges[edge, 2] = a, b, c
        edge += 1
        ax, ay, az = bx, by, bz
    return edge
