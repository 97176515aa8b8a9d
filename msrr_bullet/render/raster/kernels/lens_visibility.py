"""Visibility through a lens that distorts: as in :mod:`.visibility`, at undistorted corners of the pixels.

Faces, depths and edges stay linear over the image of an ideal lens, and every corner of a pixel has its place
in that image. A pixel is the quadrangle between its four places, so what holds for squares holds for it: a
convex face that is nearest at all four corners covers the pixel, and forms are greatest at corners.
"""

from __future__ import annotations

import numpy as np

from msrr_bullet.render.raster.kernels.compiler import inlined, subroutine
from msrr_bullet.render.raster.kernels.lens_edges import crossing, form_edges, mark_pixels, side_of
from msrr_bullet.render.raster.kernels.records import (
    CELLS,
    FLOOR,
    REGION_BITS,
    WALL,
    Corners,
    Indices,
    LensView,
    ProjectedFaces,
    TexelNumbers,
)
from msrr_bullet.render.raster.kernels.textures import cell_index
from msrr_bullet.render.raster.kernels.visibility import is_hidden
from msrr_scenes.arrays import Array


@subroutine
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
def first_row(bounds: Array, v: float) -> int:
    """Return the first row whose bound, which grows from row to row, is not below v, else their number."""
    low, high = 0, len(bounds)
    while low < high:
        middle = (low + high) >> 1
        if bounds[middle] < v:
            low = middle + 1
        else:
            high = middle
    return low


@subroutine
def cover_lens_corners(
    view: LensView,
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
    depth, identity, edge_depth, u, v = corners.depth, corners.identity, corners.edge_depth, view.u, view.v
    inverse_depth, box, kind, nearest = faces.inverse_depth, faces.box, faces.kind, faces.nearest
    uv, cells, spans, v_low, v_high = faces.uv, faces.cells, faces.spans, view.v_low, view.v_high
    end_column = u.shape[1]
    most = 0
    for f in range(count):
        most = max(most, faces.edge_start[f + 1] - faces.edge_start[f])
    forms, marks, steep = np.empty((most, 3)), np.empty(most, np.uint8), np.empty(most, np.uint8)
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
        start = max(first_row(v_high[top : top + height], above) - 1, 0)
        spans[f, 0], spans[f, 1] = start, start
        if v_low[top + start] > beneath:
            continue
        # The corners of all pixels that the face may touch.
        stop = min(first_row(v_low[top : top + height + 1], beneath), height)
        middle, reach = top + ((start + stop) >> 1), view.shift * (stop - start + 1)
        left = crossing(u, v, middle, end_column >> 1, 1.0, 0.0, reach - box[f, 0]) - 1
        right = crossing(u, v, middle, left, -1.0, 0.0, reach + box[f, 1]) + 1
        left, right = max(left, 0), min(right, end_column)
        spans[f, 1], spans[f, 2], spans[f, 3] = stop, left, right - 1
        if is_hidden(depth, start, stop + 1, left, right, nearest[f]):
            continue
        edges = form_edges(faces, f, view, forms, marks, steep)
        for n in range(edges):
            if steep[n]:
                there[n] = crossing(u, v, top + start, end_column >> 1, forms[n, 0], forms[n, 1], forms[n, 2])
        for j in range(start, height + 1):
            k, below = top + j, top + min(j + 1, height)
            if v_low[k] > beneath:
                break
            # Corners from i0 to i1, and pixels from p0 to p1, are inside the steep edges, these in part.
            i0, i1, p0, p1 = left, right, left, right - 1
            for n in range(edges):
                if steep[n]:
                    here[n] = there[n]
                    there[n] = crossing(u, v, below, here[n], forms[n, 0], forms[n, 1], forms[n, 2])
                    if forms[n, 0] > 0.0:
                        i0, p0 = max(i0, here[n]), max(p0, min(here[n], there[n]) - 1)
                    else:
                        i1, p1 = min(i1, here[n]), min(p1, max(here[n], there[n]))
            if j < height:
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
                    here,
                    there,
                    edges,
                    flat,
                    apart,
                    a,
                    b,
                    c,
                    nearest[f],
                    edge_depth[j],
                )
            flats = 0
            for n in range(edges):
                if not steep[n] and i0 < i1:
                    ea, eb, ec = forms[n, 0], forms[n, 1], forms[n, 2]
                    side = side_of(ea, eb, ec, u[k, i0], u[k, i1 - 1], v_low[k], v_high[k])
                    if side < 0:
                        i1 = i0
                    elif side == 0:
                        flats += 1
                        for i in range(np.uint32(i0), np.uint32(i1)):
                            outside[i] |= np.uint8(ea * u[k, i] + (eb * v[k, i] + ec) < 0.0)
            if has_cells:
                for i in range(np.uint32(i0), np.uint32(i1)):
                    w = a * u[k, i] + (b * v[k, i] + c)
                    texel[i] = cell_index(uv, cells, f, u[k, i], v[k, i], w)
                for i in range(np.uint32(i0), np.uint32(i1)):
                    w = np.float32(a * u[k, i] + (b * v[k, i] + c))
                    if outside[i] == 0 and w > depth[j, i]:
                        depth[j, i] = w
                        identity[j, i] = name | regions[texel[i]]
            else:
                for i in range(np.uint32(i0), np.uint32(i1)):
                    w = np.float32(a * u[k, i] + (b * v[k, i] + c))
                    if outside[i] == 0 and w > depth[j, i]:
                        depth[j, i] = w
                        identity[j, i] = name
            if flats > 0:
                for i in range(end_column):
                    outside[i] = 0
