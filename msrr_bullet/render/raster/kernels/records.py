"""Named arrays that the kernels hand to each other.

A form (a, b, c) is the function ``a u + b v + c`` of the image point (u, v), where pixel i spans [i, i + 1].
W is the world, C the camera, M a moving frame: a frame on which shapes are fixed.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from msrr_scenes.arrays import Array
from msrr_scenes.messages import Pixels

Floats = NDArray[np.float32]
Indices = NDArray[np.int64]
Identities = NDArray[np.int32]
Texels = NDArray[np.uint32]

#: Numbers of texels. In numba a negative index counts from the end of an array, so a loop over a signed index
#: becomes poor vector code, or none: these numbers, and the columns that long loops go through, are unsigned.
TexelNumbers = NDArray[np.uint32]

#: Bits of ``kind``: what the grey level of a face depends on. Without any bit it is constant.
SMOOTH, TEXTURED, CELLS = 1, 2, 4

#: Identity of what is seen at a point: ``face << REGION_BITS | region``, or one of these two.
FLOOR, WALL = -1, -2
REGION_BITS = 10


class Geometry(NamedTuple):
    """All faces of the world in the moving frames that carry them.

    Every shape (S) belongs to a moving frame, every face (F) and vertex (V) to a shape, in that order.
    """

    shape_frame: Indices  # (S,)
    shape_ball: Array  # (S, 4) centre and radius of a ball around the shape, in M [m]
    shape_vertex: Indices  # (S + 1,) first vertex
    shape_face: Indices  # (S + 1,) first face
    vertices: Array  # (V, 3) in M [m]
    corner_start: Indices  # (F + 1,) first corner
    corners: Indices  # vertex of each corner
    across: Indices  # face of the same round surface across the edge that ends at the corner, or -1
    planes: Array  # (F, 4) outward normal and offset in M
    grey: Array  # (F,) reflectance times 255
    kind: Indices  # (F,)
    smooth: Indices  # (F,) row in the next two arrays, where SMOOTH
    corner_normals: Array  # (., 3, 3)
    weights: Array  # (., 2, 4)
    uv: Array  # (F, 2, 4) where TEXTURED
    texture: Indices  # (F,) texture number
    surface: Indices  # (F,) round surface that the face is part of, or -1
    cells: Indices  # (F, 4) first texel, rows, columns, first region, where CELLS


class Textures(NamedTuple):
    """All textures, level by level, as reflectances from 0 to 1."""

    level_start: Indices  # (T + 1,) first level of each texture
    levels: Indices  # (L, 3) first texel, rows, columns
    texels: Floats  # all levels, row by row
    regions: Indices  # region of each texel of a texture with cells
    region_grey: Floats  # reflectance of each region


class View(NamedTuple):
    """The intrinsics of the camera, the near plane, and bounds of what is drawn.

    The bounds are those of the window's pixels in the image of an ideal lens.
    """

    focal: float  # [px]
    middle_x: float  # column of the principal point from the left edge of the frame [px]
    middle_y: float  # its row from the upper edge [px]
    x: int  # the bounds, in pixels of the frame
    y: int
    width: int
    height: int
    near: float  # [m]


class LensParameters(NamedTuple):
    """Intrinsics of a camera and the distortion of its lens, by Brown and Conrady."""

    focal: float  # [px]
    cx: float  # principal point, counted from the middle of the first pixel [px]
    cy: float
    k1: float
    k2: float
    p1: float
    p2: float
    k3: float
    aspect: float  # fy over fx


class PixelGrid(NamedTuple):
    """The corners of the window's pixels: their places in the image of an ideal lens.

    u grows along every row and v along every column. Where the lens is ideal, u and v are whole numbers,
    column and row of the first corner; :mod:`.grid` reads either kind.
    """

    width: int
    height: int
    u: Array | int  # (height + 1, width + 1) columns, counted from the edge of the frame [px]
    v: Array | int  # (height + 1, width + 1) rows
    v_low: Array | int  # (height + 1,) least v of each row of corners
    v_high: Array | int  # (height + 1,) greatest
    shift: float  # most by which u differs from that of the corner below
    pitch: float  # least by which u differs from that of the corner to the right
    slant: float  # most by which v differs from that of the corner to the right
    column: int  # first column of the window in the frame
    group_u: Array | float  # (height, groups) middles of the groups of pixels that share a blend of the floor
    group_v: Array | float  # (height, groups); where the lens is ideal, the middle of the first group


class Light(NamedTuple):
    """A distant light and the coefficients of ``ambient + diffuse * max(0, n . direction)``."""

    direction: Array  # (3,) unit vector towards the light, in W
    ambient: float
    diffuse: float


class FloorTexture(NamedTuple):
    """The texture of the floor, filtered to a series of footprints, and the wall behind it."""

    texels: Texels  # all blends, finest first, row by row; the neighbours' greys in the higher bytes
    start: Indices  # (B,) first texel of each blend
    bits: Indices  # (B,) binary logarithm of each blend's edge
    wall: float
    per_metre: float  # finest texels per metre


class FloorView(NamedTuple):
    """The floor as seen from a camera.

    With t the descent of a pixel's ray, (x / t, y / t) is the point of the floor in finest texels.
    """

    forms: Array  # (3, 3) forms of x, y and t
    scale: float  # footprint across a ray that falls plumb [texels]
    lean: float  # sine of the angle between optical axis and plumb line


class ProjectedFaces(NamedTuple):
    """The faces that may be seen in the window."""

    inverse_depth: Array  # (N, 3) form of 1 / z [1/m]
    nearest: Array  # (N,) largest 1 / z on the face
    box: Array  # (N, 4) bounds u0, u1, v0, v1 [px]
    edge_start: Indices  # (N + 1,)
    edges: Array  # (., 3) forms, inside where all >= 0
    inner: NDArray[np.bool_]  # (.,) edges beyond which the same round surface goes on and is seen
    grey: Array  # (N,) grey level; where TEXTURED: of white
    shade: Array  # (N, 3) form of grey / z, where SMOOTH
    uv: Array  # (N, 2, 3) forms of texture coordinates / z
    kind: Indices  # (N,)
    texture: Indices  # (N,)
    surface: Indices  # (N,)
    cells: Indices  # (N, 4)
    spans: Indices  # (N, 4) first row and row after the last, columns likewise, of pixels of a band


class Corners(NamedTuple):
    """The corners of the band's pixels, shape (height + 1, width + 1), and what lies between them."""

    depth: Floats  # 1 / z of the nearest face [1/m]
    identity: Identities
    edge_depth: Floats  # (height, width) largest 1 / z of a face that has an edge in the pixel, or 0


class RowBuffers(NamedTuple):
    """Memory for one row of pixels."""

    flags: Pixels  # a multiple of 8 of them, which are looked at together
    texel: TexelNumbers  # the texel up and left of what each pixel shows
    x: Floats  # offset from that texel
    y: Floats


class Samples(NamedTuple):
    """The mixed pixels (P) of a band of rows, and their samples (S)."""

    start: Indices  # (height + 1,) first mixed pixel of each row
    column: Identities  # (P,) from the window's left
    key: Indices  # (P, S) depth and identity of the nearest face in one number
    farthest: Indices  # (P,) smallest of ``key``
    maps: Array  # (P + 1, 6) see :mod:`.pixel_map`; where the lens distorts


class Workspace(NamedTuple):
    """Memory of a frame."""

    R_CM: Array  # (M, 3, 3) moving frames seen from the camera
    p_CM: Array  # (M, 3)
    R_WM: Array  # (M, 3, 3)
    projected: Array  # (V, 5) vertices in C [m], and in the image [px]
    faces: ProjectedFaces
    corners: Corners
    row: RowBuffers
    samples: Samples
