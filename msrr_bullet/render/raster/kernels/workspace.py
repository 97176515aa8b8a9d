"""Memory that is kept from frame to frame; touching fresh pages would cost more than drawing on them."""

from __future__ import annotations

import numpy as np

from msrr_bullet.render.raster.kernels.pattern import CELL_SAMPLES, SAMPLES
from msrr_bullet.render.raster.kernels.pipeline import BAND
from msrr_bullet.render.raster.kernels.records import Corners, Faces, Geometry, Samples, Scratch, Work


class Workspace:
    """Arrays for the faces of one world and one band of the widest window so far."""

    def __init__(self, geometry: Geometry, movers: int) -> None:
        """Make room for all faces and movers."""
        n, edges = len(geometry.planes), len(geometry.corners) + len(geometry.planes)
        self._movers = movers
        self._seen = np.empty((len(geometry.vertices), 5))
        self._faces = Faces(
            inverse_depth=np.empty((n, 3)),
            nearest=np.empty(n),
            box=np.empty((n, 4)),
            edge_start=np.zeros(n + 1, dtype=np.int64),
            edges=np.empty((edges, 5)),
            inner=np.empty(edges, dtype=np.bool_),
            grey=np.empty(n),
            shade=np.empty((n, 3)),
            uv=np.empty((n, 2, 3)),
            kind=np.empty(n, dtype=np.int64),
            texture=np.empty(n, dtype=np.int64),
            surface=np.empty(n, dtype=np.int64),
            cells=np.empty((n, 4), dtype=np.int64),
        )
        self._width = 0
        self._work = self._room(0)

    def fit(self, width: int) -> Work:
        """Return memory for windows up to ``width`` wide."""
        if width > self._width:
            self._work, self._width = self._room(width), width
        return self._work

    def _room(self, width: int) -> Work:
        pixels = BAND * width
        return Work(
            R_CM=np.empty((self._movers, 3, 3)),
            p_CM=np.empty((self._movers, 3)),
            R_WM=np.empty((self._movers, 3, 3)),
            seen=self._seen,
            faces=self._faces,
            corners=Corners(
                depth=np.empty((BAND + 1, width + 1), dtype=np.float32),
                identity=np.empty((BAND + 1, width + 1), dtype=np.int32),
                sliver=np.empty((BAND, width), dtype=np.float32),
            ),
            scratch=Scratch(
                flags=np.zeros(8 * (width // 8 + 1), dtype=np.uint8),
                place=np.empty(max(width + 1, CELL_SAMPLES), dtype=np.int32),
                x=np.empty(width, dtype=np.float32),
                y=np.empty(width, dtype=np.float32),
            ),
            samples=Samples(
                start=np.empty(BAND + 1, dtype=np.int64),
                # One more: the column of a pixel is written before it is known to be open.
                column=np.empty(pixels + 1, dtype=np.int32),
                # Pages that are never touched cost nothing: few pixels are open.
                key=np.empty((pixels, SAMPLES), dtype=np.int64),
                farthest=np.empty(pixels, dtype=np.int64),
            ),
        )
