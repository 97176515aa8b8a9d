"""Visibility: depth and identity at the pixels' corners, and which pixels edges cross.

Faces are convex and their inverse depths are linear over the image. If one face is the nearest at all four
corners of a pixel, it covers the pixel. Could another one be seen in it nevertheless? Not if that covers
the pixel, too: the difference of the two inverse depths is linear, and greatest at a corner. So an edge of
it would have to cross the pixel, in front of the first face. For each pixel that edges cross, the greatest
inverse depth of their faces in it is kept. From this it follows without exception which pixels show one thing
only, however thin things are, and also where bodies pierce each other.

Behind a lens that distorts, a pixel is the quadrangle between the places of its four corners in the image of
an ideal lens, where all forms stay linear: what holds for squares holds for it.

An identity is ``face << REGION_BITS | region``: the cells of a tag form rectangles, which are convex, too, so
that the same holds for them.
"""

from __future__ import annotations

import numpy as np

from msrr_bullet.render.raster.kernels.compiler import inlined, subroutine
from msrr_bullet.render.raster.kernels.edges import crossing, form_edges, mark_pixels, side_of
from msrr_bullet.render.raster.kernels.grid import bound_at, column_at, form_at
from msrr_bullet.render.raster.kernels.records import (
    CELLS,
    FLOOR,
    REGION_BITS,
    WALL,
    Corners,
    Floats,
    Indices,
    PixelGrid,
    ProjectedFaces,
    TexelNumbers,
)
from msrr_bullet.render.raster.kernels.textures import write_cell_indices
from msrr_scenes.arrays import Array


@subroutine
def clear_corners(grid: PixelGrid, top: int, height: int, floor: Array, corners: Corners) -> None:
    """Fill the corners of a band of rows with wall and floor, whose 1 / z has the form ``floor``."""
    depth, identity, edge_depth, u, v = corners.depth, corners.identity, corners.edge_depth, grid.u, grid.v
    a, b, c = floor[0], floor[1], floor[2]
    width = grid.width
    for j in range(height + 1):
        for i in range(width + 1):
            w = np.float32(form_at(a, b, c, u, v, top + j, i))
            on_floor = w > np.float32(0.0)
            depth[j, i] = w if on_floor else np.float32(0.0)
            identity[j, i] = FLOOR if on_floor else WALL
    for j in range(height):
        for i in range(width):
            edge_depth[j, i] = np.float32(0.0)


@inlined
def first_row(bounds: Array | int, begin: int, end: int, v: float) -> int:
    """Return the first row from ``begin`` on whose bound, which grows, is not below v, else ``end``."""
    while begin < end:
        middle = (begin + end) >> 1
        if bound_at(bounds, middle) < v:
            begin = middle + 1
        else:
            end = middle
    return begin


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
    grid: PixelGrid,
    top: int,
    height: int,
    faces: ProjectedFaces,
    count: int,
    regions: Indices,
    corners: Corners,
    texel: TexelNumbers,
) -> None:
    """Draw all faces on the corners of a band of rows and mark the pixels that their edges cross.

    It fills ``faces.spans``. ``texel`` is memory for the indices of a row's texels.
    """
    depth, identity, edge_depth, u, v = corners.depth, corners.identity, corners.edge_depth, grid.u, grid.v
    inverse_depth, box, kind, nearest = faces.inverse_depth, faces.box, faces.kind, faces.nearest
    uv, cells, spans, v_low, v_high = faces.uv, faces.cells, faces.spans, grid.v_low, grid.v_high
    end_column = grid.width + 1
    most = 0
    for f in range(count):
        most = max(most, faces.edge_start[f + 1] - faces.edge_start[f])
    forms, marks = np.empty((most, 3)), np.empty(most, np.uint8)
    # Where steep edges cross a row of corners and the one below it.
    here, there = np.zeros(most, np.int64), np.zeros(most, np.int64)
    flat = np.empty(most, np.int64)  # the edges that are looked at corner by corner
    # Corners and pixels that are outside a flat edge; all zero between rows.
    outside, apart = np.zeros(end_column, np.uint8), np.zeros(end_column, np.uint8)
    for f in range(count):
        a, b, c = inverse_depth[f, 0], inverse_depth[f, 1], inverse_depth[f, 2]
        has_cells = (kind[f] & CELLS) != 0
        name = np.int32(f << REGION_BITS)
        above, beneath = box[f, 2], box[f, 3]
        start = max(first_row(v_high, top, top + height, above) - top - 1, 0)
        spans[f, 0], spans[f, 1] = start, start
        if bound_at(v_low, top + start) > beneath:
            continue
        # The corners of all pixels that the face may touch.
        stop = min(first_row(v_low, top, top + height + 1, beneath) - top, height)
        middle, reach = top + ((start + stop) >> 1), grid.shift * (stop - start + 1)
        left = crossing(u, v, end_column, middle, end_column >> 1, 1.0, 0.0, reach - box[f, 0]) - 1
        right = crossing(u, v, end_column, middle, left, -1.0, 0.0, reach + box[f, 1]) + 1
        left, right = max(left, 0), min(right, end_column)
        spans[f, 1], spans[f, 2], spans[f, 3] = stop, left, right - 1
        if is_hidden(depth, start, stop + 1, left, right, nearest[f]):
            continue
        steep, edges = form_edges(faces, f, grid, forms, marks)
        for n in range(steep):
            ea, eb, ec = forms[n, 0], forms[n, 1], forms[n, 2]
            there[n] = crossing(u, v, end_column, top + start, end_column >> 1, ea, eb, ec)
        for j in range(start, height + 1):
            k, below = top + j, top + min(j + 1, height)
            if bound_at(v_low, k) > beneath:
                break
            # Corners from i0 to i1, and pixels from p0 to p1, are inside the steep edges, these in part.
            i0, i1, p0, p1 = left, right, left, right - 1
            for n in range(steep):
                ea, eb, ec = forms[n, 0], forms[n, 1], forms[n, 2]
                here[n] = there[n]
                there[n] = crossing(u, v, end_column, below, here[n], ea, eb, ec)
                if ea > 0.0:
                    i0, p0 = max(i0, here[n]), max(p0, min(here[n], there[n]) - 1)
                else:
                    i1, p1 = min(i1, here[n]), min(p1, max(here[n], there[n]))
            if j < height and p0 < p1:
                mark_pixels(
                    u,
                    v,
                    k,
                    below,
                    p0,
                    p1,
                    v_low,
                    v_high,
                    forms,
                    marks,
                    steep,
                    edges,
                    here,
                    there,
                    flat,
                    apart,
                    a,
                    b,
                    c,
                    nearest[f],
                    edge_depth,
                    j,
                )
            flats = 0
            for n in range(steep, edges):
                if i0 < i1:
                    ea, eb, ec = forms[n, 0], forms[n, 1], forms[n, 2]
                    u0, u1 = column_at(u, k, i0), column_at(u, k, i1 - 1)
                    side = side_of(ea, eb, ec, u0, u1, bound_at(v_low, k), bound_at(v_high, k))
                    if side < 0:
                        i1 = i0
                    elif side == 0:
                        flats += 1
                        for i in range(np.uint32(i0), np.uint32(i1)):
                            outside[i] |= np.uint8(form_at(ea, eb, ec, u, v, k, i) < 0.0)
            if has_cells:
                write_cell_indices(u, v, uv, cells, f, a, b, c, k, i0, i1, texel)
                for i in range(np.uint32(i0), np.uint32(i1)):
                    w = np.float32(form_at(a, b, c, u, v, k, i))
                    if outside[i] == 0 and w > depth[j, i]:
                        depth[j, i] = w
                        identity[j, i] = name | regions[texel[i]]
            else:
                for i in range(np.uint32(i0), np.uint32(i1)):
                    w = np.float32(form_at(a, b, c, u, v, k, i))
                    if outside[i] == 0 and w > depth[j, i]:
                        depth[j, i] = w
                        identity[j, i] = name
            if flats > 0:
                for i in range(end_column):
                    outside[i] = 0
