"""Meshes from files: Wavefront OBJ with the textures of its materials, and STL."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from msrr_bullet.render.raster.mesh import Mesh
from msrr_scenes.errors import GeometryError
from msrr_scenes.file_cache import FileCache
from msrr_scenes.geometry.mesh_points import stl_corners
from msrr_scenes.geometry.obj_file import (
    image_beside,
    looked_for,
    material_images,
    material_library,
    obj_lines,
)


@dataclass(frozen=True, eq=False)
class MeshPart:
    """The triangles of a mesh file, in its own units, that share a texture or have none.

    ``from_material`` is whether the file names its materials, so that PyBullet knows about the texture.
    """

    mesh: Mesh
    texture: Path | None
    from_material: bool = False


def read_mesh(path: Path) -> tuple[MeshPart, ...]:
    """Read a mesh file.

    A texture comes from the mesh's material library. A mesh without one has the image of the same name beside
    it (``plate.obj``, ``plate.png``): PyBullet does not tell what a texture that was put on later looks like.

    Raises:
        GeometryError: The file is missing, is malformed, or has a format that cannot be read.
    """
    return _read(path)


def _read_anew(path: Path) -> tuple[tuple[MeshPart, ...], list[Path]]:
    """Return the parts of a mesh, and the files that they depend on."""
    readers = {".obj": _read_obj, ".stl": _read_stl}
    reader = readers.get(path.suffix.lower())
    try:
        path.stat()
        if reader is None:
            raise GeometryError(f"{path}: the raster renderer reads {', '.join(readers)}; convert this mesh")
        return reader(path), [path, *(looked_for(path) if reader is _read_obj else ())]
    except OSError as error:
        raise GeometryError(f"{path}: cannot read this mesh ({error.strerror})") from None
    except (ValueError, IndexError) as error:
        raise GeometryError(f"{path}: malformed mesh: {error}") from None


_read = FileCache(_read_anew, most=256)


def _read_obj(path: Path) -> tuple[MeshPart, ...]:
    rows: dict[str, list[list[float]]] = {"v": [], "vt": [], "vn": []}
    width = {"v": 3, "vt": 2, "vn": 3}
    corners: dict[str, list[tuple[int, int, int]]] = {}
    images: dict[str, Path] = {}
    material, library = "", False
    for words in obj_lines(path):
        key = words[0]
        if key in rows:
            rows[key].append([float(w) for w in words[1 : 1 + width[key]]])
        elif key == "f":
            counts = (len(rows["v"]), len(rows["vt"]), len(rows["vn"]))
            fan = [_corner(word, counts) for word in words[1:]]
            for i in range(1, len(fan) - 1):
                corners.setdefault(material, []).extend((fan[0], fan[i], fan[i + 1]))
        elif key == "usemtl":
            material = " ".join(words[1:])
        elif key == "mtllib":
            library = True
            images.update(material_images(material_library(path, words)))
    if not corners:
        raise ValueError("no faces")
    beside = image_beside(path)
    vertices, uv, normals = (np.array(rows[k]).reshape(-1, width[k]) for k in ("v", "vt", "vn"))
    parts = []
    for name, listed in corners.items():
        index = np.array(listed, dtype=np.int64).reshape(-1, 3, 3)
        mesh = Mesh(
            vertices,
            _checked(index[..., 0], len(vertices)),
            _unit(normals[_checked(index[..., 2], len(normals))]) if index[..., 2].min() >= 0 else None,
            uv[_checked(index[..., 1], len(uv))] if index[..., 1].min() >= 0 else None,
        )
        parts.append(MeshPart(mesh, images.get(name) if library else beside, library))
    return tuple(parts)


def _corner(word: str, counts: tuple[int, int, int]) -> tuple[int, int, int]:
    """Return (position, texture, normal), counted from 0, of ``7``, ``7/2``, ``7//3`` or ``-1/-1/-1``."""
    fields = [*word.split("/"), "", ""][:3]
    index = [int(f) if f else 0 for f in fields]
    position, texture, normal = (
        i - 1 if i > 0 else (n + i if i < 0 else -1) for i, n in zip(index, counts, strict=True)
    )
    return position, texture, normal


def _checked(index: np.ndarray, count: int) -> np.ndarray:
    element = index.min() if index.min() < 0 else index.max()
    if not 0 <= element < count:
        raise ValueError(f"a face names element {element + 1} of {count}")
    return index


def _unit(vectors: np.ndarray) -> np.ndarray:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(length > 0.0, length, 1.0)


def _read_stl(path: Path) -> tuple[MeshPart, ...]:
    vertices, index = np.unique(stl_corners(path), axis=0, return_inverse=True)
    return (MeshPart(Mesh(vertices, index.reshape(-1, 3).astype(np.int64)), None),)
