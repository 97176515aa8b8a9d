"""The raster renderer: the world of a PyBullet client, drawn by kernels of our own."""

from __future__ import annotations

from msrr_bullet.render.raster.bodies import Bodies, loaded_bodies
from msrr_bullet.render.raster.kernels.ground import ground_of
from msrr_bullet.render.raster.picture_maker import PictureMaker
from msrr_bullet.render.renderer import RenderContext
from msrr_scenes.geometry.pinhole import PinholeCamera, Window
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.messages import Pixels


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
            self._maker = PictureMaker(self._bodies.looks, self._bodies.movers)
        return self._maker.picture(camera, X_WC, window, self._bodies.poses(), self._ground)
