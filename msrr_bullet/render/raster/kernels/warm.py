"""Compilation ahead of the first frame."""

from __future__ import annotations

import logging
from collections.abc import Callable

import numpy as np

from msrr_bullet.render.floor import Floor
from msrr_bullet.render.raster.kernels.compiled import compiler
from msrr_bullet.render.raster.kernels.ground import ground_of
from msrr_bullet.render.raster.look import VisualShape
from msrr_bullet.render.raster.mesh import box
from msrr_bullet.render.raster.picture_maker import PictureMaker
from msrr_scenes.geometry.pinhole import PinholeCamera
from msrr_scenes.geometry.se3 import SE3

_log = logging.getLogger(__name__)


def warm(announce: Callable[[str], None] = _log.info) -> None:
    """Make the kernels ready: load them from disk, or compile them and keep them there.

    Call it before a pool of workers starts, or every worker compiles for itself.

    Args:
        announce: Is told, in words, before a compilation begins. A load from disk is not worth a word.
    """
    if not compiler.is_compiled():
        announce(
            "Compiling the raster renderer, once for this version (about ten seconds), into "
            f"{compiler.folder}"
        )
    plain = Floor((np.zeros((1, 1), dtype=np.float32),), period=1.0, wall=0.0)
    maker = PictureMaker([VisualShape(0, SE3(), box(np.ones(3)), grey=1.0)], movers=1)
    camera = PinholeCamera(8, 8, 8.0)
    pose = np.array([[0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 1.0]])
    maker.picture(camera, SE3(), camera.frame, pose, ground_of(plain))
