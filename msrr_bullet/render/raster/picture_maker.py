"""One world's faces, and pictures of them: what lies between the simulator and the kernels."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from msrr_bullet.render.raster.assembly import assemble
from msrr_bullet.render.raster.kernels.pattern import CELL_SAMPLES, SAMPLES, rooks
from msrr_bullet.render.raster.kernels.pipeline import draw
from msrr_bullet.render.raster.kernels.records import Ground, Light, View
from msrr_bullet.render.raster.kernels.workspace import Workspace
from msrr_bullet.render.raster.look import VisualShape
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.pinhole import PinholeCamera, Window
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.messages import Pixels

#: Nothing nearer is drawn, so that a camera may sit inside a body [m].
NEAR = 0.01

#: The light of the scene, the same as TinyRenderer is given.
_TOWARDS_LIGHT = np.array([-0.45, 0.25, 0.86])
LIGHT = Light(_TOWARDS_LIGHT / np.linalg.norm(_TOWARDS_LIGHT), ambient=0.6, diffuse=0.4)


class PictureMaker:
    """Draws a fixed set of shapes on moving frames."""

    def __init__(self, looks: Sequence[VisualShape], movers: int) -> None:
        """Prepare the shapes.

        Args:
            looks: Shapes, each on a mover.
            movers: Number of movers.

        Raises:
            GeometryError: More faces than can be told apart.
        """
        self._geometry, self._textures = assemble(looks)
        self._workspace = Workspace(self._geometry, movers)
        self._pattern, self._cell_pattern = rooks(SAMPLES), rooks(CELL_SAMPLES)

    def picture(
        self, camera: PinholeCamera, X_WC: SE3, window: Window, poses: Array, ground: Ground
    ) -> Pixels:
        """Return the mono8 pixels of ``window``, shape (height, width).

        Args:
            camera: Intrinsics.
            X_WC: Pose of the camera.
            window: Any rectangle, inside or outside the frame.
            poses: Position [m] and quaternion xyzw of each mover in W, shape (M, 7).
            ground: The floor.
        """
        out = np.empty((window.height, window.width), dtype=np.uint8)
        draw(
            View(
                camera.focal,
                0.5 * camera.width,
                0.5 * camera.height,
                window.x,
                window.y,
                window.width,
                window.height,
                NEAR,
            ),
            poses,
            X_WC.R,
            X_WC.p,
            LIGHT,
            self._geometry,
            self._textures,
            ground,
            self._pattern,
            self._cell_pattern,
            self._workspace.fit(window.width),
            out,
        )
        return out
