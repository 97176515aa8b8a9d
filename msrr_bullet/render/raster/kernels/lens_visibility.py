"""Visibility through a lens that distorts: as in :mod:`.visibility`, at undistorted corners of the pixels.

Faces, depths and edges stay linear over the image of an ideal lens, and every corner of a pixel has its place
in that image. A pixel is the quadrangle between its four places, so what holds for squares holds for it: a
convex face that is nearest at all four corners covers the pixel, and forms are greatest at corners. Only the
spans of rows are lost, for a row is a curve there; each corner in the bounds of a face is tested.
"""

from __future__ import annotations

import numpy as np

from msrr_bullet.render.raster.kernels.compiler import kernel
from msrr_bullet.render.raster.kernels.records import (
    CELLS,
    FLOOR,
    REGION_BITS,
    WALL,
    Corners,
    Indices,
    LensView,
    ProjectedFaces,
)
from msrr_bullet.render.raster.kernels.textures import cell_index
from msrr_scenes.arrays import Array


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


@kernel
def cover_lens_corners(
    view: LensView,
    top: int,
    height: int,
    faces: ProjectedFaces,
    count: int,
    regions: Indices,
    corners: Corners,
) -> None:
    """Draw all faces on the corners of a band of rows and mark the pixels that their edges cross."""
    depth, identity, edge_depth, u, v = corners.depth, corners.identity, corners.edge_depth, view.u, view.v
    inverse_depth, edge_start, edges, box = faces.inverse_depth, faces.edge_start, faces.edges, faces.box
    kind, uv, cells, inner, nearest = faces.kind, faces.uv, faces.cells, faces.inner, faces.nearest
    width = u.shape[1] - 1
    upper, lower = np.empty(width + 1), np.empty(width + 1)  # a form at the corners above and below
    outside = np.empty(width + 1, np.uint8)
    crossing = np.empty(
        width + 1, np.uint8
    )  # 0: the pixel is inside the face, 1: an edge crosses it, 2: outside
    for f in range(count):
        a, b, c = inverse_depth[f, 0], inverse_depth[f, 1], inverse_depth[f, 2]
        first, end = edge_start[f], edge_start[f + 1]
        has_cells = (kind[f] & CELLS) != 0
        name = np.int32(f << REGION_BITS)
        for j in range(height + 1):
            k, below = top + j, top + min(j + 1, height)
            if max(view.v_high[k], view.v_high[below]) < box[f, 2]:
                continue
            if min(view.v_low[k], view.v_low[below]) > box[f, 3]:
                break
            i0 = min(np.searchsorted(u[k], box[f, 0]), np.searchsorted(u[below], box[f, 0])) - 1
            i1 = max(np.searchsorted(u[k], box[f, 1]), np.searchsorted(u[below], box[f, 1])) + 1
            i0, i1 = max(i0, 0), min(i1, width + 1)
            for i in range(i0, i1):
                outside[i] = crossing[i] = 0
            for i in range(i0, i1 - 1):  # beyond the bounds of the face, whatever the window
                left, right = min(u[k, i], u[below, i]), max(u[k, i + 1], u[below, i + 1])
                high, low = min(v[k, i], v[k, i + 1]), max(v[below, i], v[below, i + 1])
                if right < box[f, 0] or left > box[f, 1] or low < box[f, 2] or high > box[f, 3]:
                    crossing[i] = 2
            for e in range(first, end):
                ea, eb, ec = edges[e, 0], edges[e, 1], edges[e, 2]
                cut = np.uint8(0 if inner[e] else 1)
                for i in range(i0, i1):
                    upper[i] = ea * u[k, i] + (eb * v[k, i] + ec)
                    lower[i] = ea * u[below, i] + (eb * v[below, i] + ec)
                    outside[i] |= upper[i] < 0.0
                for i in range(i0, i1 - 1):
                    greatest = max(max(upper[i], upper[i + 1]), max(lower[i], lower[i + 1]))
                    least = min(min(upper[i], upper[i + 1]), min(lower[i], lower[i + 1]))
                    here = np.uint8(2) if greatest < 0.0 else (cut if least < 0.0 else np.uint8(0))
                    crossing[i] = max(crossing[i], here)
            for i in range(i0, i1):
                upper[i] = a * u[k, i] + (b * v[k, i] + c)
                lower[i] = a * u[below, i] + (b * v[below, i] + c)
            for i in range(i0, i1):
                w = np.float32(upper[i])
                if outside[i] == 0 and w > depth[j, i]:
                    depth[j, i] = w
                    identity[j, i] = name
                    if has_cells:
                        identity[j, i] |= regions[cell_index(uv, cells, f, u[k, i], v[k, i], upper[i])]
            if j < height:
                for i in range(i0, i1 - 1):
                    if crossing[i] == 1:
                        w = max(max(upper[i], upper[i + 1]), max(lower[i], lower[i + 1]))
                        # Rounded to single precision it must not fall below what it bounds.
                        bound = np.float32(min(w, nearest[f]) * 1.000001)
                        edge_depth[j, i] = max(edge_depth[j, i], bound)
