"""PyBullet's TinyRenderer: any window through an off-centre projection, with several samples per pixel."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from msrr_bullet.render.floor import Floor
from msrr_bullet.render.renderer import AMBIENT, DIFFUSE, NEAR_M, TOWARDS_LIGHT, RenderContext
from msrr_bullet.silent_pybullet import pybullet
from msrr_scenes.arrays import Array
from msrr_scenes.errors import MsrrError, ParameterError
from msrr_scenes.geometry.pinhole import PinholeCamera, Window
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.messages import Pixels
from msrr_scenes.temporary_files import room_for_temporary_files

#: From the optical frame (y down, z forward) to OpenGL's eye frame (y up, z backward).
_X_CG = SE3(np.diag([1.0, -1.0, -1.0]), np.zeros(3))

#: Distance of the far clip plane [m].
_FAR = 60.0

#: Depth that TinyRenderer leaves where no body was drawn, less its rounding.
_BACKGROUND_DEPTH = 0.99999

#: Half the edge of the floor mesh [m]. TinyRenderer walks over the pixels of a triangle, not over its metres.
_FLOOR_REACH = 40.0

#: User data that marks the floor mesh among the bodies of a client.
_FLOOR_MARK = "msrr_floor_mesh"


class TinyRenderer:
    """PyBullet's CPU renderer, whose time grows with the samples covered: the floor is composited, not drawn.

    TinyRenderer does not anti-alias. A pixel is the mean of ``samples**2`` renderings, each shifted by a
    fraction of a pixel such that all their columns and all their rows differ (a rotated grid). Nearly upright
    and level edges, which is most of a marker's when the camera is level, are then resolved to
    1 / samples**2 of a pixel, where a plain grid of the same cost resolves them to 1 / samples. PyBullet
    computes with single precision, so that a few pixels at edges may differ by a sample from those of another
    window.
    """

    def __init__(self, context: RenderContext, floor: Literal["composited", "mesh"] = "composited") -> None:
        """Draw the bodies of ``context.client`` and make its infinite planes invisible.

        The floor "composited" is a homography of the floor's texture behind the bodies; "mesh" adds a
        textured mesh to the client, as simulators usually do, to measure the difference and to check one
        against the other (full frames take 2 to 6 times as long).
        """
        if floor not in ("composited", "mesh"):
            raise ParameterError({"floor": f"has to be 'composited' or 'mesh', found {floor!r:.40}"})
        self._client = context.client
        self._shifts = rotated_grid(context.samples)
        self._floor = context.floor
        self._composite = floor == "composited"
        _hide_planes(context.client)
        if floor == "mesh":
            _ensure_floor_mesh(context.client, context.floor)

    def render(self, camera: PinholeCamera, X_WC: SE3, window: Window) -> Pixels:
        """Return the mono8 pixels of ``window``, shape (height, width); see :class:`Renderer`."""
        view = _column_major((X_WC @ _X_CG).inverse().matrix())
        bodies = np.zeros((window.height, window.width), dtype=np.float32)
        empty = np.zeros((window.height, window.width), dtype=np.float32)
        for shift in self._shifts:
            grey, depth = self._sample(view, window_projection(camera, window, shift), window)
            background = depth >= _BACKGROUND_DEPTH
            grey[background] = 0
            bodies += grey
            empty += background
        if empty.any():
            bodies += empty * self._background(camera, X_WC, window)
        bodies *= np.float32(1.0 / len(self._shifts))
        return np.rint(bodies, out=bodies).astype(np.uint8)

    def _sample(
        self, view: list[float], projection: Array, window: Window
    ) -> tuple[Pixels, NDArray[np.float32]]:
        """Return grey levels and depths, each of shape (height, width), one sample per pixel."""
        _, _, rgba, depth, _ = pybullet.getCameraImage(
            window.width,
            window.height,
            viewMatrix=view,
            projectionMatrix=_column_major(projection),
            # PyBullet keeps the light of the call before for every argument that is left out.
            lightDirection=TOWARDS_LIGHT,
            lightColor=[1.0, 1.0, 1.0],
            lightDistance=10.0,
            shadow=0,
            lightAmbientCoeff=AMBIENT,
            lightDiffuseCoeff=DIFFUSE,
            lightSpecularCoeff=0.0,
            renderer=pybullet.ER_TINY_RENDERER,
            flags=pybullet.ER_NO_SEGMENTATION_MASK,
            physicsClientId=self._client,
        )
        return np.asarray(cv2.cvtColor(rgba, cv2.COLOR_RGBA2GRAY), dtype=np.uint8), depth

    def _background(self, camera: PinholeCamera, X_WC: SE3, window: Window) -> NDArray[np.float32]:
        """Return the grey levels where no body is, shape (height, width)."""
        if self._composite:
            return self._floor.image(camera, X_WC, window)
        return np.full((window.height, window.width), self._floor.wall, dtype=np.float32)


def _hide_planes(client: int) -> None:
    """Make infinite planes invisible; TinyRenderer would draw those that are there for contact only."""
    for index in range(pybullet.getNumBodies(physicsClientId=client)):
        body = pybullet.getBodyUniqueId(index, physicsClientId=client)
        for shape in pybullet.getVisualShapeData(body, physicsClientId=client):
            if shape[2] == pybullet.GEOM_PLANE:
                pybullet.changeVisualShape(body, shape[1], rgbaColor=[0, 0, 0, 0], physicsClientId=client)


def _ensure_floor_mesh(client: int, floor: Floor) -> None:
    """Add the floor's mesh to the client unless it is there already.

    The mesh has no collision shape and takes no part in the physics.
    """
    for index in range(pybullet.getNumBodies(physicsClientId=client)):
        body = pybullet.getBodyUniqueId(index, physicsClientId=client)
        if pybullet.getUserDataId(body, _FLOOR_MARK, physicsClientId=client) >= 0:
            return
    turns = _FLOOR_REACH / floor.period
    square = [[-1, -1], [1, -1], [1, 1], [-1, 1]]
    shape = pybullet.createVisualShape(
        pybullet.GEOM_MESH,
        vertices=[[_FLOOR_REACH * x, _FLOOR_REACH * y, 0.0] for x, y in square],
        indices=[0, 1, 2, 0, 2, 3],
        # Kept positive: TinyRenderer truncates where it should take the floor.
        uvs=[[turns * (x + 1.0), turns * (y + 1.0)] for x, y in square],
        normals=[[0.0, 0.0, 1.0]] * 4,
        rgbaColor=[1, 1, 1, 1],
        physicsClientId=client,
    )
    body = pybullet.createMultiBody(baseMass=0.0, baseVisualShapeIndex=shape, physicsClientId=client)
    pybullet.changeVisualShape(body, -1, textureUniqueId=_load_texture(client, floor), physicsClientId=client)
    pybullet.addUserData(body, _FLOOR_MARK, "1", physicsClientId=client)


@room_for_temporary_files()
def _load_texture(client: int, floor: Floor) -> int:
    # A texture's last row is at v = 0, where y is least.
    texture = np.clip(np.rint(floor.levels[0][::-1]), 0, 255).astype(np.uint8)
    encoded, data = cv2.imencode(".png", cv2.cvtColor(texture, cv2.COLOR_GRAY2BGR))
    if not encoded:
        raise MsrrError("OpenCV cannot write the floor's texture as PNG")
    with tempfile.TemporaryDirectory(prefix="msrr_floor_") as folder:
        path = Path(folder) / "floor.png"
        path.write_bytes(data.tobytes())
        handle: int = pybullet.loadTexture(str(path), physicsClientId=client)
    return handle


def rotated_grid(samples: int) -> Array:
    """Return ``samples**2`` positions in a pixel, from its centre, shape (samples**2, 2) [px].

    They form a plain grid, sheared in both directions so that no two positions share a column or a row.
    """
    i, j = (a.ravel() for a in np.meshgrid(np.arange(samples), np.arange(samples), indexing="ij"))
    columns = samples * i + j
    rows = samples * j + (samples - 1 - i)
    return (np.stack([columns, rows], axis=1) + 0.5) / samples**2 - 0.5


def window_projection(camera: PinholeCamera, window: Window, shift: Array) -> Array:
    """Return the OpenGL projection, shape (4, 4), by which TinyRenderer samples a window.

    TinyRenderer samples column i at i, not at i + 1/2, and counts rows from below, so that its principal
    point is off by half a pixel. That is undone here. The camera is that of the full frame; ``shift`` is the
    position of the sample in each pixel, from its centre, shape (2,) [px].
    """
    w, h = window.width, window.height
    # The principal point in pixels from the window's first sample, then in NDC.
    x = camera.cx - window.x - float(shift[0])
    y = camera.cy - window.y - float(shift[1])
    middle_x = 2.0 * x / w - 1.0
    middle_y = 1.0 - 2.0 * (y + 1.0) / h
    depth = _FAR - NEAR_M
    return np.array(
        [
            [2.0 * camera.focal / w, 0.0, -middle_x, 0.0],
            [0.0, 2.0 * camera.focal / h, -middle_y, 0.0],
            [0.0, 0.0, -(_FAR + NEAR_M) / depth, -2.0 * _FAR * NEAR_M / depth],
            [0.0, 0.0, -1.0, 0.0],
        ]
    )


def _column_major(M: Array) -> list[float]:
    return [float(a) for a in M.T.reshape(-1)]
