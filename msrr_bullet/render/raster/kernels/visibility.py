"""Visibility: depth and identity at the pixels' corners, and where edges run between them.

Faces are convex and their inverse depths are linear over the image. If one face is the nearest at all four
corners of a pixel, it covers the pixel. Could another one be seen in it nevertheless? Not if that covers
the pixel, too: the difference of the two inverse depths is linear, and greatest at a corner. So an edge of
it would have to cross the pixel, in front of the first face. Pixels that edges cross are noted with the
greatest inverse depth that the edge's face has there; then :mod:`msrr_bullet.render.raster.kernels.settle`
knows which pixels are settled, without exception: however thin things are, and also where bodies pierce each
other.

An identity is ``face << REGION_BITS | region``: a tag's cells form rectangles, which are convex, too, and
settle pixels like faces.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from msrr_bullet.render.raster.kernels.compiled import inlined, kernel
from msrr_bullet.render.raster.kernels.records import (
    CELLS,
    FLOOR,
    REGION_BITS,
    WALL,
    Corners,
    Faces,
    Identities,
    Indices,
    Short,
    View,
)
from msrr_scenes.arrays import Array


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


@inlined
def note_edges(
    view: View,
    edges: Array,
    inner: NDArray[np.bool_],
    first: int,
    end: int,
    u0: float,
    u1: float,
    a: float,
    b: float,
    c: float,
    nearest: float,
    k: int,
    sliver: Short,
) -> None:
    """Note in pixel row ``k`` where a face's edges run, with the largest 1 / z that the face has there.

    The face reaches from u0 to u1 and has the form (a, b, c) of its 1 / z, at most ``nearest``.
    """
    low, high = max(u0, float(view.x)), min(u1, view.x + view.width - 0.5)
    for e in range(first, end):
        above = edges[e, 3] * k + edges[e, 4]
        below = above + edges[e, 3]
        if edges[e, 0] > 0.0:
            low = max(low, min(above, below))
        elif edges[e, 0] < 0.0:
            high = min(high, max(above, below))
        elif edges[e, 1] * k + edges[e, 2] + max(edges[e, 1], 0.0) < 0.0:
            high = -np.inf
    if low <= high:
        reach = b * (k + 0.5) + c + 0.5 * (abs(a) + abs(b))
        for e in range(first, end):
            if not inner[e]:
                start, stop = low, high
                if edges[e, 0] != 0.0:
                    above = edges[e, 3] * k + edges[e, 4]
                    below = above + edges[e, 3]
                    start, stop = max(low, min(above, below)), min(high, max(above, below))
                elif (edges[e, 1] * k + edges[e, 2]) * (edges[e, 1] * (k + 1) + edges[e, 2]) > 0.0:
                    stop = -np.inf  # a level edge in another row
                if start <= stop:
                    for i in range(int(np.floor(start)), int(np.floor(stop)) + 1):
                        w = min(a * (i + 0.5) + reach, nearest)
                        # Rounded to single precision it must not fall below what it bounds.
                        note = np.float32(w * 1.000001)
                        sliver[k - view.y, i - view.x] = max(sliver[k - view.y, i - view.x], note)


@kernel
def cover_corners(
    view: View, faces: Faces, count: int, regions: Indices, corners: Corners, place: Identities
) -> None:
    """Draw all faces on the pixels' corners and note where their edges run."""
    depth, identity, sliver = corners.depth, corners.identity, corners.sliver
    inverse_depth, edge_start, edges, box = faces.inverse_depth, faces.edge_start, faces.edges, faces.box
    kind, uv, cells, inner, nearest = faces.kind, faces.uv, faces.cells, faces.inner, faces.nearest
    for f in range(count):
        if box[f, 3] < view.y or box[f, 2] > view.y + view.height:
            continue
        a, b, c = inverse_depth[f, 0], inverse_depth[f, 1], inverse_depth[f, 2]
        first, end = edge_start[f], edge_start[f + 1]
        has_cells = (kind[f] & CELLS) != 0
        name = np.int32(f << REGION_BITS)
        top = int(max(np.floor(box[f, 2]), float(view.y)))
        bottom = int(min(np.floor(box[f, 3]) + 1.0, float(view.y + view.height)))
        for k in range(top, bottom + 1):
            j = k - view.y
            if k < bottom:
                note_edges(
                    view, edges, inner, first, end, box[f, 0], box[f, 1], a, b, c, nearest[f], k, sliver
                )
            low, high = row_span(edges, first, end, float(k))
            if not np.ceil(low) < high:
                continue
            row = b * k + c
            i0 = int(max(np.ceil(low), float(view.x))) - view.x
            i1 = int(min(np.ceil(high), view.x + view.width + 1.0)) - view.x
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
