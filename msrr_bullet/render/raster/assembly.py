"""From looks to the flat arrays that the kernels work on."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from msrr_bullet.render.raster.faces import Faces, faces_of
from msrr_bullet.render.raster.look import Look
from msrr_bullet.render.raster.records import CELLS, REGION_BITS, SMOOTH, TEXTURED, Geometry, Textures
from msrr_bullet.render.raster.texture import Texture
from msrr_scenes.errors import GeometryError

_MOST_FACES = 1 << (31 - REGION_BITS)


def assemble(looks: Sequence[Look]) -> tuple[Geometry, Textures]:
    """Return all faces in their movers' frames, and the textures they show.

    Raises:
        GeometryError: More faces than identities.
    """
    textures: list[Texture] = []
    columns: dict[str, list[np.ndarray]] = {name: [] for name in Geometry._fields}
    vertex_count = face_count = corner_count = smooth_count = surface_count = 0
    for look in looks:
        faces = faces_of(look.mesh)
        n = len(faces.planes)
        R, p = look.X_MG.R, look.X_MG.p
        vertices = faces.vertices @ R.T + p
        middle = 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))
        radius = np.linalg.norm(vertices - middle, axis=1).max()
        number = _number(look.texture, textures)
        rows = np.flatnonzero(faces.smooth)
        smooth_row = np.full(n, -1, dtype=np.int64)
        smooth_row[rows] = smooth_count + np.arange(len(rows))
        columns["shape_mover"].append(np.array([look.mover]))
        columns["shape_ball"].append(np.append(middle, radius)[None])
        columns["shape_vertex"].append(np.array([vertex_count]))
        columns["shape_face"].append(np.array([face_count]))
        columns["vertices"].append(vertices)
        columns["corner_start"].append(faces.start[:-1] + corner_count)
        columns["corners"].append(faces.corners + vertex_count)
        columns["across"].append(np.where(faces.across >= 0, faces.across + face_count, -1))
        columns["planes"].append(_turned(faces.planes, R, p, sign=1.0))
        columns["grey"].append(np.full(n, 255.0 * look.grey))
        columns["kind"].append(_kinds(faces, look.texture))
        columns["smooth"].append(smooth_row)
        columns["corner_normals"].append(faces.corner_normals[rows] @ R.T)
        columns["weights"].append(_turned(faces.weights[rows], R, p, sign=-1.0))
        columns["uv"].append(_turned(faces.uv, R, p, sign=-1.0))
        columns["texture"].append(np.full(n, number))
        columns["surface"].append(np.where(faces.surface >= 0, faces.surface + surface_count, -1))
        vertex_count += len(vertices)
        face_count += n
        corner_count += len(faces.corners)
        smooth_count += len(rows)
        surface_count += int(faces.surface.max(initial=-1)) + 1
    if face_count >= _MOST_FACES:
        raise GeometryError(f"{face_count} faces are more than the raster renderer can tell apart")
    for name, last in (
        ("shape_vertex", vertex_count),
        ("shape_face", face_count),
        ("corner_start", corner_count),
    ):
        columns[name].append(np.array([last]))
    packed = _packed(textures)
    numbers = np.concatenate([np.empty(0, np.int64), *columns["texture"]])
    columns["cells"] = [_cells(numbers, textures, packed)]
    return Geometry(**{name: _joined(name, parts) for name, parts in columns.items()}), packed


#: Shape of one row of each array of :class:`Geometry` that holds numbers; all others hold indices.
_ROWS: dict[str, tuple[int, ...]] = {
    "shape_ball": (4,),
    "vertices": (3,),
    "planes": (4,),
    "grey": (),
    "corner_normals": (3, 3),
    "weights": (2, 4),
    "uv": (2, 4),
}
_INDEX_ROWS: dict[str, tuple[int, ...]] = {"cells": (4,)}


def _joined(name: str, parts: list[np.ndarray]) -> np.ndarray:
    kind = np.float64 if name in _ROWS else np.int64
    row = _ROWS.get(name, _INDEX_ROWS.get(name, ()))
    return np.ascontiguousarray(
        np.concatenate([np.empty((0, *row)), *(part.reshape(-1, *row) for part in parts)]), dtype=kind
    )


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
    """Move affine functions ``g . p + g0`` (planes ``n . p = d``: ``sign`` +1) from frame G to M."""
    out = np.empty_like(functions)
    out[..., :3] = functions[..., :3] @ R.T
    out[..., 3] = functions[..., 3] + sign * (out[..., :3] @ p)
    return out


def _kinds(faces: Faces, texture: Texture | None) -> np.ndarray:
    kind = np.where(faces.smooth, SMOOTH, 0)
    if texture is not None:
        kind |= TEXTURED | (CELLS if texture.regions is not None else 0)
    return kind


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
