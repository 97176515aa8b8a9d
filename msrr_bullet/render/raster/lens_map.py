"""Where a lens that distorts shows the corners of pixels, computed once for a camera, where it is needed."""

from __future__ import annotations

from dataclasses import astuple

import numpy as np

from msrr_bullet.render.raster.kernels.floor import ROLLED_STRIDE
from msrr_bullet.render.raster.kernels.lens_nodes import node_steps, undistort_nodes
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
        for j in range(y // _TILE, (y + window.height) // _TILE + 1):
            for i in range(x // _TILE, (x + window.width) // _TILE + 1):
                if not self._known[j, i]:
                    self._compute(j, i)
        nodes = slice(y, y + window.height + 1), slice(x, x + window.width + 1)
        u, v = np.ascontiguousarray(self._u[nodes]), np.ascontiguousarray(self._v[nodes])
        first, last = (k // ROLLED_STRIDE - self._first_group for k in (window.x, window.x_end))
        part = slice(y, y + window.height), slice(first, last + 1)
        view = LensView(
            u=u,
            v=v,
            v_low=v.min(axis=1),
            v_high=v.max(axis=1),
            shift=self._shift,
            pitch=self._pitch,
            slant=self._slant,
            column=window.x,
            group_u=np.ascontiguousarray(self._group_u[part]),
            group_v=np.ascontiguousarray(self._group_v[part]),
        )
        self._latest = window, view
        return view

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


def bounds_of(lens: LensView) -> Window:
    """Return the smallest window of the image of an ideal lens that holds all corners of a view."""
    x, y = int(np.floor(lens.u[:, 0].min())), int(np.floor(lens.v[0].min()))
    return Window(x, y, int(np.ceil(lens.u[:, -1].max())) - x, int(np.ceil(lens.v[-1].max())) - y)
