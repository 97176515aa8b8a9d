"""Corners of a tag to a few hundredths of a pixel: lines fitted to its four black edges, intersected.

The AprilTag library samples whole pixels along each edge, which leaves a bias of some 0.05 px that depends on
the edge's direction. Here the image is interpolated, each cross section gives the place where the grey level
passes from black to white as an area (unbiased under any symmetric blur), and a line is fitted through all of
them.
"""

from __future__ import annotations

import math

import numpy as np

from msrr_perception.kernels.compiled import kernel
from msrr_scenes.arrays import Array
from msrr_scenes.messages import Pixels

#: How often the lines are fitted, each time from the corners that the last lines gave. The cross sections lie
#: where the guess puts them; the second time they lie on the edges, and the first guess hardly matters.
PASSES = 2

#: Cross sections per edge, and the share of the edge left out at either end (corners are rounded).
SECTIONS = 16
END_SHARE = 0.12

#: Half-length of a cross section in modules (bits) of the tag, its bounds in pixels, and its samples.
REACH_MODULES = 0.7
LEAST_REACH_PX, GREATEST_REACH_PX = 1.5, 3.0
SAMPLES = 13

#: Largest shift of an edge [px]; one that would move farther is not the edge of a printed square.
LARGEST_SHIFT_PX = 1.5

#: Least mean contrast across an edge [grey levels].
LEAST_CONTRAST = 8.0


def refine_corners(pixels: Pixels, corners: Array) -> Array:
    """Return tag corners moved to the intersections of the tags' edges.

    Args:
        pixels: Mono8 image, shape (height, width).
        corners: Corners of T tags, shape (T, 4, 2), in pixels of this image counted from pixel centres, in
            either sense of rotation.

    Returns:
        Shape (T, 4, 2). A tag that has an edge with too little contrast, too near the image's border, or too
        far from where it should be keeps its corners.
    """
    # One memory layout, so that the kernel is compiled once: contiguous and read-only, as a camera gives it.
    image = np.ascontiguousarray(pixels)[:]
    image.setflags(write=False)
    refined: Array = np.ascontiguousarray(corners, dtype=np.float64)
    for _ in range(PASSES):
        refined = intersect_edges(image, refined)
    return refined


@kernel
def intersect_edges(pixels: Pixels, corners: Array) -> Array:
    """Return the corners, shape (T, 4, 2), after one fit of the edges; see :func:`refine_corners`."""
    out = corners.copy()
    height, width = pixels.shape
    grey = np.empty((SECTIONS, SAMPLES))
    a, b = np.empty((4, 2)), np.empty((4, 2))  # the ends of each edge, moved
    for t in range(corners.shape[0]):
        middle_x = 0.25 * (corners[t, 0, 0] + corners[t, 1, 0] + corners[t, 2, 0] + corners[t, 3, 0])
        middle_y = 0.25 * (corners[t, 0, 1] + corners[t, 1, 1] + corners[t, 2, 1] + corners[t, 3, 1])
        ok = True
        for e in range(4):
            x0, y0 = corners[t, e, 0], corners[t, e, 1]
            x1, y1 = corners[t, (e + 1) % 4, 0], corners[t, (e + 1) % 4, 1]
            along_x, along_y = x1 - x0, y1 - y0
            length = math.hypot(along_x, along_y)
            nx, ny = along_y / length, -along_x / length
            if (x0 - middle_x) * nx + (y0 - middle_y) * ny < 0.0:
                nx, ny = -nx, -ny
            # The extent of the tag across this edge gives the width of a module there.
            next_x = corners[t, (e + 2) % 4, 0] - x1
            next_y = corners[t, (e + 2) % 4, 1] - y1
            after = math.hypot(next_x, next_y)
            before = math.hypot(x0 - corners[t, (e + 3) % 4, 0], y0 - corners[t, (e + 3) % 4, 1])
            slant = abs(next_x * nx + next_y * ny) / after
            reach = REACH_MODULES * 0.5 * (before + after) * slant / 8.0
            reach = min(max(reach, LEAST_REACH_PX), GREATEST_REACH_PX)
            for i in range(2):  # the ends of the outermost sections bound all samples
                s = END_SHARE if i == 0 else 1.0 - END_SHARE
                foot_x, foot_y = x0 + s * along_x, y0 + s * along_y
                ok = ok and min(foot_x - reach * nx, foot_x + reach * nx) >= 0.0
                ok = ok and max(foot_x - reach * nx, foot_x + reach * nx) <= width - 1.0
                ok = ok and min(foot_y - reach * ny, foot_y + reach * ny) >= 0.0
                ok = ok and max(foot_y - reach * ny, foot_y + reach * ny) <= height - 1.0
            if not ok:
                break
            black, white = 0.0, 0.0
            for i in range(SECTIONS):
                s = END_SHARE + (1.0 - 2.0 * END_SHARE) / (SECTIONS - 1) * i
                foot_x, foot_y = x0 + s * along_x, y0 + s * along_y
                for k in range(SAMPLES):
                    offset = reach * (2.0 * k / (SAMPLES - 1) - 1.0)
                    x, y = foot_x + offset * nx, foot_y + offset * ny
                    column = min(max(int(x), 0), width - 2)
                    row = min(max(int(y), 0), height - 2)
                    ax, ay = x - column, y - row
                    upper = pixels[row, column] + ax * (
                        float(pixels[row, column + 1]) - float(pixels[row, column])
                    )
                    lower = pixels[row + 1, column] + ax * (
                        float(pixels[row + 1, column + 1]) - float(pixels[row + 1, column])
                    )
                    grey[i, k] = upper + ay * (lower - upper)
                black += grey[i, 0] + grey[i, 1]
                white += grey[i, SAMPLES - 2] + grey[i, SAMPLES - 1]
            black, white = black / (2 * SECTIONS), white / (2 * SECTIONS)
            contrast = white - black
            if not contrast > LEAST_CONTRAST:
                ok = False
                break
            # Fit a straight line through the places where the cross sections turn from black to white.
            level, slope, squares = 0.0, 0.0, 0.0
            for i in range(SECTIONS):
                # The mean brightness by the trapezium rule is the share of white, which is the distance of
                # the border from the outer end.
                total = 0.5 * (grey[i, 0] + grey[i, SAMPLES - 1])
                for k in range(1, SAMPLES - 1):
                    total += grey[i, k]
                shift = reach * (1.0 - 2.0 * (total / (SAMPLES - 1) - black) / contrast)
                place = END_SHARE + (1.0 - 2.0 * END_SHARE) / (SECTIONS - 1) * i - 0.5
                level += shift
                slope += shift * place
                squares += place * place
            level, slope = level / SECTIONS, slope / squares
            if not abs(level) + 0.5 * abs(slope) < LARGEST_SHIFT_PX:
                ok = False
                break
            a[e, 0], a[e, 1] = x0 + (level - 0.5 * slope) * nx, y0 + (level - 0.5 * slope) * ny
            b[e, 0], b[e, 1] = x1 + (level + 0.5 * slope) * nx, y1 + (level + 0.5 * slope) * ny
        if ok:
            for e in range(4):  # intersect each edge's line with the one before it
                p = (e + 3) % 4
                dx, dy = b[e, 0] - a[e, 0], b[e, 1] - a[e, 1]
                ex, ey = b[p, 0] - a[p, 0], b[p, 1] - a[p, 1]
                rx, ry = a[e, 0] - a[p, 0], a[e, 1] - a[p, 1]
                part = (rx * dy - ry * dx) / (ex * dy - ey * dx)
                out[t, e, 0], out[t, e, 1] = a[p, 0] + part * ex, a[p, 1] + part * ey
    return out
