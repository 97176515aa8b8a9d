"""The shutter of a camera: exposure time, which blurs what moves, and rows that are read out one by one.

Time is cut into cells, on a grid of the whole frame. The picture of the instant in the middle of a cell
stands for the cell, and a row is the mean of the cells that its exposure covers, each by the share of it that
is covered. The mean time of a row is then exact: where its exposure begins and ends within a cell, the two
errors cancel.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from msrr_bullet.render import Instant
from msrr_bullet.sensors.camera_motion import CameraMotion
from msrr_scenes.geometry.pinhole import PinholeCamera, Window
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.specs.sensors import CameraSpec

#: Largest deviation of the grey level at an edge from the mean over the exposure, as a share of the edge's
#: contrast: that to which the renderer rounds the shade of a pixel with an edge, which is one of 16.
_EDGE_ERROR = 1.0 / 32.0

#: Most cells of an exposure.
_MOST_CELLS = 8

#: Width of a cell of a rolling shutter whose exposure is short [px]: so far the image moves meanwhile.
_LEAST_CELL_PX = 0.25

#: Motion of the image between the first and the last row below which they are exposed together [px].
_LEAST_SHIFT_PX = 0.1


@dataclass(frozen=True, eq=False)
class PartialExposure:
    """What one instant adds to a window.

    ``rows`` is the part of the window that collects light then, all its columns wide, and ``weights`` the
    share of the instant in each of the rows, shape (height,).
    """

    rows: Window
    instant: Instant
    weights: NDArray[np.float32]


class Shutter:
    """The instants at which the rows of a frame are exposed.

    The time stamp of a frame is the middle of the exposure of its middle row. Row r of H is exposed for
    ``exposure_ms`` about the time ``rolling_shutter_ms`` ((r + 0.5) / H - 0.5) after the stamp.
    """

    def __init__(self, spec: CameraSpec, pinhole: PinholeCamera) -> None:
        """Prepare for a camera with this data sheet and these true intrinsics."""
        self._exposure_s = 1e-3 * spec.exposure_ms
        self._rows = spec.rolling_shutter
        self._blur_px = spec.blur_px
        self._pinhole = pinhole
        # The latest exposure, of which several windows may be read, and its speed [px/s].
        self._measured: tuple[CameraMotion, float] | None = None

    @property
    def instantaneous(self) -> bool:
        """Whether the whole frame is exposed at one instant."""
        return self._exposure_s == 0.0 and self._rows.readout_s == 0.0

    def exposures(self, window: Window, X_WC: SE3, motion: CameraMotion) -> Iterator[PartialExposure]:
        """Yield the instants that a window is the mean of, in their order.

        Instants and weights depend on the frame and on rows of the full frame alone; so a window is the crop
        of the frame. The window is any rectangle, inside or outside the frame; pose and velocities are those
        at the time of the stamp.
        """
        if self._measured is None or self._measured[0] is not motion:
            self._measured = motion, motion.image_speed(self._pinhole, X_WC)
        speed = self._measured[1]
        rolls = speed * self._rows.readout_s > _LEAST_SHIFT_PX
        count = cells_of_smear(speed * self._exposure_s, self._blur_px, rolls)
        cell = self._exposure_s / count
        if rolls and cell * speed < _LEAST_CELL_PX:
            count, cell = 1, _LEAST_CELL_PX / speed
        if not rolls:
            share = np.full(window.height, 1.0 / count, dtype=np.float32)
            for k in range(count):
                yield PartialExposure(
                    window, instant_after((k + 0.5 - 0.5 * count) * cell, X_WC, motion), share
                )
            return
        rows = np.arange(window.y, window.y_end, dtype=np.float64)
        middle = self._rows.after_stamp(rows)
        start = middle / cell - 0.5 * count  # in cells
        for k in range(math.floor(start[0]), math.ceil(start[-1] + count)):
            weights = (np.minimum(start + count, k + 1.0) - np.maximum(start, k)) / count
            seen = np.flatnonzero(weights > 1e-9)
            if seen.size:
                first, end = int(seen[0]), int(seen[-1]) + 1
                part = Window(window.x, window.y + first, window.width, end - first)
                instant = instant_after((k + 0.5) * cell, X_WC, motion)
                yield PartialExposure(part, instant, weights[first:end].astype(np.float32))


def cells_of_smear(smear: float, blur_px: float, rolls: bool) -> int:
    """Return the number of instants whose mean stands for an exposure.

    The brightness of a pixel that a sharp edge crosses is, over time, a ramp one pixel long. The mean of n
    instants is off by at most a share ``smear / (8 n^2)`` of the contrast, where the ramp begins or ends in
    the middle of a cell. A lens that blurs rounds the ramp: its slope changes by at most
    ``1 / (sqrt(2 pi e) blur^2)`` per pixel, and the midpoint rule is off by at most 1 / 24 of that times the
    square of the cell. Where a row's exposure begins within a cell it is off by twice as much. ``smear`` is
    the motion of the image during the exposure, and ``blur_px`` the standard deviation of the Gaussian blur
    of the lens [px]. Exposures of rows begin within cells if the shutter ``rolls``.
    """
    sharp = math.sqrt(smear / (8.0 * _EDGE_ERROR))
    share = (12.0 if rolls else 24.0) * math.sqrt(2.0 * math.pi * math.e) * _EDGE_ERROR
    blurred = smear / (blur_px * math.sqrt(share)) if blur_px > 0.0 else math.inf
    return min(max(math.ceil(min(sharp, blurred)), 1), _MOST_CELLS)


def instant_after(dt: float, X_WC: SE3, motion: CameraMotion) -> Instant:
    """Return the instant ``dt`` seconds after that of ``X_WC`` and ``motion``."""
    if dt == 0.0:
        return Instant(X_WC)
    displaced = motion.displaced(dt)
    own = displaced.get(motion.carrier) if motion.carrier is not None else None
    return Instant(X_WC if own is None else own @ X_WC, displaced)
