"""Pictures of shapes on moving frames: the kernels together with the memory that they work on."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np

from msrr_bullet.render.raster.assembly import VisualShape, assemble
from msrr_bullet.render.raster.floor_texture import pack_floor
from msrr_bullet.render.raster.kernels.compiler import compiler
from msrr_bullet.render.raster.kernels.grid import GROUP
from msrr_bullet.render.raster.kernels.pipeline import BAND, draw, draw_through_lens
from msrr_bullet.render.raster.kernels.records import (
    Corners,
    FloorTexture,
    Geometry,
    Light,
    PixelGrid,
    ProjectedFaces,
    RowBuffers,
    Samples,
    View,
    Workspace,
)
from msrr_bullet.render.raster.kernels.sample_positions import CELL_SAMPLES, SAMPLES, sample_positions
from msrr_bullet.render.raster.lens_map import LensMap
from msrr_bullet.render.raster.memory import untouched
from msrr_bullet.render.raster.mesh import box
from msrr_bullet.render.renderer import AMBIENT, DIFFUSE, NEAR_M, TOWARDS_LIGHT
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.distortion import Distortion
from msrr_scenes.geometry.pinhole import PinholeCamera, Window
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.messages import Pixels

_LIGHT = Light(np.array(TOWARDS_LIGHT) / np.linalg.norm(TOWARDS_LIGHT), AMBIENT, DIFFUSE)


class Rasterizer:
    """Draws a fixed set of shapes on moving frames."""

    def __init__(self, shapes: Sequence[VisualShape], frame_count: int) -> None:
        """Prepare the shapes, each of which is on a moving frame.

        Raises:
            GeometryError: There are more faces than identities.
        """
        self.geometry, self._textures = assemble(shapes)
        self._frame_count = frame_count
        self._positions, self._cell_positions = sample_positions(SAMPLES), sample_positions(CELL_SAMPLES)
        self._width = 0
        self._workspace = _workspace(self.geometry, frame_count, 0)

    def draw(
        self,
        camera: PinholeCamera,
        X_WC: SE3,
        window: Window,
        poses: Array,
        floor: FloorTexture,
        lens: LensMap | None = None,
    ) -> Pixels:
        """Return the mono8 pixels of ``window``, shape (height, width).

        The window is any rectangle, inside or outside the frame. Poses are position [m] and quaternion xyzw
        of each moving frame in W, shape (M, 7). An ideal lens has no map.

        Raises:
            GeometryError: The window reaches beyond the frame to where the lens has no inverse.
        """
        if window.width > self._width:  # kept from picture to picture: fresh memory costs more than drawing
            self._width = window.width
            self._workspace = _workspace(self.geometry, self._frame_count, window.width)
        out = np.empty((window.height, window.width), dtype=np.uint8)
        scene = (
            poses,
            X_WC.R,
            X_WC.p,
            _LIGHT,
            self.geometry,
            self._textures,
            floor,
            self._positions,
            self._cell_positions,
            self._workspace,
        )
        if lens is None:
            draw(_view(camera, window), _ideal_grid(window), *scene, out)
            return out
        for top in range(0, window.height, BAND):  # so that a whole frame takes little memory for its corners
            rows = out[top : top + BAND]
            strip = Window(window.x, window.y + top, window.width, len(rows))
            draw_through_lens(_view(camera, lens.bounds(strip)), lens.grid(strip), *scene, rows)
        return out


def _view(camera: PinholeCamera, window: Window) -> View:
    return View(
        camera.focal,
        camera.cx + 0.5,  # kernels count from pixel edges
        camera.cy + 0.5,
        window.x,
        window.y,
        window.width,
        window.height,
        NEAR_M,
    )


def _ideal_grid(window: Window) -> PixelGrid:
    """Return the corners of the pixels of a window behind a lens that does not distort."""
    return PixelGrid(
        width=window.width,
        height=window.height,
        u=window.x,
        v=window.y,
        v_low=window.y,
        v_high=window.y,
        shift=0.0,
        pitch=1.0,
        slant=0.0,
        column=window.x,
        group_u=GROUP * (window.x // GROUP + 0.5),
        group_v=window.y + 0.5,
    )


def compile_kernels(announce: Callable[[str], None], lenses: Iterable[bool]) -> None:
    """Load the kernels' machine code from disk, or compile it and keep it there.

    Call it before a pool of workers starts, or every worker compiles for itself. ``announce`` is called with
    a message before a compilation begins, but not before a load from disk. ``lenses`` tells for each lens to
    be drawn whether it distorts; both kinds have kernels of their own.
    """
    rasterizer = Rasterizer([VisualShape(0, SE3(), box(np.ones(3)), grey=1.0)], frame_count=1)
    floor = pack_floor([np.zeros((1, 1), dtype=np.float32)], period=1.0, wall=0.0)
    camera = PinholeCamera(8, 8, 8.0)
    poses = np.array([[0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 1.0]])
    for distorts in set(lenses):
        if not compiler.is_compiled(draw_through_lens if distorts else draw):
            announce(
                "Compiling the raster renderer, once for this version (up to a minute), into "
                f"{compiler.folder}"
            )
        lens = LensMap(camera, Distortion(k1=0.1)) if distorts else None
        for window in (camera.frame, Window(0, 0, 1, 1)):  # a lens treats wide and narrow ones differently
            rasterizer.draw(camera, SE3(), window, poses, floor, lens)


def _workspace(geometry: Geometry, frame_count: int, width: int) -> Workspace:
    """Return memory for all faces and for one band of a window up to ``width`` wide."""
    faces, edges = len(geometry.planes), len(geometry.corners) + len(geometry.planes)
    pixels = BAND * width
    return Workspace(
        R_CM=np.empty((frame_count, 3, 3)),
        p_CM=np.empty((frame_count, 3)),
        R_WM=np.empty((frame_count, 3, 3)),
        projected=np.empty((len(geometry.vertices), 5)),
        faces=ProjectedFaces(
            inverse_depth=np.empty((faces, 3)),
            nearest=np.empty(faces),
            box=np.empty((faces, 4)),
            edge_start=np.zeros(faces + 1, dtype=np.int64),
            edges=np.empty((edges, 3)),
            inner=np.empty(edges, dtype=np.bool_),
            grey=np.empty(faces),
            shade=np.empty((faces, 3)),
            uv=np.empty((faces, 2, 3)),
            kind=np.empty(faces, dtype=np.int64),
            texture=np.empty(faces, dtype=np.int64),
            surface=np.empty(faces, dtype=np.int64),
            cells=np.empty((faces, 4), dtype=np.int64),
            spans=np.empty((faces, 4), dtype=np.int64),
        ),
        corners=Corners(
            depth=np.empty((BAND + 1, width + 1), dtype=np.float32),
            identity=np.empty((BAND + 1, width + 1), dtype=np.int32),
            edge_depth=np.empty((BAND, width), dtype=np.float32),
        ),
        row=RowBuffers(
            flags=np.zeros(8 * (width // 8 + 1), dtype=np.uint8),
            texel=np.empty(max(width + 1, CELL_SAMPLES), dtype=np.uint32),
            x=np.empty(width, dtype=np.float32),
            y=np.empty(width, dtype=np.float32),
        ),
        samples=Samples(
            start=np.empty(BAND + 1, dtype=np.int64),
            # One more: the column of a pixel is written before it is known to be mixed.
            column=np.empty(pixels + 1, dtype=np.int32),
            key=untouched((pixels, SAMPLES), np.int64),  # few pixels are mixed
            farthest=np.empty(pixels, dtype=np.int64),
            maps=untouched((pixels + 1, 6), np.float64),
        ),
    )
