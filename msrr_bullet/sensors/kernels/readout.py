"""Light that comes through the lens becomes the pixels that a sensor delivers, in one pass over a window."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from msrr_bullet.sensors.kernels.compiler import kernel
from msrr_scenes.messages import Pixels

#: Edge of the tile of noise, a power of two [px].
TILE = 1024

_LAST = TILE - 1

#: Largest number that a tone curve has a grey level for.
_LARGEST = 65535


class Shading(NamedTuple):
    """The share of the light that arrives at a pixel of the frame.

    It is ``(1 - loss r^2) (1 + rise_x dx + rise_y dy)``, with r the distance from (cx, cy) [px] and (dx, dy)
    the distance from (middle_x, middle_y) [px]; no factor is negative.
    """

    loss: float
    cx: float
    cy: float
    rise_x: float
    rise_y: float
    middle_x: float
    middle_y: float


@kernel
def convert_light(
    ideal: Pixels,
    taps: NDArray[np.float32],
    x: int,
    y: int,
    shades: bool,
    shading: Shading,
    tile: NDArray[np.float32],
    column: int,
    row: int,
    turned: bool,
    read: float,
    shot: float,
    per_grey: float,
    tone: Pixels,
    out: Pixels,
) -> None:
    """Write the pixels of a window: light is blurred and shaded, noise is added, the tone curve is applied.

    The blur is exact, as sums of whole numbers below 2**24 are.

    Args:
        ideal: Grey levels without blur and noise of the window and a margin about it, shape
            (height + 2 r, width + 2 r).
        taps: Blur along one axis, whole numbers whose sum is a power of two, shape (2 r + 1,).
        x: First column of the window in the frame.
        y: Its first row.
        shades: Whether less light arrives at some pixels than at others.
        shading: How much less.
        tile: Periodic standard normal noise, shape (TILE, TILE).
        column: Column of the tile on which the first column of the window lies.
        row: Row of the tile on which its first row lies.
        turned: Whether the rows of the tile are counted from its last one.
        read: Variance of the read noise [grey levels squared].
        shot: Variance of the shot noise for each grey level of light.
        per_grey: Numbers of the converter for each grey level of light.
        tone: Grey level for every number of the converter, shape (65536,).
        out: Pixels that are written, shape (height, width).
    """
    height, width = out.shape
    size = len(taps)
    flip_row = _LAST if turned else 0
    total = np.float32(0.0)
    for t in range(size):
        total += taps[t]
    level = np.float32(1.0) / (total * total)
    scale, read32, shot32 = np.float32(per_grey), np.float32(read), np.float32(shot)
    across = np.empty((size, width), np.float32)  # the latest rows of the light, blurred along the rows
    light, normal, number = (
        np.empty(width, np.float32),
        np.empty(width, np.float32),
        np.empty(width, np.int32),
    )
    for j in range(1 - size, height):
        blurred = across[(j + size - 1) % size]
        blurred[:] = np.float32(0.0)
        for t in range(size):
            for i in range(width):
                blurred[i] += taps[t] * np.float32(ideal[j + size - 1, i + t])
        if j < 0:
            continue
        light[:] = np.float32(0.0)
        for t in range(size):
            blurred = across[(j + t) % size]
            for i in range(width):
                light[i] += taps[t] * blurred[i]
        if shades:
            dy, ly = y + j - shading.cy, shading.rise_y * (y + j - shading.middle_y)
            for i in range(width):
                dx = x + i - shading.cx
                arrives = max(1.0 - (shading.loss * dy * dy + shading.loss * dx * dx), 0.0)
                arrives *= max(ly + (1.0 + shading.rise_x * (x + i - shading.middle_x)), 0.0)
                light[i] *= np.float32(arrives)
        noise = tile[((row + j) & _LAST) ^ flip_row]
        i = 0
        while i < width:  # as far as the tile reaches, then from its first column again
            first = (column + i) & _LAST
            part = min(TILE - first, width - i)
            for k in range(part):
                normal[i + k] = noise[first + k]
            i += part
        for i in range(width):
            value = level * light[i]
            value += np.sqrt(read32 + shot32 * value) * normal[i]
            number[i] = np.int32(np.rint(min(max(value * scale, np.float32(0.0)), np.float32(_LARGEST))))
        for i in range(width):  # apart from the loop above, which becomes vector code
            out[j, i] = tone[number[i]]
