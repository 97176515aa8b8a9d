"""The points of mesh files: vertices of Wavefront OBJ, corners of the triangles of binary STL."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

import numpy as np

from msrr_scenes.arrays import Array
from msrr_scenes.errors import GeometryError
from msrr_scenes.file_cache import FileCache
from msrr_scenes.geometry.obj_file import obj_lines


def mesh_points(path: Path) -> Array:
    """Return the points of an OBJ or STL file, shape (N, 3), in the units of the file.

    Raises:
        GeometryError: The file is malformed.
    """
    return obj_vertices(path) if path.suffix.lower() == ".obj" else stl_corners(path)


def obj_vertices(path: Path) -> Array:
    """Return the vertices of an OBJ file, shape (N, 3), in the units of the file.

    Raises:
        GeometryError: There are none, or one of them is not three finite numbers.
    """
    rows = [words[1:4] for words in obj_lines(path) if words[0] == "v"]
    if not rows:
        raise GeometryError(f"{path}: no vertices in this mesh")
    return _points(path, rows)


def obj_objects(path: Path) -> list[Array]:
    """Return the vertices of each object or group of an OBJ file that has faces, shape (N, 3) each.

    PyBullet makes a convex hull of each of them.

    Raises:
        GeometryError: As for :func:`obj_vertices`, there are no faces, or one names no vertex of the file.
    """
    return _objects(path)


def _read_objects(path: Path) -> tuple[list[Array], list[Path]]:
    vertices = obj_vertices(path)
    objects: list[set[int]] = [set()]
    seen = 0
    for words in obj_lines(path):
        if words[0] in ("o", "g"):
            objects.append(set())
        elif words[0] == "v":
            seen += 1
        elif words[0] == "f":
            objects[-1].update(_index(path, word, seen, len(vertices)) for word in words[1:])
    found = [vertices[sorted(used)] for used in objects if used]
    if not found:
        raise GeometryError(f"{path}: no faces in this mesh")
    return found, [path]


def _index(path: Path, word: str, seen: int, count: int) -> int:
    """Return the index of a vertex of a face: counted from 1 on, or back from the last vertex so far."""
    with suppress(ValueError):
        number = int(word.split("/")[0])
        if 1 <= number <= count:
            return number - 1
        if -seen <= number <= -1:
            return seen + number
    raise GeometryError(f"{path}: malformed mesh: a face names the vertex {word!r} of {count}")


_objects = FileCache(_read_objects, most=256)


def stl_corners(path: Path) -> Array:
    """Return the corners of the triangles of a binary STL file, shape (3 N, 3), in the units of the file.

    Raises:
        GeometryError: There is no triangle, a corner is not three finite numbers, or the file is text, of
            which PyBullet reads nothing.
    """
    data = path.read_bytes()
    record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    count = int(np.frombuffer(data[80:84], "<u4")[0]) if len(data) >= 84 else 0
    if count and len(data) == 84 + count * record.itemsize:
        return _points(path, np.frombuffer(data[84:], record)["corners"].reshape(-1, 3))
    if b"vertex" in data:
        raise GeometryError(
            f"{path}: an STL file of text, which PyBullet does not draw; write it as binary STL or OBJ"
        )
    raise GeometryError(f"{path}: malformed mesh: no triangles")


def _points(path: Path, rows: Array | list[list[str]]) -> Array:
    try:
        points = np.array(rows, dtype=np.float64)
    except ValueError:  # of a word, or of rows of different lengths
        points = np.empty(0)
    if points.shape != (len(rows), 3) or not np.isfinite(points).all():
        raise GeometryError(f"{path}: malformed mesh: a point in it is not three finite numbers")
    return points
