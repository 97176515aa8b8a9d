"""Visibility through a lens that distorts: as in :mod:`.visibility`, at undistorted corners of the pixels.

Faces, depths and edges stay linear over the image of an ideal lens, and every corner of a pixel has its place
in that image. A pixel is the quadrangle between its four places, so what holds for squares holds for it: a
convex face that is nearest at all four corners covers the pixel, and forms are greatest at corners.

A row of corners is a curve there, but a flat one. So an edge divides a row, up to its bend, as it divides
every row between two levels: left and right of the crossing all corners are on one side, and only those about
it are looked at one by one. What is decided there is a function of the pixel alone.
"""

from __future__ import annotations

import numpy as np

from msrr_bullet.render.raster.kernels.compiler import inlined, kernel
from msrr_bullet.render.raster.kernels.records import (
    CELLS,
    FLOOR,
    REGION_BITS,
    WALL,
    Corners,
    Identities,
    Indices,
    LensView,
    ProjectedFaces,
)
from msrr_bullet.render.raster.kernels.textures import cell_index
from msrr_scenes.arrays import Array

#: Edges that are flatter divide no row: -b / a of an edge.
_FLATTEST = 1e6

#: Rounding of a form's zero, relative to the terms that it is the sum of; it is a thousand times smaller.
_ROUNDING = 1e-12

#: Largest coordinate of an image [px].
_LARGEST = 1e5


@kernel
def bound_rows(v: Array, v_low: Array, v_high: Array) -> None:
    """Write the least and the greatest of each row of ``v``, each of shape (rows,)."""
    for k in range(v.shape[0]):
        low = high = v[k, 0]
        for i in range(v.shape[1]):
            low, high = min(low, v[k, i]), max(high, v[k, i])
        v_low[k], v_high[k] = low, high


@kernel
def clear_lens_corners(view: LensView, top: int, height: int, floor: Array, corners: Corners) -> None:
    """Fill the corners of a band of rows with wall and floor, whose 1 / z has the form ``floor``."""
    depth, identity, edge_depth, u, v = corners.depth, corners.identity, corners.edge_depth, view.u, view.v
    a, b, c = floor[0], floor[1], floor[2]
    width = u.shape[1] - 1
    for j in range(height + 1):
        for i in range(width + 1):
            w = np.float32(a * u[top + j, i] + (b * v[top + j, i] + c))
            on_floor = w > np.float32(0.0)
            depth[j, i] = w if on_floor else np.float32(0.0)
            identity[j, i] = FLOOR if on_floor else WALL
    for j in range(height):
        for i in range(width):
            edge_depth[j, i] = np.float32(0.0)


@inlined
def first_from(u: Array, k: int, low: int, high: int, least: float) -> int:
    """Return the first index from ``low`` on, ``high`` at most, where row k of u is not below ``least``."""
    while low < high:
        middle = (low + high) >> 1
        if u[k, middle] < least:
            low = middle + 1
        else:
            high = middle
    return low


@inlined
def divide_row(
    edges: Array, first: int, end: int, v0: float, v1: float, u0: float, u1: float, safe: Array
) -> tuple[float, float, float, float]:
    """Return where points between two levels are surely outside and surely inside all edges of a face.

    Args:
        edges: Edges of all faces.
        first: First edge of the face.
        end: Edge after the last.
        v0: Lower level.
        v1: Upper level.
        u0: Left bound of the face.
        u1: Right bound of the face.
        safe: Output, from where to where points are surely inside each edge, shape (edges of a face, 2).

    Returns:
        Points are outside left of the first and right of the last number, and inside from the second to the
        third.
    """
    out_left, in_left, in_right, out_right = u0, u0, u1, u1
    largest = max(abs(v0), abs(v1))
    for e in range(first, end):
        slope, offset = edges[e, 3], edges[e, 4]
        safe[e - first, 0], safe[e - first, 1] = -np.inf, np.inf
        if edges[e, 0] != 0.0 and abs(slope) < _FLATTEST:
            slack = _ROUNDING * (abs(slope) * largest + abs(offset) + _LARGEST)
            one, two = slope * v0 + offset, slope * v1 + offset
            low, high = min(one, two) - slack, max(one, two) + slack
            if edges[e, 0] > 0.0:
                out_left, in_left, safe[e - first, 0] = max(out_left, low), max(in_left, high), high
            else:
                out_right, in_right, safe[e - first, 1] = min(out_right, high), min(in_right, low), low
        else:
            one, two = edges[e, 1] * v0 + edges[e, 2], edges[e, 1] * v1 + edges[e, 2]
            slack = abs(edges[e, 0]) * _LARGEST + _ROUNDING * (abs(edges[e, 1]) * largest + abs(edges[e, 2]))
            if max(one, two) + slack < 0.0:
                out_left = np.inf
            elif min(one, two) - slack < 0.0:
                in_left = safe[e - first, 0] = np.inf
    return out_left, in_left, in_right, out_right


@kernel
def cover_lens_corners(
    view: LensView,
    top: int,
    height: int,
    faces: ProjectedFaces,
    count: int,
    regions: Indices,
    corners: Corners,
    texel: Identities,
) -> None:
    """Draw all faces on the corners of a band of rows and mark the pixels that their edges cross.

    ``texel`` is memory for the indices of a row's texels.
    """
    depth, identity, edge_depth, u, v = corners.depth, corners.identity, corners.edge_depth, view.u, view.v
    inverse_depth, edge_start, edges, box = faces.inverse_depth, faces.edge_start, faces.edges, faces.box
    kind, uv, cells, inner, nearest = faces.kind, faces.uv, faces.cells, faces.inner, faces.nearest
    end_column, shift, bend = u.shape[1], view.shift, view.bend
    v_low, v_high = view.v_low, view.v_high
    # Whether the corners of a row and of that below it are outside an edge, and outside the face.
    upper, lower = np.empty(end_column, np.uint8), np.empty(end_column, np.uint8)
    outside = np.empty(end_column, np.uint8)
    # Whether the pixels between them are outside, and whether an edge crosses them.
    apart, cut = np.empty(end_column, np.uint8), np.empty(end_column, np.uint8)
    most = 0
    for f in range(count):
        most = max(most, edge_start[f + 1] - edge_start[f])
    safe = np.empty((most, 2))  # from where to where corners are inside each edge
    for f in range(count):
        a, b, c = inverse_depth[f, 0], inverse_depth[f, 1], inverse_depth[f, 2]
        first, end = edge_start[f], edge_start[f + 1]
        has_cells = (kind[f] & CELLS) != 0
        name = np.int32(f << REGION_BITS)
        left, right, above, beneath = box[f, 0], box[f, 1], box[f, 2], box[f, 3]
        highest, last = 0, height
        while highest < last:  # the first row of corners that reaches down to the face
            middle = (highest + last) >> 1
            if v_high[top + middle] < above:
                highest = middle + 1
            else:
                last = middle
        for j in range(max(highest - 1, 0), height + 1):
            k, below = top + j, top + min(j + 1, height)
            if v_low[k] > beneath:
                break
            i0 = max(first_from(u, k, 0, end_column, left - shift) - 1, 0)
            i1 = min(first_from(u, k, i0, end_column, right + shift) + 1, end_column)
            if i1 <= i0:
                continue
            slack = 0.125 * max(bend[k], bend[below]) * (i1 - i0) * (i1 - i0)
            v0 = min(min(v[k, i0], v[k, i1 - 1]), min(v[below, i0], v[below, i1 - 1])) - slack
            v1 = max(max(v[k, i0], v[k, i1 - 1]), max(v[below, i0], v[below, i1 - 1])) + slack
            if v1 < above or v0 > beneath:
                continue
            out_left, in_left, in_right, out_right = divide_row(edges, first, end, v0, v1, left, right, safe)
            if v0 < above or v1 > beneath:
                in_left = np.inf
            # Corners from a0 on are looked at one by one up to a1, then from b0 to b1, and those between are
            # inside. A pixel is so if its corners are.
            a0 = max(first_from(u, k, i0, i1, out_left - shift) - 1, i0)
            b1 = min(first_from(u, k, a0, i1, out_right + shift) + 1, i1)
            if b1 <= a0:
                continue
            a1 = first_from(u, k, a0, b1, in_left + shift) + 1
            b0 = first_from(u, k, a0, b1, in_right - shift) - 1
            if a1 >= b0:
                a1 = b0 = b1
            for part in range(2):
                start, stop = (a0, a1) if part == 0 else (b0, b1)
                for i in range(start, stop):
                    outside[i] = u[k, i] < left or u[k, i] > right or v[k, i] < above or v[k, i] > beneath
                for i in range(start, stop - 1):
                    behind, ahead = min(u[k, i], u[below, i]), max(u[k, i + 1], u[below, i + 1])
                    high, low = min(v[k, i], v[k, i + 1]), max(v[below, i], v[below, i + 1])
                    apart[i] = ahead < left or behind > right or low < above or high > beneath
                    cut[i] = 0
                if start >= stop:
                    continue
                leftmost, rightmost = u[k, start] - shift, u[k, stop - 1] + shift
                for e in range(first, end):
                    if leftmost >= safe[e - first, 0] and rightmost <= safe[e - first, 1]:
                        continue
                    ea, eb, ec = edges[e, 0], edges[e, 1], edges[e, 2]
                    cuts = np.uint8(0 if inner[e] else 1)
                    for i in range(start, stop):
                        upper[i] = ea * u[k, i] + (eb * v[k, i] + ec) < 0.0
                        lower[i] = ea * u[below, i] + (eb * v[below, i] + ec) < 0.0
                        outside[i] |= upper[i]
                    for i in range(start, stop - 1):
                        apart[i] |= upper[i] & upper[i + 1] & lower[i] & lower[i + 1]
                        cut[i] |= cuts & (upper[i] | upper[i + 1] | lower[i] | lower[i + 1])
                for i in range(start, stop - 1):
                    if j < height and cut[i] > apart[i]:
                        w = max(
                            max(a * u[k, i] + b * v[k, i], a * u[k, i + 1] + b * v[k, i + 1]),
                            max(a * u[below, i] + b * v[below, i], a * u[below, i + 1] + b * v[below, i + 1]),
                        )
                        # Rounded to single precision it must not fall below what it bounds.
                        bound = np.float32(min(w + c, nearest[f]) * 1.000001)
                        edge_depth[j, i] = max(edge_depth[j, i], bound)
            for i in range(a1, b0):
                outside[i] = 0
            if has_cells:
                for i in range(a0, b1):
                    w = a * u[k, i] + (b * v[k, i] + c)
                    texel[i] = cell_index(uv, cells, f, u[k, i], v[k, i], w)
                for i in range(a0, b1):
                    w = np.float32(a * u[k, i] + (b * v[k, i] + c))
                    if outside[i] == 0 and w > depth[j, i]:
                        depth[j, i] = w
                        identity[j, i] = name | regions[texel[i]]
            else:
                for i in range(a0, b1):
                    w = np.float32(a * u[k, i] + (b * v[k, i] + c))
                    if outside[i] == 0 and w > depth[j, i]:
                        depth[j, i] = w
                        identity[j, i] = name
