"""What the kernels hand each other: arrays by name, and what their rows mean.

A form (a, b, c) is ``a u + b v + c`` at (u, v) of the image, pixels counted from their edges. W is the world,
C the camera, M a mover: a frame on which shapes are fixed.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from msrr_scenes.arrays import Array

Short = NDArray[np.float32]
Indices = NDArray[np.int64]
Identities = NDArray[np.int32]
Pixels = NDArray[np.uint8]
Texels = NDArray[np.uint32]

#: What the grey of a face follows: bits of ``kind``. None: it is the same all over.
SMOOTH, TEXTURED, CELLS = 1, 2, 4

#: What is seen at a place: ``face << REGION_BITS | region``, or one of these.
FLOOR, WALL = -1, -2
REGION_BITS = 10


class Geometry(NamedTuple):
    """All faces of the world in the frames of the movers M that carry them.

    Shapes (S) belong to movers, faces (F) and vertices (V) to shapes, in order.
    """

    shape_mover: Indices  # (S,)
    shape_ball: Array  # (S, 4) centre and radius in M [m]
    shape_vertex: Indices  # (S + 1,)
    shape_face: Indices  # (S + 1,)
    vertices: Array  # (V, 3) in M [m]
    corner_start: Indices  # (F + 1,)
    corners: Indices  # vertex of each corner
    across: Indices  # face of the same round surface across the edge that ends at the corner, or -1
    planes: Array  # (F, 4) outward normal and offset in M
    grey: Array  # (F,) reflectance times 255
    kind: Indices  # (F,)
    smooth: Indices  # (F,) row in the next two, where SMOOTH
    corner_normals: Array  # (., 3, 3)
    weights: Array  # (., 2, 4)
    uv: Array  # (F, 2, 4) where TEXTURED
    texture: Indices  # (F,) texture number
    surface: Indices  # (F,) round surface that the face is part of, or -1
    cells: Indices  # (F, 4) first texel, rows, columns, first region, where CELLS


class Textures(NamedTuple):
    """All textures, level by level; reflectance 0 to 1."""

    first_level: Indices  # (T,) of each texture
    level_count: Indices  # (T,)
    level_start: Indices  # (L,) in texels
    level_rows: Indices  # (L,)
    level_columns: Indices  # (L,)
    texels: Short  # all levels, row by row
    regions: Indices  # of each texel, where the texture has cells: where to find its region's reflectance
    region_grey: Short


class View(NamedTuple):
    """Camera and window: f, W / 2, H / 2, window x, y, width, height, near."""

    focal: float
    middle_x: float
    middle_y: float
    x: int
    y: int
    width: int
    height: int
    near: float


class Light(NamedTuple):
    """A distant light and the coefficients of ``ambient + diffuse * max(0, n . direction)``."""

    direction: Array  # (3,) unit vector towards the light, in W
    ambient: float
    diffuse: float


class Ground(NamedTuple):
    """A floor as the kernels see it."""

    texels: Texels  # all blends, finest first, row by row
    start: Indices  # (B,) first texel of each blend
    bits: Indices  # (B,) binary logarithm of its edge
    mean: float
    wall: float
    per_metre: float  # finest texels per metre


class GroundView(NamedTuple):
    """A floor seen from a camera.

    With t the descent of a pixel's ray, x / t and y / t are the point of the floor in finest texels.
    """

    forms: Array  # (3, 3) forms of x, y and t over the image
    scale: float  # footprint across a ray that falls plumb [texels]
    lean: float  # sine of the angle between optical axis and plumb line
    stride: int  # pixels of a row that share one blend, aligned to the frame


class Faces(NamedTuple):
    """The faces in view."""

    inverse_depth: Array  # (N, 3) form of 1 / z [1/m]
    nearest: Array  # (N,) largest 1 / z on the face
    box: Array  # (N, 4) bounds u0, u1, v0, v1 [px]
    edge_start: Indices  # (N + 1,)
    edges: Array  # (., 5) forms, inside where all >= 0; where a != 0: -b / a and -c / a, so that u = s v + t
    inner: NDArray[np.bool_]  # (.,) edges beyond which the same round surface goes on and is seen
    grey: Array  # (N,) grey level; where TEXTURED: of white
    shade: Array  # (N, 3) form of grey / z, where SMOOTH
    uv: Array  # (N, 2, 3) forms of texture coordinates / z
    kind: Indices  # (N,)
    texture: Indices  # (N,)
    surface: Indices  # (N,)
    cells: Indices  # (N, 4)


class Corners(NamedTuple):
    """The corners of the window's pixels, (height + 1, width + 1), and what lies between them."""

    depth: Short  # 1 / z of the nearest face [1/m]
    identity: Identities
    sliver: Short  # (height, width) largest 1 / z of a face that has an edge in the pixel, or 0


class Scratch(NamedTuple):
    """Memory for one row of pixels."""

    flags: Pixels  # a multiple of 8 of them, which are looked at together
    place: Identities  # of texels
    x: Short
    y: Short


class Samples(NamedTuple):
    """The open pixels (P) of a band of rows, and their samples (S)."""

    start: Indices  # (height + 1,) first open pixel of each row
    column: Identities  # (P,) from the window's left
    key: Indices  # (P, S) depth and identity of the nearest face in one number
    farthest: Indices  # (P,) smallest of ``key``


class Work(NamedTuple):
    """Memory of a frame; see :mod:`msrr_bullet.render.raster.kernels.workspace`."""

    R_CM: Array  # (M, 3, 3) movers seen from the camera
    p_CM: Array  # (M, 3)
    R_WM: Array  # (M, 3, 3)
    seen: Array  # (V, 5) vertices in C, and in the image
    faces: Faces
    corners: Corners
    scratch: Scratch
    samples: Samples
