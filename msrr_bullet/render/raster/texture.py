"""Textures: bitmaps of a few cells, looked up exactly, and pictures, filtered through a pyramid."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from msrr_scenes.errors import GeometryError

Pixels = NDArray[np.uint8]
Grey = NDArray[np.float32]
Indices = NDArray[np.int64]

#: A picture that is made of so few equal squares along its edge (a tag: 10) is kept as cells.
MOST_CELLS = 32


@dataclass(frozen=True, eq=False)
class Texture:
    """A picture in grey, as reflectance from 0 to 1.

    Attributes:
        levels: Finest first, each half the size of the one before; cells have one level.
        regions: None: the texels are samples of a smooth picture that repeats. Otherwise each texel is a cell
            of uniform grey with sharp borders, and this array of the same shape numbers the rectangles of
            equal cells, row by row.
    """

    levels: tuple[Grey, ...]
    regions: Indices | None

    @property
    def region_grey(self) -> Grey:
        """Reflectance of each region."""
        assert self.regions is not None
        _, first = np.unique(self.regions, return_index=True)
        return self.levels[0].reshape(-1)[first]


def read_texture(path: Path) -> Texture:
    """Read a picture file.

    Raises:
        GeometryError: The file is missing or no picture.
    """
    try:
        stamp = path.stat()
        return _read(path, stamp.st_mtime_ns, stamp.st_size)
    except OSError as error:
        raise GeometryError(f"{path}: cannot read this texture ({error.strerror})") from None


@lru_cache(maxsize=256)
def _read(path: Path, mtime_ns: int, size: int) -> Texture:
    texture = _decoded(path.read_bytes())
    if texture is None:
        raise GeometryError(f"{path}: not a picture that OpenCV can read")
    return texture


@lru_cache(maxsize=256)
def _decoded(content: bytes) -> Texture | None:
    """Return the texture in a picture file; every trial writes the same tags to files of its own."""
    raw = np.frombuffer(content, dtype=np.uint8)
    picture = cv2.imdecode(raw, cv2.IMREAD_GRAYSCALE) if raw.size else None
    return None if picture is None else texture_of(np.asarray(picture, dtype=np.uint8))


def texture_of(picture: Pixels) -> Texture:
    """Return the texture of a mono8 picture, shape (height, width), upper row first."""
    cells = _cells(picture)
    if max(cells.shape) <= MOST_CELLS:
        return Texture(((cells / np.float32(255.0)).astype(np.float32),), rectangles(cells))
    edge = [2 ** int(np.ceil(np.log2(n))) for n in picture.shape]
    fine = cv2.resize(picture.astype(np.float32), (edge[1], edge[0]), interpolation=cv2.INTER_AREA)
    levels = [(fine / np.float32(255.0)).astype(np.float32)]
    while max(levels[-1].shape) > 1:
        a = levels[-1]
        a = 0.5 * (a[0::2] + a[1::2]) if a.shape[0] > 1 else a
        a = 0.5 * (a[:, 0::2] + a[:, 1::2]) if a.shape[1] > 1 else a
        levels.append(a.astype(np.float32))
    return Texture(tuple(levels), None)


def _cells(picture: Pixels) -> Pixels:
    """Return the smallest picture from which ``picture`` follows by repeating each pixel in a square."""
    out = picture
    for axis in (0, 1):
        n = out.shape[axis]
        change = np.flatnonzero(np.diff(out.astype(np.int16), axis=axis).any(axis=1 - axis)) + 1
        block = int(np.gcd.reduce(np.append(change, n)))
        out = np.take(out, np.arange(0, n, block), axis=axis)
    return out


def rectangles(cells: Pixels) -> Indices:
    """Number rectangles of equal cells: as wide as possible from each cell not yet in one, then as high.

    Rectangles are convex, so that they settle pixels like faces do; the fewer the better.
    """
    rows, columns = cells.shape
    out = np.full(cells.shape, -1, dtype=np.int64)
    count = 0
    for row in range(rows):
        for column in range(columns):
            if out[row, column] >= 0:
                continue
            free = (cells[row] == cells[row, column]) & (out[row] < 0)
            right = column + 1
            while right < columns and free[right]:
                right += 1
            bottom = row + 1
            while bottom < rows and bool(
                ((cells[bottom, column:right] == cells[row, column]) & (out[bottom, column:right] < 0)).all()
            ):
                bottom += 1
            out[row:bottom, column:right] = count
            count += 1
    return out
