"""Visibility: depth and identity at the pixels' corners, and which pixels edges cross.

Faces are convex and their inverse depths are linear over the image. If one face is the nearest at all four
corners of a pixel, it covers the pixel. Could another one be seen in it nevertheless? Not if that covers
the pixel, too: the difference of the two inverse depths is linear, and greatest at a corner. So an edge of
it would have to cross the pixel, in front of the first face. For each pixel that edges cross, the greatest
inverse depth of their faces in it is kept. From this it follows without exception which pixels show one thing
only, however thin things are, and also where bodies pierce each other.

An identity is ``face << REGION_BITS | region``: the cells of a tag form rectangles, which are convex, too, so
that the same holds for them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from msrr_bullet.render.raster.kernels.compiler import inlined, subroutine
from msrr_bullet.render.raster.kernels.records import (
    CELLS,
    FLOOR,
    REGION_BITS,
    WALL,
    Corners,
    Floats,
    Indices,
    ProjectedFaces,
    TexelNumbers,
    View,
)
from msrr_bullet.render.raster.kernels.textures import write_cell_indices
from msrr_scenes.arrays import Array


@subroutine
def clear_corners(view: View, floor: Array, corners: Corners) -> None:
    """Fill the corners with wall and floor; ``floor`` is the form of the floor's 1 / z (zeros: no floor)."""
    depth, identity, edge_depth = corners.depth, corners.identity, corners.edge_depth
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
            edge_depth[j, i] = np.float32(0.0)


@inlined
def row_spans(edges: Array, first: int, end: int, k: int) -> tuple[float, float, float, float]:
    """Return bounds of a face on line k of the image, and bounds of what it may reach of the pixel row below.

    Of the line, the lower bound is inside the face and the upper one is not.
    """
    low, high, left, right = -np.inf, np.inf, -np.inf, np.inf
    for e in range(first, end):
        above = edges[e, 3] * k + edges[e, 4]
        below = above + edges[e, 3]
        if edges[e, 0] > 0.0:
            low, left = max(low, above), max(left, min(above, below))
        elif edges[e, 0] < 0.0:
            high, right = min(high, above), min(right, max(above, below))
        else:
            value = edges[e, 1] * k + edges[e, 2]
            if value < 0.0 or (value == 0.0 and edges[e, 1] < 0.0):
                high = -np.inf
            if value + max(edges[e, 1], 0.0) < 0.0:
                right = -np.inf
    return low, high, left, right


@inlined
def mark_edges(
    view: View,
    edges: Array,
    inner: NDArray[np.bool_],
    first: int,
    end: int,
    low: float,
    high: float,
    a: float,
    b: float,
    c: float,
    nearest: float,
    k: int,
    edge_depth: Floats,
) -> None:
    """Raise ``edge_depth``, where edges of a face cross pixel row k, to the largest 1 / z of the face there.

    It reaches from low to high in that row; its 1 / z has the form (a, b, c) and is at most ``nearest``.
    """
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
                for i in range(int(np.floor(start)), min(int(np.floor(stop)) + 1, view.x + view.width)):
                    w = min(a * (i + 0.5) + reach, nearest)
                    # Rounded to single precision it must not fall below what it bounds.
                    bound = np.float32(w * 1.000001)
                    edge_depth[k - view.y, i - view.x] = max(edge_depth[k - view.y, i - view.x], bound)


@inlined
def is_hidden(depth: Floats, j0: int, j1: int, i0: int, i1: int, nearest: float) -> bool:
    """Say whether a face lies behind what is drawn at all corners in rows j0 to j1 and columns i0 to i1.

    They have to be all corners of the pixels that the face may touch. Then no corner would show the face, and
    no edge of it would make a pixel mixed.
    """
    bound = np.float32(nearest * 1.000001)  # not below any 1 / z of the face in single precision
    for j in range(j0, j1):
        farther = 0
        for i in range(np.uint32(i0), np.uint32(i1)):
            farther += depth[j, i] < bound
        if farther > 0:
            return False
    return True


@subroutine
def cover_corners(
    view: View, faces: ProjectedFaces, count: int, regions: Indices, corners: Corners, texel: TexelNumbers
) -> None:
    """Draw all faces on the pixels' corners and mark the pixels that their edges cross.

    ``texel`` is memory for the indices of a row's texels.
    """
    depth, identity, edge_depth = corners.depth, corners.identity, corners.edge_depth
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
        left = int(max(np.floor(box[f, 0]), float(view.x))) - view.x
        right = int(min(np.floor(box[f, 1]) + 1.0, float(view.x + view.width))) - view.x
        if is_hidden(depth, top - view.y, bottom - view.y + 1, left, right + 1, nearest[f]):
            continue
        leftmost = max(box[f, 0], float(view.x))
        rightmost = min(box[f, 1], float(view.x + view.width))
        for k in range(top, bottom + 1):
            j = k - view.y
            low, high, u0, u1 = row_spans(edges, first, end, k)
            u0, u1 = max(u0, leftmost), min(u1, rightmost)
            if k < bottom and u0 <= u1:
                mark_edges(view, edges, inner, first, end, u0, u1, a, b, c, nearest[f], k, edge_depth)
            if not np.ceil(low) < high:
                continue
            row = b * k + c
            i0 = np.uint32(min(max(np.ceil(low) - view.x, 0.0), view.width + 1.0))
            i1 = np.uint32(min(max(np.ceil(high) - view.x, 0.0), view.width + 1.0))
            if has_cells:
                write_cell_indices(view, uv, cells, f, a, row, k, i0, i1, texel)
                for i in range(i0, i1):
                    w = np.float32(a * (view.x + i) + row)
                    if w > depth[j, i]:
                        depth[j, i] = w
                        identity[j, i] = name | regions[texel[i]]
            else:
                for i in range(i0, i1):
                    w = np.float32(a * (view.x + i) + row)
                    if w > depth[j, i]:
                        depth[j, i] = w
                        identity[j, i] = name
