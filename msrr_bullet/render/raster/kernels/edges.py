"""Edges of faces on the rows of corners of pixels.

Behind a lens that distorts, a row of corners is a curve in the image of an ideal lens, but a flat one. An
edge that is steep enough rises or falls along the whole row, so it crosses the row once, near where it
crossed the row above. Flat edges may cross a row more than once: where one may cross, corners and pixels are
looked at one by one. Where the lens is ideal, only level edges are flat. Either way, what is decided of a
pixel is a function of the pixel alone.
"""

from __future__ import annotations

import numpy as np

from msrr_bullet.render.raster.kernels.compiler import inlined
from msrr_bullet.render.raster.kernels.grid import bound_at, column_at, distorts, form_at, row_at
from msrr_bullet.render.raster.kernels.records import Floats, Indices, PixelGrid, ProjectedFaces
from msrr_scenes.arrays import Array
from msrr_scenes.messages import Pixels

#: Rounding of a form, relative to the terms that it is the sum of; it is a thousand times smaller.
_ROUNDING = 1e-12

#: Largest coordinate of an image [px].
_LARGEST = 1e5


@inlined
def crossing(
    u: Array | int, v: Array | int, end: int, k: int, guess: int, a: float, b: float, c: float
) -> int:
    """Return the first corner of row k at which a form has the sign that it has at the right end.

    The form (a, b, c) rises or falls along the whole row, as u does times ``a``; the row has ``end`` corners.
    Where the lens distorts, few of them are looked at if the guess is good. Where it is ideal, a quotient
    decides, which is the same for an edge and its reverse.
    """
    if not distorts(u):
        return int(np.ceil(min(max(-(b * row_at(v, k, 0) + c) / a - column_at(u, k, 0), 0.0), float(end))))
    i = min(max(guess, 0), end - 1)
    rises = a > 0.0
    # A step of Newton's method; pixels are about 1 wide. From there a corner or two decide.
    i = int(min(max(i + 1.0 - form_at(a, b, c, u, v, k, i) / a, 0.0), float(end)))
    while i < end and (form_at(a, b, c, u, v, k, i) >= 0.0) != rises:
        i += 1
    while i > 0 and (form_at(a, b, c, u, v, k, i - 1) >= 0.0) == rises:
        i -= 1
    return i


@inlined
def side_of(a: float, b: float, c: float, u0: float, u1: float, v0: float, v1: float) -> int:
    """Say whether a form is nowhere negative in a rectangle (1), everywhere (-1), or maybe either (0)."""
    low = min(a * u0, a * u1) + (min(b * v0, b * v1) + c)
    high = max(a * u0, a * u1) + (max(b * v0, b * v1) + c)
    slack = _ROUNDING * ((abs(a) + abs(b)) * _LARGEST + abs(c))
    return 1 if low >= slack else -1 if high < -slack else 0


@inlined
def greatest_in_pixel(
    u: Array | int, v: Array | int, k: int, below: int, i: int, a: float, b: float, c: float
) -> float:
    """Return the greatest value of the form (a, b, c) in pixel i between rows of corners k and ``below``."""
    first = form_at(a, b, c, u, v, k, i)
    if not distorts(u):
        return first + (max(a, 0.0) + max(b, 0.0))
    return max(
        max(first, form_at(a, b, c, u, v, k, i + 1)),
        max(form_at(a, b, c, u, v, below, i), form_at(a, b, c, u, v, below, i + 1)),
    )


@inlined
def raise_edge_depth(
    u: Array | int,
    v: Array | int,
    k: int,
    below: int,
    i: int,
    a: float,
    b: float,
    c: float,
    most: float,
    edge_depth: Floats,
    j: int,
) -> None:
    """Raise the bound of pixel (j, i) of a band to the largest 1 / z of a face in it.

    ``most`` is the largest 1 / z of all of the face.
    """
    w = min(greatest_in_pixel(u, v, k, below, i, a, b, c), most)
    # Rounded to single precision it must not fall below what it bounds.
    edge_depth[j, i] = max(edge_depth[j, i], np.float32(w * 1.000001))


@inlined
def form_edges(
    faces: ProjectedFaces, f: int, grid: PixelGrid, forms: Array, marks: Pixels
) -> tuple[int, int]:
    """Copy the edges of face f; return how many are steep, and the number of all.

    Steep ones rise or fall along every row of corners, in spite of its bend; they come first. ``marks`` says
    which edges a pixel may not cross unnoticed.
    """
    first, end = faces.edge_start[f], faces.edge_start[f + 1]
    edges, inner = faces.edges, faces.inner
    steep, flat = 0, end - first
    for e in range(first, end):
        a, b, c = edges[e, 0], edges[e, 1], edges[e, 2]
        if abs(a) * grid.pitch > 2.0 * abs(b) * grid.slant:
            n = steep
            steep += 1
        else:
            flat -= 1
            n = flat
        forms[n, 0], forms[n, 1], forms[n, 2] = a, b, c
        marks[n] = 0 if inner[e] else 1
    return steep, end - first


@inlined
def in_any(a: float, b: float, c: float, u: Array | int, v: Array | int, k: int, below: int, i: int) -> bool:
    """Say whether a form is not negative at any corner of pixel i between two rows of corners."""
    return (
        (form_at(a, b, c, u, v, k, i) >= 0.0)
        | (form_at(a, b, c, u, v, k, i + 1) >= 0.0)
        | (form_at(a, b, c, u, v, below, i) >= 0.0)
        | (form_at(a, b, c, u, v, below, i + 1) >= 0.0)
    )


@inlined
def in_all(a: float, b: float, c: float, u: Array | int, v: Array | int, k: int, below: int, i: int) -> bool:
    """Say whether a form is negative at no corner of pixel i between two rows of corners."""
    return (
        (form_at(a, b, c, u, v, k, i) >= 0.0)
        & (form_at(a, b, c, u, v, k, i + 1) >= 0.0)
        & (form_at(a, b, c, u, v, below, i) >= 0.0)
        & (form_at(a, b, c, u, v, below, i + 1) >= 0.0)
    )


@inlined
def mark_pixels(
    u: Array | int,
    v: Array | int,
    k: int,
    below: int,
    p0: int,
    p1: int,
    v_low: Array | int,
    v_high: Array | int,
    forms: Array,
    marks: Pixels,
    steep: int,
    edges: int,
    here: Indices,
    there: Indices,
    flat: Indices,
    apart: Pixels,
    a: float,
    b: float,
    c: float,
    nearest: float,
    edge_depth: Floats,
    j: int,
) -> None:
    """Raise the bounds of those pixels of row j of a band that edges of a face cross.

    Pixels from p0 to p1 are in part inside all steep edges, which cross the rows of corners k and ``below``
    at ``here`` and ``there``. ``flat`` and ``apart`` (zeros) are memory for numbers of edges and for flags of
    pixels.
    """
    flats, last = 0, p1
    for n in range(steep, edges):
        if p0 < last:
            u0 = min(column_at(u, k, p0), column_at(u, below, p0))
            u1 = max(column_at(u, k, p1), column_at(u, below, p1))
            v0 = min(bound_at(v_low, k), bound_at(v_low, below))
            v1 = max(bound_at(v_high, k), bound_at(v_high, below))
            side = side_of(forms[n, 0], forms[n, 1], forms[n, 2], u0, u1, v0, v1)
            if side < 0:
                last = p0  # all pixels are outside this edge
            elif side == 0:
                flat[flats] = n
                flats += 1
                for i in range(p0, last):
                    apart[i] |= not in_any(forms[n, 0], forms[n, 1], forms[n, 2], u, v, k, below, i)
    for m in range(flats):
        n = flat[m]
        for i in range(p0, last):
            inside = in_all(forms[n, 0], forms[n, 1], forms[n, 2], u, v, k, below, i)
            if marks[n] and apart[i] == 0 and not inside:
                raise_edge_depth(u, v, k, below, i, a, b, c, nearest, edge_depth, j)
    for n in range(steep):
        if marks[n]:
            first, end = min(here[n], there[n]) - 1, max(here[n], there[n])
            for i in range(max(p0, first), min(last, end)):
                if apart[i] == 0:
                    raise_edge_depth(u, v, k, below, i, a, b, c, nearest, edge_depth, j)
    if flats > 0:
        for i in range(p0, p1):
            apart[i] = 0
