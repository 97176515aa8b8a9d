"""Edges of faces on the rows of corners of pixels behind a lens that distorts.

A row of corners is a curve in the image of an ideal lens, but a flat one. An edge that is steep enough rises
or falls along the whole row, so it crosses the row once, near where it crossed the row above. Flat edges may
cross a row more than once: where one may cross, corners and pixels are looked at one by one. Either way, what
is decided of a pixel is a function of the pixel alone.
"""

from __future__ import annotations

import numpy as np

from msrr_bullet.render.raster.kernels.compiler import inlined
from msrr_bullet.render.raster.kernels.records import Floats, Indices, LensView, ProjectedFaces
from msrr_scenes.arrays import Array
from msrr_scenes.messages import Pixels

#: Rounding of a form, relative to the terms that it is the sum of; it is a thousand times smaller.
_ROUNDING = 1e-12

#: Largest coordinate of an image [px].
_LARGEST = 1e5


@inlined
def crossing(u: Array, v: Array, k: int, guess: int, a: float, b: float, c: float) -> int:
    """Return the first corner of row k at which a form has the sign that it has at the right end.

    The form (a, b, c) rises or falls along the whole row, as u does times ``a``. From a good guess few
    corners are looked at.
    """
    end = u.shape[1]
    i = min(max(guess, 0), end - 1)
    rises = a > 0.0
    # A step of Newton's method; pixels are about 1 wide. From there a corner or two decide.
    i = int(min(max(i + 1.0 - (a * u[k, i] + (b * v[k, i] + c)) / a, 0.0), float(end)))
    while i < end and (a * u[k, i] + (b * v[k, i] + c) >= 0.0) != rises:
        i += 1
    while i > 0 and (a * u[k, i - 1] + (b * v[k, i - 1] + c) >= 0.0) == rises:
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
def raise_edge_depth(
    u: Array, v: Array, k: int, below: int, i: int, a: float, b: float, c: float, most: float, row: Floats
) -> None:
    """Raise the bound of pixel i to the largest 1 / z of a face in it; ``most`` is that of all the face."""
    w = max(
        max(a * u[k, i] + b * v[k, i], a * u[k, i + 1] + b * v[k, i + 1]),
        max(a * u[below, i] + b * v[below, i], a * u[below, i + 1] + b * v[below, i + 1]),
    )
    # Rounded to single precision it must not fall below what it bounds.
    row[i] = max(row[i], np.float32(min(w + c, most) * 1.000001))


@inlined
def form_edges(
    faces: ProjectedFaces, f: int, view: LensView, forms: Array, marks: Pixels, steep: Pixels
) -> int:
    """Copy the edges of face f and return their number.

    ``marks`` says which of them a pixel may not cross unnoticed, and ``steep`` which of them rise or fall
    along every row of corners, in spite of its bend.
    """
    first, end = faces.edge_start[f], faces.edge_start[f + 1]
    edges = faces.edges
    for n in range(end - first):
        e = first + n
        forms[n, 0], forms[n, 1], forms[n, 2] = edges[e, 0], edges[e, 1], edges[e, 2]
        marks[n] = 0 if faces.inner[e] else 1
        steep[n] = abs(forms[n, 0]) * view.pitch > 2.0 * abs(forms[n, 1]) * view.slant
    return end - first


@inlined
def in_any(a: float, b: float, c: float, u: Array, v: Array, k: int, below: int, i: int) -> bool:
    """Say whether a form is not negative at any corner of pixel i between two rows of corners."""
    return (
        (a * u[k, i] + (b * v[k, i] + c) >= 0.0)
        | (a * u[k, i + 1] + (b * v[k, i + 1] + c) >= 0.0)
        | (a * u[below, i] + (b * v[below, i] + c) >= 0.0)
        | (a * u[below, i + 1] + (b * v[below, i + 1] + c) >= 0.0)
    )


@inlined
def in_all(a: float, b: float, c: float, u: Array, v: Array, k: int, below: int, i: int) -> bool:
    """Say whether a form is negative at no corner of pixel i between two rows of corners."""
    return (
        (a * u[k, i] + (b * v[k, i] + c) >= 0.0)
        & (a * u[k, i + 1] + (b * v[k, i + 1] + c) >= 0.0)
        & (a * u[below, i] + (b * v[below, i] + c) >= 0.0)
        & (a * u[below, i + 1] + (b * v[below, i + 1] + c) >= 0.0)
    )


@inlined
def mark_pixels(
    u: Array,
    v: Array,
    k: int,
    below: int,
    p0: int,
    p1: int,
    v_low: Array,
    v_high: Array,
    forms: Array,
    marks: Pixels,
    steep: Pixels,
    here: Indices,
    there: Indices,
    edges: int,
    flat: Indices,
    apart: Pixels,
    a: float,
    b: float,
    c: float,
    nearest: float,
    row: Floats,
) -> None:
    """Raise the bounds ``row`` of those pixels between two rows of corners that edges of a face cross.

    Pixels from p0 to p1 are in part inside all steep edges, which cross the rows at ``here`` and ``there``.
    ``flat`` and ``apart`` (zeros) are memory for numbers of edges and for flags of pixels.
    """
    flats, last = 0, p1
    for n in range(edges):
        if not steep[n] and p0 < last:
            u0, u1 = min(u[k, p0], u[below, p0]), max(u[k, p1], u[below, p1])
            v0, v1 = min(v_low[k], v_low[below]), max(v_high[k], v_high[below])
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
                raise_edge_depth(u, v, k, below, i, a, b, c, nearest, row)
    for n in range(edges):
        if steep[n] and marks[n]:
            first, end = min(here[n], there[n]) - 1, max(here[n], there[n])
            for i in range(max(p0, first), min(last, end)):
                if apart[i] == 0:
                    raise_edge_depth(u, v, k, below, i, a, b, c, nearest, row)
    if flats > 0:
        for i in range(p0, p1):
            apart[i] = 0
