"""Visible shapes on moving frames, and the flat arrays that the kernels make pictures of them from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from msrr_bullet.render.raster.faces import faces_of
from msrr_bullet.render.raster.kernels.enclosed import turn_enclosed_faces
from msrr_bullet.render.raster.kernels.records import CELLS, REGION_BITS, SMOOTH, TEXTURED, Geometry, Textures
from msrr_bullet.render.raster.mesh import Mesh
from msrr_bullet.render.raster.texture import Texture
from msrr_scenes.errors import GeometryError
from msrr_scenes.geometry.se3 import SE3

_MOST_FACES = 1 << (31 - REGION_BITS)


@dataclass(frozen=True, eq=False)
class VisualShape:
    """A visible shape on a moving frame.

    Attributes:
        frame: Number of the moving frame M that carries the shape.
        X_MG: Pose of the mesh's own frame G in M.
        mesh: Triangles [m].
        grey: Reflectance, 0 to 1.
        texture: Texture that multiplies ``grey``, or None.
    """

    frame: int
    X_MG: SE3
    mesh: Mesh
    grey: float
    texture: Texture | None = None


def assemble(shapes: Sequence[VisualShape]) -> tuple[Geometry, Textures]:
    """Return all faces in their moving frames, and the textures that they show.

    Raises:
        GeometryError: There are more faces than identities.
    """
    all_faces = [faces_of(shape.mesh) for shape in shapes]
    vertex_start, face_start, corner_start, smooth_start, surface_start = (
        np.cumsum([0, *counts], dtype=np.int64)
        for counts in (
            [len(f.vertices) for f in all_faces],
            [len(f.planes) for f in all_faces],
            [len(f.corners) for f in all_faces],
            [int(f.smooth.sum()) for f in all_faces],
            [int(f.surface.max(initial=-1)) + 1 for f in all_faces],
        )
    )
    if face_start[-1] >= _MOST_FACES:
        raise GeometryError(f"{face_start[-1]} faces are more than the raster renderer can tell apart")
    textures = list(dict.fromkeys(shape.texture for shape in shapes if shape.texture is not None))
    numbers = {texture: number for number, texture in enumerate(textures)}
    number = np.array([numbers[s.texture] if s.texture else -1 for s in shapes], dtype=np.int64)
    packed = _packed(textures)
    # Number of the shape of each vertex, face, corner and smooth face.
    of_vertex, of_face, of_corner, of_smooth = (
        np.repeat(np.arange(len(shapes)), np.diff(start))
        for start in (vertex_start, face_start, corner_start, smooth_start)
    )
    R = np.array([shape.X_MG.R for shape in shapes]).reshape(-1, 3, 3)
    p = np.array([shape.X_MG.p for shape in shapes]).reshape(-1, 3)
    vertices = np.einsum("nij,nj->ni", R[of_vertex], _joined([f.vertices for f in all_faces], (3,)))
    vertices += p[of_vertex]
    smooth = _joined([f.smooth for f in all_faces], (), np.bool_)
    across = _joined([f.across for f in all_faces], (), np.int64)
    surface = _joined([f.surface for f in all_faces], (), np.int64)
    normals = _joined([f.corner_normals for f in all_faces], (3, 3))[smooth]
    weights = _joined([f.weights for f in all_faces], (2, 4))[smooth]
    smooth_row = np.full(len(smooth), -1, dtype=np.int64)
    smooth_row[smooth] = np.arange(int(smooth.sum()))
    grey = np.array([255.0 * shape.grey for shape in shapes])
    kinds = np.array([_kind(shape.texture) for shape in shapes], dtype=np.int64)
    geometry = Geometry(
        shape_frame=np.array([shape.frame for shape in shapes], dtype=np.int64),
        shape_ball=_balls(vertices, vertex_start),
        shape_vertex=vertex_start,
        shape_face=face_start,
        vertices=vertices,
        corner_start=np.append(
            _joined([f.start[:-1] for f in all_faces], (), np.int64) + corner_start[of_face], corner_start[-1]
        ),
        corners=_joined([f.corners for f in all_faces], (), np.int64) + vertex_start[of_corner],
        across=np.where(across >= 0, across + face_start[of_corner], -1),
        planes=_transformed(_joined([f.planes for f in all_faces], (4,)), R[of_face], p[of_face], sign=1.0),
        grey=grey[of_face],
        kind=kinds[of_face] | np.where(smooth, SMOOTH, 0),
        smooth=smooth_row,
        corner_normals=np.einsum("nij,nkj->nki", R[of_smooth], normals),
        weights=_transformed(weights, R[of_smooth], p[of_smooth], sign=-1.0),
        uv=_transformed(_joined([f.uv for f in all_faces], (2, 4)), R[of_face], p[of_face], sign=-1.0),
        texture=number[of_face],
        surface=np.where(surface >= 0, surface + surface_start[of_face], -1),
        cells=_cells(number[of_face], textures, packed),
    )
    # One layout, whatever led to it: the kernels are compiled for rows that lie one after another.
    geometry = Geometry._make(np.ascontiguousarray(column) for column in geometry)
    planes = geometry.planes.copy()
    turn_enclosed_faces(geometry, planes)
    return geometry._replace(planes=planes), packed


def _joined(parts: Sequence[np.ndarray], row: tuple[int, ...], kind: type = np.float64) -> np.ndarray:
    """Return arrays of rows of the shape ``row`` as one array, which is empty if there are none."""
    return np.concatenate([np.empty((0, *row), dtype=kind), *parts])


def _balls(vertices: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Return centre and radius of a ball around each visual shape, shape (S, 4); each one has vertices."""
    if len(start) == 1:
        return np.empty((0, 4))
    first = start[:-1]
    low, high = np.minimum.reduceat(vertices, first), np.maximum.reduceat(vertices, first)
    middle = 0.5 * (low + high)
    away = vertices - np.repeat(middle, np.diff(start), axis=0)
    radius = np.sqrt(np.maximum.reduceat((away * away).sum(axis=1), first))
    return np.column_stack([middle, radius])


def _cells(numbers: np.ndarray, textures: list[Texture], packed: Textures) -> np.ndarray:
    """Return the bitmap of each face for :attr:`Geometry.cells`, shape (F, 4)."""
    regions = np.cumsum([0, *(len(t.region_grey) if t.regions is not None else 0 for t in textures)])
    table = np.column_stack([packed.levels[packed.level_start[:-1]], regions[:-1]])
    out = np.zeros((len(numbers), 4), dtype=np.int64)
    out[numbers >= 0] = table[numbers[numbers >= 0]]
    return out


def _transformed(functions: np.ndarray, R: np.ndarray, p: np.ndarray, sign: float) -> np.ndarray:
    """Move affine functions ``g . p + g0`` (planes ``n . p = d``: ``sign`` +1) from frames G to M.

    The functions have shape (N, ..., 4); R, (N, 3, 3), and p, (N, 3) [m], are rotations and origins of the
    frames G in M.
    """
    out = np.empty_like(functions)
    out[..., :3] = np.einsum("nij,n...j->n...i", R, functions[..., :3])
    out[..., 3] = functions[..., 3] + sign * np.einsum("n...i,ni->n...", out[..., :3], p)
    return out


def _kind(texture: Texture | None) -> int:
    if texture is None:
        return 0
    return TEXTURED | (CELLS if texture.regions is not None else 0)


def _packed(textures: list[Texture]) -> Textures:
    """Return textures as flat arrays."""
    levels = [level for texture in textures for level in texture.levels]
    edges = np.array([level.shape for level in levels], dtype=np.int64).reshape(-1, 2)
    sizes = edges.prod(axis=1)
    return Textures(
        level_start=np.cumsum([0, *(len(texture.levels) for texture in textures)], dtype=np.int64),
        levels=np.column_stack([np.cumsum(sizes) - sizes, edges]),
        texels=_joined([level.ravel() for level in levels], (), np.float32),
        regions=_joined(
            [
                (np.zeros(level.shape, dtype=np.int64) if t.regions is None else t.regions).ravel()
                for t in textures
                for level in t.levels
            ],
            (),
            np.int64,
        ),
        region_grey=_joined([t.region_grey for t in textures if t.regions is not None], (), np.float32),
    )
