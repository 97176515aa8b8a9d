"""When a camera exposes the rows of its frames."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from msrr_scenes.arrays import Array
from msrr_scenes.geometry.lens import Lens


@dataclass(frozen=True, slots=True)
class RollingShutter:
    """A shutter that exposes one row after another; the frame is stamped when its middle row is exposed.

    Attributes:
        height: Number of rows of a frame.
        readout_s: Time from the exposure of the top row to that of the bottom row [s]; 0 is a global shutter.
    """

    height: int
    readout_s: float

    def after_stamp(self, rows: Array) -> Array:
        """Return the time from the stamp of a frame to the middle of the exposure of rows [s], as ``rows``.

        They may have any shape [px]; fractions and rows beyond the frame are in order.
        """
        after: Array = ((rows + 0.5) / self.height - 0.5) * self.readout_s
        return after

    def after_stamp_ideal(self, lens: Lens, ideal: Array) -> Array:
        """Return the same, shape (...), for points of the ideal image of a lens, shape (..., 2) [px]."""
        if self.readout_s == 0.0:
            return np.zeros(ideal.shape[:-1])
        return self.after_stamp(lens.distorted(ideal)[..., 1])
