"""Where a lens that distorts shows the corners of pixels, computed once for a camera, where it is needed."""

from __future__ import annotations

import math
from dataclasses import astuple

import numpy as np

from msrr_bullet.render.raster.kernels.grid import GROUP
from msrr_bullet.render.raster.kernels.lens_nodes import cut_nodes, node_steps, undistort_nodes
from msrr_bullet.render.raster.kernels.records import LensParameters, PixelGrid
from msrr_bullet.render.raster.memory import untouched
from msrr_scenes.geometry.distortion import Distortion, has_inverse, no_inverse
from msrr_scenes.geometry.pinhole import PinholeCamera, Window

#: Margin about the frame that is covered at first [px]; blur reads a few pixels beyond the frame.
_MARGIN = 8

#: Edge of the tiles that are computed when a window first reaches into them [px].
_TILE = 64


class _Nodes:
    """The corners of the pixels of a window, and where an ideal lens would show them.

    Attributes:
        window: The window.
        columns: Columns of the corners, shape (width + 1,) [px].
        rows: Rows, shape (height + 1,) [px].
        u: Columns in the image of the ideal lens, counted from the edge of the frame,
            shape (height + 1, width + 1) [px].
        v: Rows, likewise.
        first_group: Number of the first group of pixels of a row that share one blend of the floor.
        group_u: Columns of the middles of the groups in the image of the ideal lens, shape (height, groups).
        group_v: Rows, likewise.
        shift: The most that u changes by down a column of what is computed.
        pitch: The least that u changes by along a row.
        slant: The most that v changes by along a row.
    """

    def __init__(self, window: Window, frame_width: int) -> None:
        """Make room for the corners, and compute none."""
        self.window = window
        self.columns = np.arange(window.x, window.x_end + 1, dtype=np.float64) - 0.5
        self.rows = np.arange(window.y, window.y_end + 1, dtype=np.float64) - 0.5
        shape = len(self.rows), len(self.columns)
        self.u, self.v = untouched(shape, np.float64), untouched(shape, np.float64)
        self.first_group = window.x // GROUP
        middle = GROUP * (np.arange(self.first_group, window.x_end // GROUP + 1) + 0.5) - 0.5
        # The lens need not have an inverse beyond the margin, and no middle may depend on what is covered.
        self._middles = np.clip(middle, -_MARGIN, frame_width - 1 + _MARGIN)
        groups = window.height, len(middle)
        self.group_u, self.group_v = np.empty(groups), np.empty(groups)
        self.shift, self.pitch, self.slant = 0.0, np.inf, 0.0

    def compute(self, lens: LensParameters, j0: int, j1: int, i0: int, i1: int) -> bool:
        """Compute the corners in rows j0 to j1 - 1 and columns i0 to i1 - 1, and widen the bounds.

        Returns:
            Whether the lens has an inverse there.
        """
        x = self.window.x
        first, last = ((x + k) // GROUP - self.first_group for k in (i0, i1 - 1))
        end, between = min(j1, len(self.rows) - 1), self.rows[:-1] + 0.5
        if not (
            undistort_nodes(lens, self.columns, self.rows, j0, j1, i0, i1, self.u, self.v)
            and undistort_nodes(
                lens, self._middles, between, j0, end, first, last + 1, self.group_u, self.group_v
            )
        ):
            return False
        shift, pitch, slant = node_steps(self.u, self.v, j0, j1, i0, i1)
        self.shift, self.slant = max(self.shift, shift), max(self.slant, slant)
        self.pitch = min(self.pitch, pitch)
        return True


class LensMap:
    """The places of the corners of pixels in the image of an ideal lens, for a frame and a margin around."""

    def __init__(self, camera: PinholeCamera, distortion: Distortion) -> None:
        """Check the lens.

        Raises:
            GeometryError: The polynomial of the lens has no inverse in the frame and a small margin.
        """
        self.camera = camera
        self.distortion = distortion
        self._lens = LensParameters(camera.focal, camera.cx, camera.cy, *astuple(distortion))
        if not has_inverse(camera, distortion):
            raise no_inverse(distortion, camera.frame)
        self._latest: tuple[Window, PixelGrid, Window] | None = None
        self._memory = np.empty((2, 0))
        self._searched: set[Window] = set()
        self._cover(camera.frame.padded(_MARGIN))

    def grid(self, window: Window) -> PixelGrid:
        """Return the places of the corners of the pixels of ``window``.

        It is written over by the grid of another window, for fresh memory costs more than to fill it.

        Raises:
            GeometryError: The window reaches beyond the frame to where the lens has no inverse.
        """
        return self._look(window)[0]

    def bounds(self, window: Window) -> Window:
        """Return the smallest window of the image of an ideal lens that holds all that ``window`` shows.

        Raises:
            GeometryError: The window reaches beyond the frame to where the lens has no inverse.
        """
        return self._look(window)[1]

    def _look(self, window: Window) -> tuple[PixelGrid, Window]:
        """Return grid and bounds of a window; the latest are kept, for the next instant of the exposure."""
        if self._latest is None or self._latest[0] != window:
            grid = self._searched_grid(window) or self._known_grid(window)
            u, v_low, v_high = map(np.asarray, (grid.u, grid.v_low, grid.v_high))
            left, right = math.floor(u[:, 0].min()), math.ceil(u[:, -1].max())
            top, bottom = math.floor(v_low[0]), math.ceil(v_high[-1])
            self._latest = window, grid, Window(left, top, right - left, bottom - top)
        return self._latest[1:]

    def _searched_grid(self, window: Window) -> PixelGrid | None:
        """Return the grid of a wide window that is asked for the first time, and keep no place in it.

        A frame is often searched once, as a whole, and then read in small windows. To keep all its places
        would take 20 MB for 1280 x 960 pixels.
        """
        if 2 * window.width <= self.camera.width or window in self._searched:
            return None
        self._searched.add(window)
        nodes = _Nodes(window, self.camera.width)
        if not nodes.compute(self._lens, 0, len(nodes.rows), 0, len(nodes.columns)):
            raise no_inverse(self.distortion, window)
        return PixelGrid(
            width=window.width,
            height=window.height,
            u=nodes.u,
            v=nodes.v,
            v_low=nodes.v.min(axis=1),
            v_high=nodes.v.max(axis=1),
            shift=nodes.shift,
            pitch=nodes.pitch,
            slant=nodes.slant,
            column=window.x,
            group_u=nodes.group_u,
            group_v=nodes.group_v,
        )

    def _known_grid(self, window: Window) -> PixelGrid:
        """Return the grid of a window from the map, which is computed where it is not known."""
        x, y = self._compute_nodes(window)
        rows, columns = window.height + 1, window.width + 1
        if rows * columns > self._memory.shape[1]:
            self._memory = np.empty((2, rows * columns))
        u, v = self._memory[:, : rows * columns].reshape(2, rows, columns)
        v_low, v_high = np.empty((2, rows))
        nodes = self._nodes
        cut_nodes(nodes.u, nodes.v, y, x, u, v, v_low, v_high)
        first, last = (k // GROUP - nodes.first_group for k in (window.x, window.x_end))
        part = slice(y, y + window.height), slice(first, last + 1)
        return PixelGrid(
            width=window.width,
            height=window.height,
            u=u,
            v=v,
            v_low=v_low,
            v_high=v_high,
            shift=nodes.shift,
            pitch=nodes.pitch,
            slant=nodes.slant,
            column=window.x,
            group_u=np.ascontiguousarray(nodes.group_u[part]),
            group_v=np.ascontiguousarray(nodes.group_v[part]),
        )

    def _compute_nodes(self, window: Window) -> tuple[int, int]:
        """Compute the nodes of a window where they are not known; return column and row of the first one."""
        margin = self._nodes.window.width - self.camera.width
        while not self._nodes.window.contains(window):
            margin *= 2
            self._cover(self.camera.frame.padded(margin))
        x, y = window.x - self._nodes.window.x, window.y - self._nodes.window.y
        tiles = (
            slice(y // _TILE, (y + window.height) // _TILE + 1),
            slice(x // _TILE, (x + window.width) // _TILE + 1),
        )
        known = self._known[tiles]
        if not known.all():
            for j, i in np.argwhere(~known):
                self._compute(int(j) + tiles[0].start, int(i) + tiles[1].start)
        return x, y

    def _cover(self, window: Window) -> None:
        """Make room for a window."""
        self._nodes = _Nodes(window, self.camera.width)
        rows, columns = self._nodes.u.shape
        self._known = np.zeros(((rows - 1) // _TILE + 1, (columns - 1) // _TILE + 1), dtype=np.bool_)

    def _compute(self, j: int, i: int) -> None:
        """Compute the nodes of a tile up to the first ones of the next tiles."""
        nodes, j0, i0 = self._nodes, j * _TILE, i * _TILE
        j1, i1 = min(j0 + _TILE + 1, len(nodes.rows)), min(i0 + _TILE + 1, len(nodes.columns))
        if not nodes.compute(self._lens, j0, j1, i0, i1):
            raise no_inverse(self.distortion, nodes.window)
        self._known[j, i] = True
