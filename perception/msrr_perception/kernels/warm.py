"""Compilation of perception's kernels ahead of the first measurement."""

from __future__ import annotations

import logging
from collections.abc import Callable

import numpy as np

from msrr_perception.kernels.compiled import compiler
from msrr_perception.kernels.drive import Drive, drive_along
from msrr_perception.kernels.edges import refine
from msrr_perception.kernels.fit import fit, gate_distances
from msrr_perception.kernels.project import Optics, expect, extent

_log = logging.getLogger(__name__)


def warm(announce: Callable[[str], None] = _log.info) -> None:
    """Make the kernels ready: load them from disk, or compile them and keep them there.

    Call it before a pool of workers starts, or every worker compiles for itself.

    Args:
        announce: Is told, in words, before a compilation begins. A load from disk is not worth a word.
    """
    if not compiler.is_compiled():
        announce(f"Compiling perception, once for this version (about ten seconds), into {compiler.folder}")
    optics = Optics(np.eye(3, order="F"), np.zeros(3), 8.0, 4.0, 4.0)
    square = np.array([[-0.5, 0.5, 2.0], [0.5, 0.5, 2.0], [0.5, -0.5, 2.0], [-0.5, -0.5, 2.0]])
    pose, state = np.zeros(5), np.zeros(7)
    pixels = np.array([[2.0, 6.0], [6.0, 6.0], [6.0, 2.0], [2.0, 2.0]])
    expect(optics, 8, 8, pose, np.eye(3), square[None], 1.0)
    extent(pixels, np.ones((4, 2)), 1.0, 1.0, 0.1, 1.0)
    gate_distances(optics, square, pixels.ravel(), 1.0, state, np.eye(7))
    fit(optics, square, pixels.ravel(), 1.0, state, state, np.eye(7), 2, 1e-3)
    drive_along(state, np.eye(7), np.zeros((1, 3)), Drive(*[1.0] * 12))
    grey = np.zeros((16, 16), dtype=np.uint8)
    grey.setflags(write=False)
    refine(grey, np.array([[[4.0, 12.0], [12.0, 12.0], [12.0, 4.0], [4.0, 4.0]]]))
