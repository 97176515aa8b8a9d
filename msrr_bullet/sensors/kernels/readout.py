"""Light that has passed the lens becomes the pixels that a sensor delivers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from msrr_bullet.sensors.kernels.compiler import kernel
from msrr_scenes.messages import Pixels

#: Binary logarithm of the edge of a tile of noise, and that edge [px].
_BITS = 10
TILE = 1 << _BITS

_LAST = TILE - 1

#: Largest number that a tone curve has a grey level for.
_LARGEST = 65535


@kernel
def convert_light(
    light: NDArray[np.float32],
    margin: int,
    unit: float,
    tile: NDArray[np.float32],
    x: int,
    y: int,
    mirror: int,
    read: float,
    shot: float,
    per_grey: float,
    tone: Pixels,
    out: Pixels,
) -> None:
    """Write the pixels for the light of a window: noise is added, and the tone curve is applied.

    Args:
        light: Light of the window and a margin about it, shape (height + 2 margin, width + 2 margin).
        margin: Width of the margin [px].
        unit: Grey levels for each unit of light.
        tile: Periodic standard normal noise, shape (1024, 1024).
        x: Column of the tile, as it is mirrored, on which the first column of the window lies.
        y: Row of the tile, likewise.
        mirror: Mirror image of the tile: 1 exchanges rows and columns, 2 turns rows and 4 columns round.
        read: Variance of the read noise [grey levels squared].
        shot: Variance of the shot noise for each grey level of light.
        per_grey: Numbers of the converter for each grey level of light.
        tone: Grey level for every number of the converter, shape (65536,).
        out: Pixels that are written, shape (height, width).
    """
    flip_row, flip_column = (_LAST if mirror & 2 else 0), (_LAST if mirror & 4 else 0)
    along, across = (_BITS, 0) if mirror & 1 else (0, _BITS)  # binary logarithms of steps on the tile
    noise = tile.ravel()
    level, scale, read32, shot32 = (
        np.float32(unit),
        np.float32(per_grey),
        np.float32(read),
        np.float32(shot),
    )
    number = np.empty(out.shape[1], np.int32)
    for j in range(out.shape[0]):
        row = (((y + j) & _LAST) ^ flip_row) << across
        for i in range(out.shape[1]):
            value = level * light[margin + j, margin + i]
            sigma = np.sqrt(read32 + shot32 * value)
            value += sigma * noise[row + ((((x + i) & _LAST) ^ flip_column) << along)]
            number[i] = np.int32(np.rint(min(max(value * scale, np.float32(0.0)), np.float32(_LARGEST))))
        for i in range(out.shape[1]):  # apart from the loop above, which becomes vector code
            out[j, i] = tone[number[i]]
