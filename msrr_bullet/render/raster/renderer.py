"""The raster renderer: the world of a PyBullet client, drawn by kernels of our own."""

from __future__ import annotations

import numpy as np

from msrr_bullet.render.raster.assembly import assemble
from msrr_bullet.render.raster.bodies import Bodies, loaded_bodies
from msrr_bullet.render.raster.ground import ground_of, view_ground
from msrr_bullet.render.raster.pattern import rooks
from msrr_bullet.render.raster.pipeline import draw
from msrr_bullet.render.raster.projection import Light, View
from msrr_bullet.render.raster.workspace import Workspace
from msrr_bullet.render.renderer import RenderContext
from msrr_scenes.messages import Pixels
from msrr_scenes.pinhole import PinholeCamera, Window
from msrr_scenes.se3 import SE3

#: Nothing nearer is drawn, so that a camera may sit inside a body [m].
NEAR = 0.01

#: The light of the scene, the same as TinyRenderer is given.
_TOWARDS_LIGHT = np.array([-0.45, 0.25, 0.86])
LIGHT = Light(_TOWARDS_LIGHT / np.linalg.norm(_TOWARDS_LIGHT), ambient=0.6, diffuse=0.4)


class RasterRenderer:
    """Exact visibility at pixel corners, sixteen samples where they disagree; see ``docs/renderer.md``.

    Bodies that are loaded or removed are noticed; a changed colour or texture of a loaded body is not, until
    :meth:`refresh`.
    """

    def __init__(self, context: RenderContext) -> None:
        """Draw the bodies of ``context.client``.

        Args:
            context: Client and floor. Its ``samples`` speak of renderers that sample every pixel alike.
        """
        self._client = context.client
        self._pattern = rooks()
        self._ground = ground_of(context.floor)
        self._bodies: Bodies | None = None

    def refresh(self) -> None:
        """Read the shapes of all bodies anew at the next frame."""
        self._bodies = None

    def render(self, camera: PinholeCamera, X_WC: SE3, window: Window) -> Pixels:
        """Return the mono8 pixels of ``window``, shape (height, width); see :class:`Renderer`.

        Raises:
            GeometryError: A body was loaded whose looks cannot be drawn.
        """
        if self._bodies is None or self._bodies.loaded != loaded_bodies(self._client):
            self._bodies = Bodies(self._client)
            self._geometry, self._textures = assemble(self._bodies.looks)
            self._workspace = Workspace(self._geometry, self._bodies.movers)
        middle = (0.5 * camera.width, 0.5 * camera.height)
        X_CW = X_WC.inverse()
        ground_view = view_ground(self._ground, camera.focal, middle, X_WC)
        out = np.empty((window.height, window.width), dtype=np.uint8)
        draw(
            View(camera.focal, *middle, window.x, window.y, window.width, window.height, NEAR),
            self._bodies.poses(),
            X_CW.R,
            X_CW.p,
            LIGHT,
            self._geometry,
            self._textures,
            self._ground,
            ground_view,
            # Inverse depth of the plane z = 0: descent of the ray over height of the camera.
            ground_view.forms[2] / max(float(X_WC.p[2]), 1e-9),
            self._pattern,
            self._workspace.fit(window.width),
            out,
        )
        return out
