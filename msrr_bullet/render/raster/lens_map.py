"""Where a lens that distorts shows the corners of pixels, computed once for a camera."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from msrr_bullet.render.raster.kernels.floor import ROLLED_STRIDE
from msrr_bullet.render.raster.kernels.lens_visibility import bound_rows
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
        self._latest: tuple[Window, LensView] | None = None
        self._cover(camera.frame.padded(_MARGIN))

    def view(self, window: Window) -> LensView:
        """Return the places of the corners of the pixels of ``window``.

        The latest view is kept, for the next instant of the exposure.

        Raises:
            GeometryError: The window reaches beyond the frame to where the lens has no inverse.
        """
        if self._latest is not None and self._latest[0] == window:
            return self._latest[1]
        margin = self._covered.width - self.camera.width
        while not self._covered.contains(window):
            margin *= 2
            self._cover(self.camera.frame.padded(margin))
        x, y = window.x - self._covered.x, window.y - self._covered.y
        part = self._corners[:, y : y + window.height + 1, x : x + window.width + 1]
        u, v = np.ascontiguousarray(part[0]), np.ascontiguousarray(part[1])
        v_low, v_high = np.empty(len(v)), np.empty(len(v))
        bound_rows(v, v_low, v_high)
        first = window.x // ROLLED_STRIDE - self._first_group
        groups = np.ascontiguousarray(self._groups[:, y : y + window.height, first:])
        view = LensView(
            u=u,
            v=v,
            v_low=v_low,
            v_high=v_high,
            shift=self._shift,
            pitch=self._pitch,
            slant=self._slant,
            column=window.x,
            group_u=groups[0],
            group_v=groups[1],
        )
        self._latest = window, view
        return view

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
        u, v = self._corners
        self._shift = float(np.abs(np.diff(u, axis=0)).max())
        self._pitch = float(np.diff(u, axis=1).min())
        self._slant = float(np.abs(np.diff(v, axis=1)).max())
        self._first_group = window.x // ROLLED_STRIDE
        middle = ROLLED_STRIDE * (np.arange(self._first_group, window.x_end // ROLLED_STRIDE + 1) + 0.5) - 0.5
        # The lens need not have an inverse beyond the margin, and no middle may depend on what is covered.
        middle = np.clip(middle, -_MARGIN, self.camera.width - 1 + _MARGIN)
        nodes = np.stack(np.meshgrid(middle, rows[:-1] + 0.5), axis=-1)
        ideal = self.distortion.ideal_pixels(self.camera, nodes.reshape(-1, 2)).reshape(nodes.shape)
        self._groups = np.ascontiguousarray(np.moveaxis(ideal, -1, 0) + 0.5)


# A map takes 16 bytes a pixel. This is room for the cameras of 16 units, each as it was built, and one above.
@lru_cache(maxsize=17)
def lens_map(camera: PinholeCamera, distortion: Distortion) -> LensMap:
    """Return the map of a lens, which takes a third of a second for a frame of 640 x 480 pixels.

    Raises:
        GeometryError: The polynomial of the lens has no inverse in the frame.
    """
    return LensMap(camera, distortion)


def bounds_of(lens: LensView) -> Window:
    """Return the smallest window of the image of an ideal lens that holds all corners of a view."""
    x, y = int(np.floor(lens.u[:, 0].min())), int(np.floor(lens.v[0].min()))
    return Window(x, y, int(np.ceil(lens.u[:, -1].max())) - x, int(np.ceil(lens.v[-1].max())) - y)
