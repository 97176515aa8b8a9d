"""Compilation of the kernels of perception and of the cameras, ahead of a trial."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext

import numpy as np

from msrr_bullet.sensors.camera_motion import CameraMotion
from msrr_bullet.sensors.image_noise import ImageNoise
from msrr_bullet.sensors.kernels.image_motion import place_tags
from msrr_perception.kernels.compiled import compiler as perception
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
    cameras = [scene.cameras.onboard, *([scene.cameras.overhead] if scene.cameras.overhead else [])]
    draws = scene.perception == "images"
    if draws and any(camera.renderer.name == "raster" for camera in cameras):
        from msrr_bullet.render.raster.rasterizer import compile_kernels

        errors = scene.as_built.onboard, scene.as_built.overhead
        deviations = [getattr(error, key) for error in errors for key in COEFFICIENTS]
        distorted = any(camera.lens.distorts for camera in cameras)
        with nullcontext() if perception.is_compiled() else _perception_compiled_beside():
            compile_kernels(announce, lens=distorted or any(k.error or k.sigma for k in deviations))
    warm(announce)
    if draws:
        owners = np.empty(0, dtype=np.int64)
        tags = place_tags(np.empty((0, 4, 3)), owners, np.empty((0, 4)))
        CameraMotion({}, None, tags, owners).image_speed(PinholeCamera(8, 8, 8.0), SE3())
        ImageNoise(0, 0.0, 0.0).read_out(np.zeros((1, 1), dtype=np.uint8), Window(0, 0, 1, 1), 0)


@contextmanager
def _perception_compiled_beside() -> Iterator[None]:
    """Compile perception in another process meanwhile, because it takes as long as the renderer does.

    Should that process fail, this one compiles perception when it loads it.
    """
    program = "from msrr_perception.kernels.warm import warm; warm()"
    process = subprocess.Popen(
        [sys.executable, "-P", "-c", program], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    try:
        yield
        process.wait()
    finally:
        process.kill()
        process.wait()
