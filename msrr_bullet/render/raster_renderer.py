"""The raster renderer: the bodies of a PyBullet client, drawn by the compiled rasteriser."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

from msrr_bullet.render.floor import Floor
from msrr_bullet.render.raster.bodies import LoadedBodies
from msrr_bullet.render.raster.floor_texture import pack_floor
from msrr_bullet.render.raster.kept_pictures import KeptPictures, frame_radii
from msrr_bullet.render.raster.kernels.records import FloorTexture
from msrr_bullet.render.raster.lens_map import LensMap
from msrr_bullet.render.raster.rasterizer import Rasterizer
from msrr_bullet.render.renderer import Instant, RenderContext
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.distortion import Distortion
from msrr_scenes.geometry.pinhole import PinholeCamera, Window
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.messages import Pixels


class RasterRenderer:
    """Exact visibility at pixel corners, sixteen samples where they disagree.

    The shapes of all bodies are read when a body has been loaded or removed since the last picture. A colour
    or texture that changes later is not noticed. Cameras that look at the same bodies can share a renderer.
    """

    def __init__(self, context: RenderContext) -> None:
        """Draw the bodies of ``context.client``; the number of samples of the context is not used."""
        self._client = context.client
        self._floor = context.floor
        self._bodies: LoadedBodies | None = None
        self._lenses: dict[tuple[PinholeCamera, Distortion], LensMap] = {}

    def render(self, camera: PinholeCamera, X_WC: SE3, window: Window) -> Pixels:
        """Return the mono8 pixels of ``window``, shape (height, width); see :class:`Renderer`.

        Raises:
            GeometryError: A body was loaded that has a visual shape which cannot be drawn.
        """
        return self._picture(camera, X_WC, window, self._loaded().poses(), None)

    def render_instants(
        self,
        camera: PinholeCamera,
        views: Sequence[tuple[Window, Instant]],
        distortion: Distortion | None = None,
    ) -> list[Pixels]:
        """Return the mono8 pixels of each window at its instant; see :class:`ExposureRenderer`.

        Raises:
            GeometryError: A body was loaded that has a visual shape which cannot be drawn, or the polynomial
                of the lens has no inverse in the frame.
        """
        bodies = self._loaded()
        poses = bodies.poses()
        lens = None if distortion is None else self._map_of(camera, distortion)
        return [
            self._picture(camera, instant.X_WC, window, bodies.displaced(poses, instant.displaced), lens)
            for window, instant in views
        ]

    def _picture(
        self,
        camera: PinholeCamera,
        X_WC: SE3,
        window: Window,
        poses: Array,
        lens: LensMap | None,
    ) -> Pixels:
        """Return the pixels of a window with the moving frames at ``poses``; draw only what may be new."""
        if (camera, lens) not in self._kept:
            self._kept[camera, lens] = KeptPictures(camera, lens, self._radii)
        kept = self._kept[camera, lens]
        pixels = kept.find(X_WC, window, poses)
        if pixels is None:
            pixels = self._rasterizer.draw(camera, X_WC, window, poses, _packed(self._floor), lens)
            kept.keep(X_WC, window, poses, pixels)
        return pixels

    def _map_of(self, camera: PinholeCamera, distortion: Distortion) -> LensMap:
        """Return the map of the lens of a camera, and keep it for its next picture."""
        if (camera, distortion) not in self._lenses:
            self._lenses[camera, distortion] = LensMap(camera, distortion)
        return self._lenses[camera, distortion]

    def _loaded(self) -> LoadedBodies:
        if self._bodies is None or not self._bodies.are_loaded():
            self._bodies = LoadedBodies(self._client)
            self._rasterizer = Rasterizer(self._bodies.shapes, self._bodies.frame_count)
            self._radii = frame_radii(self._rasterizer.geometry, self._bodies.frame_count)
            self._kept: dict[tuple[PinholeCamera, LensMap | None], KeptPictures] = {}
        return self._bodies


@lru_cache(maxsize=4)
def _packed(floor: Floor) -> FloorTexture:
    """Return the texture of a floor for the kernels; all cameras and trials share it."""
    return pack_floor(floor.levels, floor.period, floor.wall)
