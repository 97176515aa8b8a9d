"""Corners of a tag to a few hundredths of a pixel: lines fitted to its four black edges, intersected.

The AprilTag library samples whole pixels along each edge, which leaves a bias of some 0.05 px that depends on
the edge's direction. Here the image is interpolated, each cross section gives the place where the grey level
passes from black to white as an area (unbiased under any symmetric blur), and a line is fitted through all of
them.

What lies beyond the black and the white border of the tag, which are one module wide each, is different on
the two sides and shifts the edge. Therefore a cross section ends in the middle of either border, and light
that reaches it by blur all the same is subtracted (:mod:`msrr_perception.kernels.neighbours`).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from msrr_perception.kernels.compiled import inlined, kernel, subroutine
from msrr_perception.kernels.edge_errors import section_variance
from msrr_perception.kernels.lens import NO_LENS, Optic, distorted, undistorted
from msrr_perception.kernels.neighbours import NEIGHBOUR_MODULES, SAMPLES, spread_of, without_neighbours
from msrr_scenes.arrays import Array
from msrr_scenes.messages import Pixels

#: Largest number of fits, each from the corners that the last one gave, and the largest change of a corner
#: coordinate at which they end [px]. The cross sections lie where the guess puts them.
PASSES = 4
SETTLED_PX = 0.01

#: Cross sections per edge, and the share of the edge left out at either end (corners are rounded).
SECTIONS = 16
END_SHARE = 0.12

#: Modules (bits) along the edge of the black square of a tag.
TAG_MODULES = 8.0

#: Half-length of a cross section in modules of the tag, and its bounds in pixels.
#: Interpolation spreads a sharp edge over 2 px. Sections much shorter than that make the shift depend on
#: where the edge lies between two pixels, an error that all corners on one edge have in common; those of
#: tiny tags therefore reach beyond the middle of the borders.
REACH_MODULES = 0.5
LEAST_REACH_PX, GREATEST_REACH_PX = 1.15, 3.0

#: Largest distance of a corner from the guess [px]; what lies farther is not the corner that was detected.
LARGEST_SHIFT_PX = 2.0

#: Least share of a shift that a section is taken to show. A blur that was told too large asks for less, and
#: fits that make up for it would not settle.
LEAST_GAIN = 0.5

#: Least mean contrast across an edge [grey levels].
LEAST_CONTRAST = 8.0

#: Distance of the cross sections as a share of the edge, and their sum of squared places about its middle.
_STEP = (1.0 - 2.0 * END_SHARE) / (SECTIONS - 1)
SQUARES = _STEP * _STEP * SECTIONS * (SECTIONS * SECTIONS - 1) / 12.0


#: Share of the offset and of the slope of a line in each of its ends, by the error of one cross section, and
#: the variance of the place of an edge at either of its ends, by that of a cross section.
BY_OFFSET, BY_SLOPE = 1.0 / math.sqrt(SECTIONS), 0.5 / math.sqrt(SQUARES)
BY_SECTION = BY_OFFSET * BY_OFFSET + BY_SLOPE * BY_SLOPE


class RefinedCorners(NamedTuple):
    """Corners of T tags, measured as intersections of edges.

    Attributes:
        corners: Corners, shape (T, 4, 2) [px].
        measured: For each tag whether its corners were measured, shape (T,). A tag that has an edge with too
            little contrast, too near the image's border, or too far from where it should be keeps its
            corners.
        sigma_px: Standard deviation of each coordinate of a corner, shape (T, 4) [px], by what the image
            shows of its two edges; NaN of a tag that was not measured.
    """

    corners: Array
    measured: NDArray[np.bool_]
    sigma_px: Array


def refine_corners(
    pixels: Pixels, corners: Array, optic: Optic = NO_LENS, blur_px: float = 0.0
) -> RefinedCorners:
    """Return tag corners moved to the intersections of the tags' edges.

    Args:
        pixels: Mono8 image, shape (height, width).
        corners: Corners of T tags, shape (T, 4, 2), in pixels of this image counted from pixel centres, in
            either sense of rotation.
        optic: Lens without which the edges are straight, with its principal point in pixels of this image.
        blur_px: Standard deviation of the lens blur [px]; 0 if it is not known.
    """
    # One memory layout, so that the kernel is compiled once: contiguous and read-only, as a camera gives it.
    image = np.ascontiguousarray(pixels)[:]
    image.setflags(write=False)
    guesses = np.ascontiguousarray(corners, dtype=np.float64)
    return RefinedCorners(*intersect_edges(image, guesses, optic, blur_px))


@kernel
def intersect_edges(
    pixels: Pixels, corners: Array, optic: Optic, blur_px: float
) -> tuple[Array, NDArray[np.bool_], Array]:
    """Return what :func:`refine_corners` returns, from an image and corners of the expected layout.

    Behind a lens that distorts, ``square`` is the tag in the image of the ideal camera.
    """
    out, measured = corners.copy(), np.zeros(corners.shape[0], np.bool_)
    sigma = np.full((corners.shape[0], 4), np.nan)
    # The corners of one tag: as guessed, before and after a fit.
    guess, before, square = np.empty((4, 2)), np.empty((4, 2)), np.empty((4, 2))
    a, b = np.empty((4, 2)), np.empty((4, 2))  # the ends of each edge, moved
    variances = np.empty(4)  # of a cross section of each edge
    for t in range(corners.shape[0]):
        square[:] = corners[t]
        if optic.distorts:
            for e in range(4):
                square[e, 0], square[e, 1] = undistorted(optic, corners[t, e, 0], corners[t, e, 1])
        guess[:] = square
        ok = True
        for _ in range(PASSES):
            before[:] = square
            for e in range(4):
                ok = ok and fit_edge(pixels, before, e, optic, blur_px, a, b, variances)
            if not ok:
                break
            change = 0.0
            for e in range(4):  # intersect each edge's line with the one before it
                p = (e + 3) % 4
                dx, dy = b[e, 0] - a[e, 0], b[e, 1] - a[e, 1]
                ex, ey = b[p, 0] - a[p, 0], b[p, 1] - a[p, 1]
                rx, ry = a[e, 0] - a[p, 0], a[e, 1] - a[p, 1]
                part = (rx * dy - ry * dx) / (ex * dy - ey * dx)
                square[e, 0], square[e, 1] = a[p, 0] + part * ex, a[p, 1] + part * ey
                moved = math.hypot(square[e, 0] - guess[e, 0], square[e, 1] - guess[e, 1])
                ok = ok and moved < LARGEST_SHIFT_PX
                change = max(change, abs(square[e, 0] - before[e, 0]), abs(square[e, 1] - before[e, 1]))
            if not ok or change < SETTLED_PX:
                break
        if ok:
            out[t], measured[t] = square, True
            for e in range(4):  # errors along the normals of two edges move their intersection
                p = (e + 3) % 4
                dx, dy = b[e, 0] - a[e, 0], b[e, 1] - a[e, 1]
                ex, ey = b[p, 0] - a[p, 0], b[p, 1] - a[p, 1]
                sine = (ex * dy - ey * dx) / (math.hypot(ex, ey) * math.hypot(dx, dy))
                sigma[t, e] = math.sqrt(0.5 * BY_SECTION * (variances[e] + variances[p])) / abs(sine)
            if optic.distorts:
                for e in range(4):
                    out[t, e, 0], out[t, e, 1] = distorted(optic, square[e, 0], square[e, 1])
    return out, measured, sigma


@inlined
def grey_at(pixels: Pixels, x: float, y: float) -> float:
    """Return the grey level at a point of an image, interpolated between four pixels."""
    height, width = pixels.shape
    column, row = min(max(int(x), 0), width - 2), min(max(int(y), 0), height - 2)
    ax, ay = float(x - column), float(y - row)
    left, lower_left = float(pixels[row, column]), float(pixels[row + 1, column])
    right, lower_right = float(pixels[row, column + 1]), float(pixels[row + 1, column + 1])
    upper, lower = left + ax * (right - left), lower_left + ax * (lower_right - lower_left)
    return upper + ay * (lower - upper)


@inlined
def grey_beside(pixels: Pixels, x: float, y: float, optic: Optic) -> float:
    """Return the grey level at a point of the ideal image; beyond the image that of its border."""
    height, width = pixels.shape
    if optic.distorts:
        x, y = distorted(optic, x, y)
    return grey_at(pixels, min(max(x, 0.0), width - 1.0), min(max(y, 0.0), height - 1.0))


def reach_px(edge_px: float) -> float:
    """Return half the length of a cross section, by the length of the edges of the tag [px]."""
    return min(max(REACH_MODULES * edge_px / TAG_MODULES, LEAST_REACH_PX), GREATEST_REACH_PX)


_reach_px = inlined(reach_px)


@subroutine
def fit_edge(
    pixels: Pixels,
    square: Array,
    e: int,
    optic: Optic,
    blur_px: float,
    a: Array,
    b: Array,
    variances: Array,
) -> bool:
    """Write the ends of edge ``e`` of a tag, moved onto the edge in the image, and how sure they are.

    Args:
        pixels: Mono8 image, shape (height, width).
        square: Corners of the tag, shape (4, 2) [px].
        e: Number of the edge, from corner ``e`` to the next.
        optic: Lens of the image; cross sections are straight without it.
        blur_px: Standard deviation of the lens blur [px].
        a: First ends of the edges, shape (4, 2) [px].
        b: Second ends of the edges, shape (4, 2) [px].
        variances: Variance of a cross section of each edge, shape (4,) [px^2].

    Returns:
        Whether the sections lie in the image and show an edge; if not, nothing is written.
    """
    height, width = pixels.shape
    f, g, h = (e + 1) % 4, (e + 2) % 4, (e + 3) % 4
    x0, y0 = square[e, 0], square[e, 1]
    along_x, along_y = square[f, 0] - x0, square[f, 1] - y0
    length = math.hypot(along_x, along_y)
    nx, ny = along_y / length, -along_x / length
    # The tag's extent across this edge tells the outward side and the width of a module there.
    across_f = (square[f, 0] - square[g, 0]) * nx + (square[f, 1] - square[g, 1]) * ny
    across_e = (x0 - square[h, 0]) * nx + (y0 - square[h, 1]) * ny
    across = 0.5 * (across_e + across_f)
    if across < 0.0:
        nx, ny, across = -nx, -ny, -across
    module = across / TAG_MODULES
    reach = _reach_px(across)
    for i in range(2):  # the ends of the outermost sections bound all samples
        s = END_SHARE if i == 0 else 1.0 - END_SHARE
        foot_x, foot_y = x0 + s * along_x, y0 + s * along_y
        half_x, half_y = reach * abs(nx), reach * abs(ny)
        inside = half_x <= foot_x <= width - 1.0 - half_x and half_y <= foot_y <= height - 1.0 - half_y
        if not inside and not optic.distorts:
            return False
    black, white, mean, mean_squared, overlap = 0.0, 0.0, 0.0, 0.0, 0.0
    black_moment, white_moment, moment = 0.0, 0.0, 0.0  # about the middle of the edge
    step = 2.0 * reach / (SAMPLES - 1)
    spread, beside = spread_of(blur_px, module, reach), NEIGHBOUR_MODULES * module
    for i in range(SECTIONS):
        s = END_SHARE + _STEP * i
        middle_x, middle_y = x0 + s * along_x, y0 + s * along_y
        foot_x, foot_y = middle_x - reach * nx, middle_y - reach * ny
        total, inner, outer, squares = 0.0, 0.0, 0.0, 0.0
        for k in range(SAMPLES):
            x, y = foot_x + k * step * nx, foot_y + k * step * ny
            if optic.distorts:
                x, y = distorted(optic, x, y)
                if not (0.0 <= x <= width - 1.0 and 0.0 <= y <= height - 1.0):
                    return False
            grey = grey_at(pixels, x, y)
            total += grey
            squared = grey * grey
            # The mean of two samples at either end is the level on that side. The trapezium rule counts
            # the outermost samples half.
            if k < 2:
                inner += grey
            elif k > SAMPLES - 3:
                outer += grey
            if k == 0 or k == SAMPLES - 1:
                total -= 0.5 * grey
                squared *= 0.5
            squares += squared
        inner, outer, total = 0.5 * inner, 0.5 * outer, total / (SAMPLES - 1)
        overlap += (inner + outer) * total - squares / (SAMPLES - 1) - inner * outer
        if spread.reached:
            inside = grey_beside(pixels, middle_x - beside * nx, middle_y - beside * ny, optic)
            outside = grey_beside(pixels, middle_x + beside * nx, middle_y + beside * ny, optic)
            inner, outer, total = without_neighbours(spread, inner, outer, total, inside, outside)
        black, white, mean = black + inner, white + outer, mean + total
        black_moment += inner * (s - 0.5)
        white_moment += outer * (s - 0.5)
        moment += total * (s - 0.5)
        mean_squared += total * total
    black, white, mean = black / SECTIONS, white / SECTIONS, mean / SECTIONS
    contrast = white - black
    if not contrast > LEAST_CONTRAST:
        return False
    # The mean brightness of a section is the share of white, which is the distance of the border from the
    # outer end. A straight line is fitted through these distances. Light that is uneven along the edge
    # changes both levels in proportion: a section is compared with the levels where it lies. Compared with
    # the means of the edge, 5 % more light at one end would turn the edge by as much as 0.3 px. A section
    # that is shorter than the blurred edge shows only a part of the shift.
    per_grey = 2.0 * reach / (contrast * max(spread.gain, LEAST_GAIN))
    light = (black * black_moment + white * white_moment) / (SQUARES * (black * black + white * white))
    level = per_grey * (0.5 * (black + white) - mean)
    slope = -per_grey * (moment / SQUARES - light * mean)
    # What the cross sections leave of a line, and how wide the edge is.
    left = max(mean_squared - SECTIONS * mean * mean - moment * moment / SQUARES, 0.0)
    residual = (2.0 * reach / (contrast * spread.gain)) ** 2 * left / (SECTIONS - 2)
    overlap *= 2.0 * reach / (SECTIONS * contrast * contrast)
    variances[e] = section_variance(residual, overlap, reach, _STEP * length, blur_px)
    at_a, at_b = level - 0.5 * slope, level + 0.5 * slope
    a[e, 0], a[e, 1] = x0 + at_a * nx, y0 + at_a * ny
    b[e, 0], b[e, 1] = x0 + along_x + at_b * nx, y0 + along_y + at_b * ny
    return True
