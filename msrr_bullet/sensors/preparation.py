"""Compilation of the kernels of perception and of the cameras, ahead of a trial."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from pathlib import Path

import numpy as np

from msrr_bullet.sensors.camera_motion import CameraMotion
from msrr_bullet.sensors.image_noise import ImageNoise
from msrr_bullet.sensors.kernels.image_motion import place_tags
from msrr_perception.kernels.compiled import compiler as perception
from msrr_perception.kernels.edges import intersect_edges
from msrr_perception.kernels.warm import warm
from msrr_scenes.geometry.distortion import COEFFICIENTS
from msrr_scenes.geometry.pinhole import PinholeCamera, Window
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.specs.scene import Scene
from msrr_scenes.temporary_files import room_for


def prepare_cameras(scene: Scene, announce: Callable[[str], None]) -> None:
    """Compile the kernels that perception and the cameras of ``scene`` need, unless they are on disk already.

    ``announce`` is called with a message before a compilation begins.

    Raises:
        NoRoomError: The folder in which they are stored is full.
    """
    draws = scene.perception == "images"
    lenses = tuple(distorts for renderer, distorts in _lenses(scene) if draws and renderer == "raster")
    needs = perception.folder, draws, lenses
    if needs not in _PREPARED:
        with room_for("machine code", "NUMBA_CACHE_DIR", perception.folder):
            _prepare(draws, lenses, announce)
        _PREPARED.add(needs)


#: What this process has prepared: the folder, whether images are drawn, and which lenses distort.
_PREPARED: set[tuple[Path, bool, tuple[bool, ...]]] = set()


def _prepare(draws: bool, lenses: Sequence[bool], announce: Callable[[str], None]) -> None:
    if lenses:
        from msrr_bullet.render.raster.rasterizer import compile_kernels

        with nullcontext() if perception.is_compiled(intersect_edges) else _perception_compiled_beside():
            compile_kernels(announce, lenses)
    warm(announce)
    if draws:
        owners = np.empty(0, dtype=np.int64)
        tags = place_tags(np.empty((0, 4, 3)), owners, np.empty((0, 4)))
        CameraMotion({}, None, tags, owners).image_speed(PinholeCamera(8, 8, 8.0), SE3())
        ImageNoise(0, 0.0, 0.0).read_out(np.zeros((1, 1), dtype=np.uint8), Window(0, 0, 1, 1), 0)


def _lenses(scene: Scene) -> Iterator[tuple[str, bool]]:
    """Yield each camera's renderer, and whether its lens distorts, as it is or as it was built."""
    cameras, as_built = scene.cameras, scene.as_built
    for camera, errors in ((cameras.onboard, as_built.onboard), (cameras.overhead, as_built.overhead)):
        if camera is not None:
            deviations = [getattr(errors, key) for key in COEFFICIENTS]
            yield camera.renderer.name, camera.lens.distorts or any(k.error or k.sigma for k in deviations)


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
