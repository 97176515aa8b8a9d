"""Rendering with PyBullet's TinyRenderer: any window through an off-centre projection, supersampled."""

from __future__ import annotations

import cv2
import numpy as np
import pybullet
from numpy.typing import NDArray

from msrr_bullet.render.renderer import RenderContext
from msrr_scenes.messages import Pixels
from msrr_scenes.pinhole import PinholeCamera, Window
from msrr_scenes.se3 import SE3

Array = NDArray[np.float64]

#: From the optical frame (y down, z forward) to OpenGL's eye frame (y up, z backward).
_X_CG = SE3(np.diag([1.0, -1.0, -1.0]), np.zeros(3))

#: Clip planes [m]. The near one lets a camera sit inside a mast: nothing of interest is nearer than that.
_NEAR, _FAR = 0.01, 60.0

#: Depth that TinyRenderer leaves where no body was drawn, less its rounding.
_BACKGROUND_DEPTH = 0.99999


class TinyRenderer:
    """PyBullet's CPU renderer. It pays per covered sample; the floor is composited, not drawn.

    Where it takes its samples is not where one expects: sample column i lies at i, not at i + 1/2, and rows
    are counted from below, so that its principal point is off by half a sample. The projection matrix
    undoes that.
    """

    def __init__(self, context: RenderContext, composite_floor: bool = True) -> None:
        """Render the bodies of ``context.client``.

        Args:
            context: Client, supersampling and floor.
            composite_floor: False leaves the background the wall's grey, for a world that has a floor mesh.
        """
        self._client = context.client
        self._samples = context.samples
        self._floor = context.floor
        self._composite_floor = composite_floor

    def render(self, camera: PinholeCamera, X_WC: SE3, window: Window) -> Pixels:
        """Return the mono8 pixels of ``window``, shape (height, width); see :class:`Renderer`."""
        n = self._samples
        _, _, rgba, depth, _ = pybullet.getCameraImage(
            n * window.width,
            n * window.height,
            viewMatrix=_column_major((X_WC @ _X_CG).inverse().matrix()),
            projectionMatrix=_column_major(window_projection(camera, window, n)),
            # PyBullet keeps the light of the call before for every argument that is left out.
            lightDirection=[-0.45, 0.25, 0.86],
            lightColor=[1.0, 1.0, 1.0],
            lightDistance=10.0,
            shadow=0,
            lightAmbientCoeff=0.6,
            lightDiffuseCoeff=0.4,
            lightSpecularCoeff=0.0,
            renderer=pybullet.ER_TINY_RENDERER,
            flags=pybullet.ER_NO_SEGMENTATION_MASK,
            physicsClientId=self._client,
        )
        grey = cv2.cvtColor(rgba, cv2.COLOR_RGBA2GRAY)
        empty = np.where(depth >= _BACKGROUND_DEPTH, np.uint8(255), np.uint8(0))
        if cv2.hasNonZero(empty):
            cv2.bitwise_and(grey, cv2.bitwise_not(empty), dst=grey)
            image = _average(grey, window) + _average(empty, window) * self._background(camera, X_WC, window)
        else:
            image = _average(grey, window)
        return np.rint(image).astype(np.uint8)

    def _background(self, camera: PinholeCamera, X_WC: SE3, window: Window) -> NDArray[np.float32]:
        """Return what is seen where no body is, over 255: the weight of an empty sample."""
        if not self._composite_floor:
            return np.full((window.height, window.width), self._floor.wall / 255.0, dtype=np.float32)
        return self._floor.image(camera, X_WC, window) * np.float32(1.0 / 255.0)


def window_projection(camera: PinholeCamera, window: Window, samples: int) -> Array:
    """Return the OpenGL projection, shape (4, 4), by which TinyRenderer samples a window where it should.

    Sample (i, j) of the ``samples`` times finer raster is taken at full-frame pixel
    ``(x - 1/2 + (i + 1/2) / samples, y - 1/2 + (j + 1/2) / samples)``.
    """
    w, h = window.width, window.height
    middle_x = 2.0 * (camera.cx - window.x + 0.5) / w - 1.0 - 1.0 / (samples * w)
    middle_y = 1.0 - 2.0 * (camera.cy - window.y + 0.5) / h - 1.0 / (samples * h)
    depth = _FAR - _NEAR
    return np.array(
        [
            [2.0 * camera.focal / w, 0.0, -middle_x, 0.0],
            [0.0, 2.0 * camera.focal / h, -middle_y, 0.0],
            [0.0, 0.0, -(_FAR + _NEAR) / depth, -2.0 * _FAR * _NEAR / depth],
            [0.0, 0.0, -1.0, 0.0],
        ]
    )


def _column_major(M: Array) -> list[float]:
    return [float(a) for a in M.T.reshape(-1)]


def _average(raster: Pixels, window: Window) -> NDArray[np.float32]:
    """Average the samples of each pixel, without rounding."""
    size = (window.width, window.height)
    mean = cv2.resize(raster.astype(np.float32), size, interpolation=cv2.INTER_AREA)
    return np.asarray(mean, dtype=np.float32)
