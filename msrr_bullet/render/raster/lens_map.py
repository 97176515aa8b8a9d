"""Where a lens that distorts shows the corners of pixels, computed once for a camera, where it is needed."""

from __future__ import annotations

from dataclasses import astuple

import numpy as np

from msrr_bullet.render.raster.kernels.floor import ROLLED_STRIDE
from msrr_bullet.render.raster.kernels.lens_nodes import cut_nodes, node_steps, undistort_nodes
from msrr_bullet.render.raster.kernels.records import Lens, LensView
from msrr_scenes.errors import GeometryError
from msrr_scenes.geometry.distortion import Distortion, has_inverse
from msrr_scenes.geometry.pinhole import PinholeCamera, Window

#: Margin about the frame that is covered at first [px]; blur reads a few pixels beyond the frame.
_MARGIN = 8

#: Edge of the tiles that are computed when a window first reaches into them [px].
_TILE = 64


class LensMap:
    """The places of the corners of pixels in the image of an ideal lens, for a frame and a margin about it.

    Attributes:
        camera: Intrinsics.
        distortion: Distortion of the lens.
    """

    def __init__(self, camera: PinholeCamera, distortion: Distortion) -> None:
        """Check the lens.

        Raises:
            GeometryError: The polynomial of the lens has no inverse in the frame and a small margin.
        """
        self.camera = camera
        self.distortion = distortion
        self._lens = Lens(camera.focal, camera.cx, camera.cy, *astuple(distortion))
        if not has_inverse(camera, distortion):
            raise self._error(camera.frame)
        self._latest: tuple[Window, LensView] | None = None
        self._memory = np.empty((2, 0))
        self._cover(camera.frame.padded(_MARGIN))

    def view(self, window: Window) -> LensView:
        """Return the places of the corners of the pixels of ``window``.

        The latest view is kept, for the next instant of the exposure. The view of another window is written
        over it, for fresh memory costs more than to fill it.

        Raises:
            GeometryError: The window reaches beyond the frame to where the lens has no inverse.
        """
        if self._latest is not None and self._latest[0] == window:
            return self._latest[1]
        x, y = self._compute_nodes(window)
        rows, columns = window.height + 1, window.width + 1
        if rows * columns > self._memory.shape[1]:
            self._memory = np.empty((2, rows * columns))
        u, v = self._memory[:, : rows * columns].reshape(2, rows, columns)
        v_low, v_high = np.empty((2, rows))
        cut_nodes(self._u, self._v, y, x, u, v, v_low, v_high)
        first, last = (k // ROLLED_STRIDE - self._first_group for k in (window.x, window.x_end))
        part = slice(y, y + window.height), slice(first, last + 1)
        view = LensView(
            u=u,
            v=v,
            v_low=v_low,
            v_high=v_high,
            shift=self._shift,
            pitch=self._pitch,
            slant=self._slant,
            column=window.x,
            group_u=np.ascontiguousarray(self._group_u[part]),
            group_v=np.ascontiguousarray(self._group_v[part]),
        )
        self._latest = window, view
        return view

    def bounds(self, window: Window) -> Window:
        """Return the smallest window of the image of an ideal lens that holds all that ``window`` shows.

        Raises:
            GeometryError: The window reaches beyond the frame to where the lens has no inverse.
        """
        x, y = self._compute_nodes(window)
        x_end, y_end = x + window.width, y + window.height
        left = int(np.floor(self._u[y : y_end + 1, x].min()))
        top = int(np.floor(self._v[y, x : x_end + 1].min()))
        right = int(np.ceil(self._u[y : y_end + 1, x_end].max()))
        bottom = int(np.ceil(self._v[y_end, x : x_end + 1].max()))
        return Window(left, top, right - left, bottom - top)

    def _compute_nodes(self, window: Window) -> tuple[int, int]:
        """Compute the nodes of a window where they are not known; return column and row of the first one."""
        margin = self._covered.width - self.camera.width
        while not self._covered.contains(window):
            margin *= 2
            self._cover(self.camera.frame.padded(margin))
        x, y = window.x - self._covered.x, window.y - self._covered.y
        tiles = (
            slice(y // _TILE, (y + window.height) // _TILE + 1),
            slice(x // _TILE, (x + window.width) // _TILE + 1),
        )
        for j, i in np.argwhere(~self._known[tiles]):
            self._compute(int(j) + tiles[0].start, int(i) + tiles[1].start)
        return x, y

    def _cover(self, window: Window) -> None:
        """Make room for a window; memory that is never written to costs nothing."""
        self._covered = window
        self._columns = np.arange(window.x, window.x_end + 1, dtype=np.float64) - 0.5
        self._rows = np.arange(window.y, window.y_end + 1, dtype=np.float64) - 0.5
        shape = len(self._rows), len(self._columns)
        self._u, self._v = np.empty(shape), np.empty(shape)
        self._known = np.zeros([(size - 1) // _TILE + 1 for size in shape], dtype=np.bool_)
        self._first_group = window.x // ROLLED_STRIDE
        middle = ROLLED_STRIDE * (np.arange(self._first_group, window.x_end // ROLLED_STRIDE + 1) + 0.5) - 0.5
        # The lens need not have an inverse beyond the margin, and no middle may depend on what is covered.
        self._middles = np.clip(middle, -_MARGIN, self.camera.width - 1 + _MARGIN)
        groups = window.height, len(middle)
        self._group_u, self._group_v = np.empty(groups), np.empty(groups)
        self._shift, self._pitch, self._slant = 0.0, np.inf, 0.0

    def _compute(self, j: int, i: int) -> None:
        """Compute the nodes of a tile up to the first ones of the next tiles, and widen the bounds."""
        rows, columns = len(self._rows), len(self._columns)
        j0, i0 = j * _TILE, i * _TILE
        j1, i1 = min(j0 + _TILE + 1, rows), min(i0 + _TILE + 1, columns)
        x = self._covered.x
        first, last = ((x + k) // ROLLED_STRIDE - self._first_group for k in (i0, i1 - 1))
        middles, between = self._middles, self._rows[:-1] + 0.5
        if not (
            undistort_nodes(self._lens, self._columns, self._rows, j0, j1, i0, i1, self._u, self._v)
            and undistort_nodes(
                self._lens,
                middles,
                between,
                j0,
                min(j1, rows - 1),
                first,
                last + 1,
                self._group_u,
                self._group_v,
            )
        ):
            raise self._error(self._covered)
        shift, pitch, slant = node_steps(self._u, self._v, j0, j1, i0, i1)
        self._shift, self._slant = max(self._shift, shift), max(self._slant, slant)
        self._pitch = min(self._pitch, pitch)
        self._known[j, i] = True

    def _error(self, window: Window) -> GeometryError:
        return GeometryError(
            f"the polynomial of the lens {self.distortion} has no inverse in {window}: two points of the "
            "scene appear at one pixel; use smaller coefficients or a smaller field of view"
        )
