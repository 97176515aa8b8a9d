"""Corners of a tag to a few hundredths of a pixel: straight lines through its four black edges, intersected.

The AprilTag library samples whole pixels along each edge, which leaves a bias of some 0.05 px that depends on
the edge's direction. Here the image is interpolated, each cross section gives the place where the grey level
passes from black to white as an area (unbiased under any symmetric blur), and a line is fitted through all of
them.
"""

from __future__ import annotations

import numpy as np

from msrr_perception.kernels import edges
from msrr_scenes.arrays import Array
from msrr_scenes.messages import Pixels

#: How often the lines are drawn anew from the corners that the last ones gave. Where the cross sections lie
#: follows from the guess; the second time they lie where they should, and it hardly matters who guessed.
_PASSES = 2


def refine_corners(pixels: Pixels, corners: Array) -> Array:
    """Return tag corners moved to the intersections of their edges.

    Args:
        pixels: Mono8 image, shape (height, width).
        corners: Corners of T tags, shape (T, 4, 2), in pixels of this image counted from pixel centres, in
            either sense of rotation.

    Returns:
        Shape (T, 4, 2). A tag that has an edge with too little contrast, too near the image's border, or too
        far from where it should be keeps its corners.
    """
    # One layout, so that the kernel is compiled once: what the camera gives is in one piece and read-only.
    whole = np.ascontiguousarray(pixels)[:]
    whole.setflags(write=False)
    refined: Array = np.ascontiguousarray(corners, dtype=np.float64)
    for _ in range(_PASSES):
        refined = edges.refine(whole, refined)
    return refined
