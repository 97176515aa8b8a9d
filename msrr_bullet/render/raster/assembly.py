"""From looks to the flat arrays that the kernels work on."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from msrr_bullet.render.raster.faces import faces_of
from msrr_bullet.render.raster.kernels.records import CELLS, REGION_BITS, SMOOTH, TEXTURED, Geometry, Textures
from msrr_bullet.render.raster.look import VisualShape
from msrr_bullet.render.raster.texture import Texture
from msrr_scenes.errors import GeometryError

_MOST_FACES = 1 << (31 - REGION_BITS)


def assemble(looks: Sequence[VisualShape]) -> tuple[Geometry, Textures]:
    """Return all faces in their movers' frames, and the textures they show.

    Raises:
        GeometryError: More faces than identities.
    """
    all_faces = [faces_of(look.mesh) for look in looks]
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
    textures: list[Texture] = []
    number = np.array([_number(look.texture, textures) for look in looks], dtype=np.int64)
    packed = _packed(textures)
    # Shape of each vertex, face, corner and smooth face, and where each shape lies.
    of_vertex, of_face, of_corner, of_smooth = (
        np.repeat(np.arange(len(looks)), np.diff(start))
        for start in (vertex_start, face_start, corner_start, smooth_start)
    )
    R = _stacked([look.X_MG.R for look in looks], (3, 3))
    p = _stacked([look.X_MG.p for look in looks], (3,))
    vertices = np.einsum("nij,nj->ni", R[of_vertex], _joined([f.vertices for f in all_faces], (3,)))
    vertices += p[of_vertex]
    smooth = _joined([f.smooth for f in all_faces], (), np.bool_)
    across = _joined([f.across for f in all_faces], (), np.int64)
    surface = _joined([f.surface for f in all_faces], (), np.int64)
    normals = _joined([f.corner_normals for f in all_faces], (3, 3))[smooth]
    weights = _joined([f.weights for f in all_faces], (2, 4))[smooth]
    smooth_row = np.full(len(smooth), -1, dtype=np.int64)
    smooth_row[smooth] = np.arange(int(smooth.sum()))
    grey = np.array([255.0 * look.grey for look in looks])
    kinds = np.array([_kind(look.texture) for look in looks], dtype=np.int64)
    geometry = Geometry(
        shape_mover=np.array([look.mover for look in looks], dtype=np.int64),
        shape_ball=_balls(vertices, vertex_start),
        shape_vertex=vertex_start,
        shape_face=face_start,
        vertices=vertices,
        corner_start=np.append(
            _joined([f.start[:-1] for f in all_faces], (), np.int64) + corner_start[of_face], corner_start[-1]
        ),
        corners=_joined([f.corners for f in all_faces], (), np.int64) + vertex_start[of_corner],
        across=np.where(across >= 0, across + face_start[of_corner], -1),
        planes=_turned(_joined([f.planes for f in all_faces], (4,)), R[of_face], p[of_face], sign=1.0),
        grey=grey[of_face],
        kind=kinds[of_face] | np.where(smooth, SMOOTH, 0),
        smooth=smooth_row,
        corner_normals=np.einsum("nij,nkj->nki", R[of_smooth], normals),
        weights=_turned(weights, R[of_smooth], p[of_smooth], sign=-1.0),
        uv=_turned(_joined([f.uv for f in all_faces], (2, 4)), R[of_face], p[of_face], sign=-1.0),
        texture=number[of_face],
        surface=np.where(surface >= 0, surface + surface_start[of_face], -1),
        cells=_cells(number[of_face], textures, packed),
    )
    # One layout, whatever led to it: the kernels are compiled for rows that lie one after another.
    return Geometry._make(np.ascontiguousarray(column) for column in geometry), packed


def _joined(parts: Sequence[np.ndarray], row: tuple[int, ...], kind: type = np.float64) -> np.ndarray:
    """Return arrays of rows of one shape as one array; of none, an empty one."""
    return np.concatenate([np.empty((0, *row), dtype=kind), *parts])


def _stacked(parts: Sequence[np.ndarray], row: tuple[int, ...]) -> np.ndarray:
    return np.array(parts, dtype=np.float64).reshape(-1, *row)


def _balls(vertices: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Return centre and radius of a ball about each shape, shape (S, 4); every shape has vertices."""
    if len(start) == 1:
        return np.empty((0, 4))
    first = start[:-1]
    low, high = np.minimum.reduceat(vertices, first), np.maximum.reduceat(vertices, first)
    middle = 0.5 * (low + high)
    away = vertices - np.repeat(middle, np.diff(start), axis=0)
    radius = np.sqrt(np.maximum.reduceat((away * away).sum(axis=1), first))
    return np.column_stack([middle, radius])


def _cells(numbers: np.ndarray, textures: list[Texture], packed: Textures) -> np.ndarray:
    """Return each face's bitmap as :class:`Geometry` has it, shape (F, 4)."""
    regions = np.cumsum([0, *(len(t.region_grey) if t.regions is not None else 0 for t in textures)])
    first = packed.first_level
    table = np.stack(
        [packed.level_start[first], packed.level_rows[first], packed.level_columns[first], regions[:-1]],
        axis=1,
    )
    out = np.zeros((len(numbers), 4), dtype=np.int64)
    out[numbers >= 0] = table[numbers[numbers >= 0]]
    return out


def _turned(functions: np.ndarray, R: np.ndarray, p: np.ndarray, sign: float) -> np.ndarray:
    """Move affine functions ``g . p + g0`` (planes ``n . p = d``: ``sign`` +1) from frames G to M.

    Args:
        functions: Shape (N, ..., 4).
        R: Rotation of each G in M, shape (N, 3, 3).
        p: Its origin, shape (N, 3) [m].
        sign: Of what is added to the last entry.
    """
    out = np.empty_like(functions)
    out[..., :3] = np.einsum("nij,n...j->n...i", R, functions[..., :3])
    out[..., 3] = functions[..., 3] + sign * np.einsum("n...i,ni->n...", out[..., :3], p)
    return out


def _kind(texture: Texture | None) -> int:
    if texture is None:
        return 0
    return TEXTURED | (CELLS if texture.regions is not None else 0)


def _number(texture: Texture | None, known: list[Texture]) -> int:
    if texture is None:
        return -1
    for number, other in enumerate(known):
        if other is texture:
            return number
    known.append(texture)
    return len(known) - 1


def _packed(textures: list[Texture]) -> Textures:
    levels = [level for texture in textures for level in texture.levels]
    counts = np.array([len(texture.levels) for texture in textures], dtype=np.int64)
    sizes = np.array([level.size for level in levels], dtype=np.int64)
    return Textures(
        first_level=np.cumsum(counts) - counts,
        level_count=counts,
        level_start=np.cumsum(sizes) - sizes,
        level_rows=np.array([level.shape[0] for level in levels], dtype=np.int64),
        level_columns=np.array([level.shape[1] for level in levels], dtype=np.int64),
        texels=_flat([level for t in textures for level in t.levels], np.float32),
        regions=_flat(
            [
                t.regions if t.regions is not None else np.zeros(level.shape)
                for t in textures
                for level in t.levels
            ],
            np.int64,
        ),
        region_grey=_flat([t.region_grey for t in textures if t.regions is not None], np.float32),
    )


def _flat(parts: list[np.ndarray], kind: type) -> np.ndarray:
    return np.concatenate([np.empty(0), *(part.reshape(-1) for part in parts)]).astype(kind)
