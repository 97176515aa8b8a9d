"""Textures: bitmaps of a few cells, which are looked up exactly, and images, which a pyramid filters."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np

from msrr_bullet.render.raster.kernels.records import Floats, Indices
from msrr_scenes.errors import GeometryError
from msrr_scenes.file_cache import FileCache
from msrr_scenes.messages import Pixels

#: An image that consists of so few equal squares along its edge (a tag: 10) is kept as cells.
_MOST_CELLS = 32


@dataclass(frozen=True, eq=False)
class Texture:
    """A grey image, as reflectance from 0 to 1.

    Attributes:
        levels: Pyramid, finest first, each level half the size of the one before; cells have one level.
        regions: None if the texels are samples of a smooth image that repeats. Otherwise each texel is a cell
            of uniform grey with sharp borders, and this array of the texels' shape numbers the rectangles of
            equal cells, row by row.
    """

    levels: tuple[Floats, ...]
    regions: Indices | None

    @property
    def region_grey(self) -> Floats:
        """Reflectance of each region."""
        assert self.regions is not None
        _, first = np.unique(self.regions, return_index=True)
        return self.levels[0].reshape(-1)[first]


def read_texture(path: Path) -> Texture:
    """Read an image file.

    Raises:
        GeometryError: The file is missing or no image.
    """
    return _read(path)


def _read_anew(path: Path) -> tuple[Texture, list[Path]]:
    try:
        texture = _decoded(path.read_bytes())
    except OSError as error:
        raise GeometryError(f"{path}: cannot read this texture ({error.strerror})") from None
    if texture is None:
        raise GeometryError(f"{path}: not an image that OpenCV can read")
    return texture, [path]


_read = FileCache(_read_anew, most=256)


@lru_cache(maxsize=256)
def _decoded(content: bytes) -> Texture | None:
    """Return the texture in an image file; the trials of a process write the same tags to different files."""
    raw = np.frombuffer(content, dtype=np.uint8)
    image = cv2.imdecode(raw, cv2.IMREAD_GRAYSCALE) if raw.size else None
    return None if image is None else texture_of(np.asarray(image, dtype=np.uint8))


def texture_of(image: Pixels) -> Texture:
    """Return the texture of a mono8 image, shape (height, width), upper row first."""
    cells = _cells(image)
    if max(cells.shape) <= _MOST_CELLS:
        return Texture(((cells / np.float32(255.0)).astype(np.float32),), rectangles(cells))
    edge = [2 ** int(np.ceil(np.log2(n))) for n in image.shape]
    fine = cv2.resize(image.astype(np.float32), (edge[1], edge[0]), interpolation=cv2.INTER_AREA)
    levels = [(fine / np.float32(255.0)).astype(np.float32)]
    while max(levels[-1].shape) > 1:
        a = levels[-1]
        a = 0.5 * (a[0::2] + a[1::2]) if a.shape[0] > 1 else a
        a = 0.5 * (a[:, 0::2] + a[:, 1::2]) if a.shape[1] > 1 else a
        levels.append(a.astype(np.float32))
    return Texture(tuple(levels), None)


def _cells(image: Pixels) -> Pixels:
    """Return the smallest image from which ``image`` follows when each pixel is repeated in a rectangle."""
    out = image
    for axis in (0, 1):
        n = out.shape[axis]
        change = np.flatnonzero(np.diff(out.astype(np.int16), axis=axis).any(axis=1 - axis)) + 1
        block = int(np.gcd.reduce(np.append(change, n)))
        out = np.take(out, np.arange(0, n, block), axis=axis)
    return out


def rectangles(cells: Pixels) -> Indices:
    """Return the number of the rectangle of equal cells that each cell belongs to, shape of ``cells``.

    From each cell not yet in one, a rectangle is as wide as possible, then as high. Rectangles are convex
    like faces, so that a pixel whose corners lie in one shows nothing else; the fewer the better.
    """
    (rows, columns), greys = cells.shape, cells.tolist()
    out = [[-1] * columns for _ in range(rows)]
    count = 0
    for row in range(rows):
        for column in range(columns):
            if out[row][column] >= 0:
                continue
            grey = greys[row][column]
            right = column + 1
            while right < columns and greys[row][right] == grey and out[row][right] < 0:
                right += 1
            across = range(column, right)
            bottom = row + 1
            while bottom < rows and all(greys[bottom][c] == grey and out[bottom][c] < 0 for c in across):
                bottom += 1
            for filled in out[row:bottom]:
                filled[column:right] = [count] * len(across)
            count += 1
    return np.array(out, dtype=np.int64)
