"""Compilation of the kernels of perception and of the cameras, ahead of a trial."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from msrr_bullet.sensors.camera_motion import CameraMotion
from msrr_bullet.sensors.image_noise import ImageNoise
from msrr_bullet.sensors.kernels.image_motion import place_tags
from msrr_perception.kernels.warm import warm
from msrr_scenes.geometry.distortion import COEFFICIENTS
from msrr_scenes.geometry.pinhole import PinholeCamera, Window
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.specs.scene import Scene


def prepare_cameras(scene: Scene, announce: Callable[[str], None]) -> None:
    """Compile the kernels that perception and the cameras of ``scene`` need, unless they are on disk already.

    Args:
        scene: Scene whose cameras name the renderers.
        announce: Called with a message before a compilation begins.
    """
    warm(announce)
    if scene.perception != "images":
        return
    owners = np.empty(0, dtype=np.int64)
    tags = place_tags(np.empty((0, 4, 3)), owners, np.empty((0, 4)))
    CameraMotion({}, None, tags, owners).image_speed(PinholeCamera(8, 8, 8.0), SE3())
    ImageNoise(0, 0.0, 0.0).read_out(np.zeros((1, 1), dtype=np.uint8), Window(0, 0, 1, 1), 0)
    cameras = [scene.cameras.onboard, *([scene.cameras.overhead] if scene.cameras.overhead else [])]
    if any(camera.renderer.name == "raster" for camera in cameras):
        from msrr_bullet.render.raster.rasterizer import compile_kernels

        errors = scene.as_built.onboard, scene.as_built.overhead
        deviations = [getattr(error, key) for error in errors for key in COEFFICIENTS]
        distorted = any(camera.lens.distorts for camera in cameras)
        compile_kernels(announce, lens=distorted or any(k.error or k.sigma for k in deviations))
