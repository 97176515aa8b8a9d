"""Pictures that are kept for as long as nothing in them moves, as those of units that are parked.

A picture is a function of the camera, of the window, and of the poses of the bodies that show in it: while
these are the same, bit for bit, so is the picture.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from msrr_bullet.render.raster.kernels.records import Geometry
from msrr_bullet.render.raster.lens_map import LensMap
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.pinhole import PinholeCamera, Window
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.messages import Pixels

#: Number of pictures that are kept: those of one second in which an overhead camera reads 16 units that
#: drive at 10 Hz, before it reads again one that is parked.
_MOST = 256

#: Size from which on a picture is not kept [px]. With it, all kept pictures take 8 MB at most.
_LARGEST_PX = 1 << 15


class KeptPictures:
    """The latest picture of each of the windows of a camera that were drawn last, while it stays in place."""

    def __init__(self, camera: PinholeCamera, lens: LensMap | None, radii: Array) -> None:
        """Begin without a picture.

        Each radius, shape (M,) [m], is that of a ball about the origin of a moving frame that holds all its
        shapes; see :func:`frame_radii`. An ideal lens has no map.
        """
        self._camera = camera
        self._lens = lens
        self._radii = radii
        self._seen_from: bytes | None = None
        self._pictures: dict[Window, tuple[Array, Pixels]] = {}  # poses of the moving frames, and the pixels

    def find(self, X_WC: SE3, window: Window, poses: Array) -> Pixels | None:
        """Return the pixels of a window, read-only, if they can be no others than when it was drawn last.

        All is as for :meth:`msrr_bullet.render.raster.rasterizer.Rasterizer.draw`.
        """
        if window not in self._pictures or self._seen_from != _bits(X_WC):
            return None
        before, pixels = self._pictures[window]
        moved = np.flatnonzero((before != poses).any(axis=1))
        if moved.size:
            places = np.concatenate([before[moved, :3], poses[moved, :3]])
            radii = np.tile(self._radii[moved], 2)
            # What the window shows of the image of an ideal lens.
            part = window if self._lens is None else self._lens.bounds(window)
            if _may_show(self._camera, (places - X_WC.p) @ X_WC.R, radii, part).any():
                return None
        return pixels

    def keep(self, X_WC: SE3, window: Window, poses: Array, pixels: Pixels) -> None:
        """Keep the pixels of a window, which become read-only; see :meth:`find`."""
        if window.area > _LARGEST_PX:
            return
        seen_from = _bits(X_WC)
        if self._seen_from != seen_from:
            self._pictures.clear()
            self._seen_from = seen_from
        pixels.setflags(write=False)
        self._pictures.pop(window, None)
        self._pictures[window] = poses, pixels
        if len(self._pictures) > _MOST:
            del self._pictures[next(iter(self._pictures))]


def frame_radii(geometry: Geometry, frame_count: int) -> Array:
    """Return the radius of a ball about the origin of each moving frame that holds all its shapes [m]."""
    balls, radii = geometry.shape_ball, np.zeros(frame_count)
    np.maximum.at(radii, geometry.shape_frame, np.linalg.norm(balls[:, :3], axis=1) + balls[:, 3])
    return radii


def _bits(X_WC: SE3) -> bytes:
    """Return the bits of a pose: to compare them takes less time than to compare arrays."""
    return X_WC.p.tobytes() + X_WC.R.tobytes()


def _may_show(camera: PinholeCamera, p_C: Array, radius: Array, window: Window) -> NDArray[np.bool_]:
    """Return which balls may touch a window, shape (N,), by the four planes through its edges; in doubt, all.

    Their middles are in C, shape (N, 3), and the radii have shape (N,) [m].
    """
    x, y, z = p_C.T
    slack = radius + 1e-6
    touches = np.ones(len(p_C), dtype=np.bool_)
    # A pixel counts from its middle: it spans half a pixel to either side.
    for edge, middle, sign, along in (
        (window.x, camera.cx, 1.0, x),
        (window.x_end, camera.cx, -1.0, x),
        (window.y, camera.cy, 1.0, y),
        (window.y_end, camera.cy, -1.0, y),
    ):
        slope = (edge - 0.5 - middle) / camera.focal
        touches &= sign * (along - slope * z) >= -slack * np.sqrt(1.0 + slope * slope)
    return touches
