"""Where a lens that distorts shows the corners of pixels, computed once for a camera."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from msrr_bullet.render.raster.kernels.records import LensView
from msrr_scenes.errors import GeometryError
from msrr_scenes.geometry.distortion import Distortion, ideal_grid
from msrr_scenes.geometry.pinhole import PinholeCamera, Window

#: Margin about the frame that is computed at first [px]; blur reads a few pixels beyond the frame.
_MARGIN = 8


class LensMap:
    """The places of the corners of pixels in the image of an ideal lens, for a frame and a margin about it.

    Attributes:
        camera: Intrinsics.
        distortion: Distortion of the lens.
    """

    def __init__(self, camera: PinholeCamera, distortion: Distortion) -> None:
        """Compute the map of the frame and a small margin.

        Raises:
            GeometryError: The polynomial of the lens has no inverse there.
        """
        self.camera = camera
        self.distortion = distortion
        self._cover(camera.frame.padded(_MARGIN))

    def view(self, window: Window) -> LensView:
        """Return the places of the corners of the pixels of ``window``.

        Raises:
            GeometryError: The window reaches beyond the frame to where the lens has no inverse.
        """
        margin = self._covered.width - self.camera.width
        while not self._covered.contains(window):
            margin *= 2
            self._cover(self.camera.frame.padded(margin))
        x, y = window.x - self._covered.x, window.y - self._covered.y
        part = self._corners[:, y : y + window.height + 1, x : x + window.width + 1]
        u, v = np.ascontiguousarray(part[0]), np.ascontiguousarray(part[1])
        return LensView(u, v, v.min(axis=1), v.max(axis=1))

    def _cover(self, window: Window) -> None:
        columns = np.arange(window.x, window.x_end + 1, dtype=np.float64) - 0.5
        rows = np.arange(window.y, window.y_end + 1, dtype=np.float64) - 0.5
        grid = ideal_grid(self.camera, self.distortion, columns, rows)
        if grid is None:
            raise GeometryError(
                f"the polynomial of the lens {self.distortion} has no inverse in {window}: two points of the "
                "scene appear at one pixel; use smaller coefficients or a smaller field of view"
            )
        self._covered = window
        self._corners = np.moveaxis(grid, -1, 0) + 0.5  # kernels count from the edges of pixels


@lru_cache(maxsize=32)
def lens_map(camera: PinholeCamera, distortion: Distortion) -> LensMap:
    """Return the map of a lens, which takes a third of a second for a frame of 640 x 480 pixels.

    Raises:
        GeometryError: The polynomial of the lens has no inverse in the frame.
    """
    return LensMap(camera, distortion)


def bounds_of(lens: LensView) -> Window:
    """Return the smallest window of the image of an ideal lens that holds all corners of a view."""
    x, y = int(np.floor(lens.u.min())), int(np.floor(lens.v.min()))
    return Window(x, y, int(np.ceil(lens.u.max())) - x, int(np.ceil(lens.v.max())) - y)
