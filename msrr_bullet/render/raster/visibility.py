"""Visibility: depth and identity at the pixels' corners, and what falls between them.

Faces are convex and their inverse depths are linear over the image. If one face is the nearest at all four
corners of a pixel it covers the pixel, and it is nearest in all of it, unless something lies in front that
touches none of the four corners: thinner than a pixel or ending inside it. Such a thing either crosses a side
of the pixel between two corners, which shows when rows and columns of corners are scanned (a span without a
whole number in it), or lies inside the pixel. Those pixels are noted with their inverse depth. Then
:mod:`msrr_bullet.render.raster.settle` knows which pixels are settled. What remains unseen is a body that
pierces another one within one pixel.

An identity is ``face << REGION_BITS | region``: a tag's cells form rectangles, which are convex, too, and
settle pixels like faces.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from msrr_bullet.render.raster.compiled import inlined, kernel
from msrr_bullet.render.raster.projection import CELLS, Array, Faces, Indices, View

Depths = NDArray[np.float32]
Identities = NDArray[np.int32]

REGION_BITS = 10
FLOOR, WALL = -1, -2


class Corners(NamedTuple):
    """The corners of the window's pixels, (height + 1, width + 1), and what lies between them."""

    depth: Depths  # 1 / z of the nearest face [1/m]
    identity: Identities
    sliver: Depths  # (height, width) largest 1 / z of what touches no corner of a pixel, or 0


@inlined
def cell_at(uv: Array, cells: Indices, f: int, u: float, v: float, w: float) -> int:
    """Return where the texel of face f's bitmap at (u, v) is, where 1 / z = w."""
    rows, columns = cells[f, 1], cells[f, 2]
    z = 1.0 / w
    s = (uv[f, 0, 0] * u + (uv[f, 0, 1] * v + uv[f, 0, 2])) * z
    t = (uv[f, 1, 0] * u + (uv[f, 1, 1] * v + uv[f, 1, 2])) * z
    column = min(max(int(np.floor(s * columns)), 0), columns - 1)
    row = min(max(int(np.floor((1.0 - t) * rows)), 0), rows - 1)
    return cells[f, 0] + row * columns + column


@kernel
def clear(view: View, floor: Array, corners: Corners) -> None:
    """Fill the corners with the floor (``floor``: form of its 1 / z, zeros without a floor) and the wall."""
    depth, identity, sliver = corners.depth, corners.identity, corners.sliver
    a, b, c = floor[0], floor[1], floor[2]
    for j in range(view.height + 1):
        row = b * (view.y + j) + c
        for i in range(view.width + 1):
            w = np.float32(a * (view.x + i) + row)
            on_floor = w > np.float32(0.0)
            depth[j, i] = w if on_floor else np.float32(0.0)
            identity[j, i] = FLOOR if on_floor else WALL
    for j in range(view.height):
        for i in range(view.width):
            sliver[j, i] = np.float32(0.0)


@inlined
def row_span(edges: Array, first: int, end: int, v: float) -> tuple[float, float]:
    """Return where row v of the image lies inside a face: lower bound inclusive, upper bound exclusive."""
    low, high = -np.inf, np.inf
    for e in range(first, end):
        bound = edges[e, 3] * v + edges[e, 4]
        if edges[e, 0] > 0.0:
            low = max(low, bound)
        elif edges[e, 0] < 0.0:
            high = min(high, bound)
        elif edges[e, 1] * v + edges[e, 2] < 0.0 or (
            edges[e, 1] * v + edges[e, 2] == 0.0 and edges[e, 1] < 0.0
        ):
            high = -np.inf
    return low, high


@inlined
def column_span(edges: Array, first: int, end: int, u: float) -> tuple[float, float]:
    """Return where column u of the image lies inside a face."""
    low, high = -np.inf, np.inf
    for e in range(first, end):
        value = edges[e, 0] * u + edges[e, 2]
        if edges[e, 1] > 0.0:
            low = max(low, -value / edges[e, 1])
        elif edges[e, 1] < 0.0:
            high = min(high, -value / edges[e, 1])
        elif value < 0.0:
            high = -np.inf
    return low, high


@kernel
def note_sliver(view: View, sliver: Depths, a: float, b: float, c: float, column: float, row: float) -> None:
    """Note what lies inside the pixel that holds (column, row), with the largest 1 / z it may have there.

    ``(a, b, c)`` is the form of its 1 / z.
    """
    u, v = np.floor(column), np.floor(row)
    i, j = int(u) - view.x, int(v) - view.y
    if 0 <= i < view.width and 0 <= j < view.height:
        w = a * (u + 0.5) + (b * (v + 0.5) + c) + 0.5 * (abs(a) + abs(b))
        # Rounded to single precision it must not fall below what it bounds.
        sliver[j, i] = max(sliver[j, i], np.float32(w * 1.000001))


@inlined
def place_cells(
    view: View,
    uv: Array,
    cells: Indices,
    f: int,
    a: float,
    row: float,
    k: int,
    i0: int,
    i1: int,
    place: Identities,
) -> None:
    """Write where the texels of face f's bitmap at corners i0 to i1 of row k are.

    Apart from the loop that asks whether they are seen, this becomes vector code. 1 / z is ``a u + row``.
    """
    start, rows, columns = np.int32(cells[f, 0]), np.int32(cells[f, 1]), np.int32(cells[f, 2])
    s_rise, s_row = uv[f, 0, 0], uv[f, 0, 1] * k + uv[f, 0, 2]
    t_rise, t_row = uv[f, 1, 0], uv[f, 1, 1] * k + uv[f, 1, 2]
    for i in range(i0, i1):
        u = np.float64(np.int32(view.x + i))
        z = 1.0 / (a * u + row)
        column = np.int32((s_rise * u + s_row) * z * columns)
        line = np.int32((1.0 - (t_rise * u + t_row) * z) * rows)
        column = min(max(column, np.int32(0)), columns - np.int32(1))
        line = min(max(line, np.int32(0)), rows - np.int32(1))
        place[i] = start + line * columns + column


@kernel
def cover_corners(
    view: View, faces: Faces, count: int, regions: Indices, corners: Corners, place: Identities
) -> None:
    """Draw all faces on the pixels' corners and note what falls between them."""
    depth, identity, sliver = corners.depth, corners.identity, corners.sliver
    inverse_depth, edge_start, edges, box = faces.inverse_depth, faces.edge_start, faces.edges, faces.box
    kind, uv, cells = faces.kind, faces.uv, faces.cells
    for f in range(count):
        if box[f, 3] < view.y or box[f, 2] > view.y + view.height:
            continue
        a, b, c = inverse_depth[f, 0], inverse_depth[f, 1], inverse_depth[f, 2]
        first, end = edge_start[f], edge_start[f + 1]
        has_cells = (kind[f] & CELLS) != 0
        name = np.int32(f << REGION_BITS)
        top = int(max(np.ceil(box[f, 2]), float(view.y)))
        bottom = int(min(np.floor(box[f, 3]), float(view.y + view.height)))
        for k in range(top, bottom + 1):
            low, high = row_span(edges, first, end, float(k))
            if not low <= high:
                continue
            start = np.ceil(low)
            if start >= high:  # between two corners
                note_sliver(view, sliver, a, b, c, low, float(k))
                note_sliver(view, sliver, a, b, c, low, k - 1.0)
                continue
            row = b * k + c
            i0 = int(max(start, float(view.x))) - view.x
            i1 = int(min(np.ceil(high), view.x + view.width + 1.0)) - view.x
            j = k - view.y
            if has_cells:
                place_cells(view, uv, cells, f, a, row, k, i0, i1, place)
                for i in range(i0, i1):
                    w = np.float32(a * (view.x + i) + row)
                    if w > depth[j, i]:
                        depth[j, i] = w
                        identity[j, i] = name | regions[place[i]]
            else:
                for i in range(i0, i1):
                    w = np.float32(a * (view.x + i) + row)
                    if w > depth[j, i]:
                        depth[j, i] = w
                        identity[j, i] = name
        note_thin_columns(view, edges, first, end, box[f, 0], box[f, 1], sliver, a, b, c)
        if np.floor(box[f, 0]) == np.floor(box[f, 1]) and np.floor(box[f, 2]) == np.floor(box[f, 3]):
            note_sliver(view, sliver, a, b, c, box[f, 0], box[f, 2])


@kernel
def note_thin_columns(
    view: View,
    edges: Array,
    first: int,
    end: int,
    u0: float,
    u1: float,
    sliver: Depths,
    a: float,
    b: float,
    c: float,
) -> None:
    """Note where a face crosses columns of corners between two corners: only near its left and right ends.

    The length of a column inside a convex face rises to one maximum, so the search from either end stops
    at the first column that is longer than a pixel.
    """
    left = int(max(np.ceil(u0), float(view.x)))
    right = int(min(np.floor(u1), float(view.x + view.width)))
    from_left = True
    while left <= right:
        k = left if from_left else right
        low, high = column_span(edges, first, end, float(k))
        if low <= high and np.ceil(low) >= high:
            note_sliver(view, sliver, a, b, c, float(k), low)
            note_sliver(view, sliver, a, b, c, k - 1.0, low)
        thick = high - low > 1.0
        if from_left:
            left += 1
            from_left = not thick
        else:
            right -= 1
            if thick:
                break
