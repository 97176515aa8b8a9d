"""Compilation of all perception kernels before the first measurement."""

from __future__ import annotations

import logging
from collections.abc import Callable

import numpy as np

from msrr_perception.kernels.calibrated import PARAMETERS, TargetTags
from msrr_perception.kernels.compiled import compiler
from msrr_perception.kernels.corners import MeasuredCorners, WeightedCorners, derivatives, roots_of_covariance
from msrr_perception.kernels.dock_frame import pose_by_marker, predict
from msrr_perception.kernels.drive import Drive, propagate
from msrr_perception.kernels.edges import intersect_edges, refine_corners
from msrr_perception.kernels.fit import fit
from msrr_perception.kernels.lens import NO_LENS, undistort
from msrr_perception.kernels.project import Optics, predict_tags, tag_extent
from msrr_perception.kernels.rates import AT_REST, moved, rates_by_wheels
from msrr_perception.kernels.section_errors import DataSheet, variances_of_corners
from msrr_perception.kernels.track import coast, fuse
from msrr_perception.kernels.update import Rules, scaled_prior, update
from msrr_scenes.arrays import frozen

_log = logging.getLogger(__name__)


def warm(announce: Callable[[str], None] = _log.info) -> None:
    """Load the kernels from disk, or compile them and store them there.

    Call it before a pool of workers starts, or every worker compiles for itself.

    Args:
        announce: Called with a sentence before a compilation begins; not called for a load from disk.
    """
    if not compiler.is_compiled(intersect_edges):  # the last one
        announce(f"Compiling perception, once for this version (up to a minute), into {compiler.folder}")
    # A kernel is compiled for arrays that can be written and again for those that cannot: as they are in use.
    optics = Optics(np.eye(3, order="F"), np.zeros(3), 8.0, 4.0, 4.0)
    square = np.array([[-0.5, 0.5, 2.0], [0.5, 0.5, 2.0], [0.5, -0.5, 2.0], [-0.5, -0.5, 2.0]])
    pose, state = np.zeros(5), np.zeros(8)
    none, nothing = np.zeros((1, PARAMETERS)), np.zeros(0)
    columns, lengths = none.astype(np.int64), nothing.astype(np.int64)
    tags = TargetTags(square[None], np.zeros((1, 3)), np.zeros(3), columns, none, lengths, nothing)
    which, still = np.zeros(1, np.int64), np.zeros(3)
    pixels = np.array([[2.0, 6.0], [6.0, 6.0], [6.0, 2.0], [2.0, 2.0]])
    predict_tags(optics, 8, 8, pose, frozen(np.eye(3)), square[None], 1.0)
    tag_extent(pixels, np.ones((4, 2)), 1.0, 1.0, 0.1, 1.0)
    row, sheet = pixels.reshape(1, 8), DataSheet(1.0, 1.0, 1.0, 0.0)
    variances = variances_of_corners(row, np.ones((1, 4)), sheet, 1.0)
    measured = MeasuredCorners(which, row, np.ones((1, 4)), np.zeros((1, 4)))
    roots = roots_of_covariance(optics, tags, measured, AT_REST, state, variances, 0.1)
    seen, rules = WeightedCorners(which, row, measured.after, np.zeros(1), roots, AT_REST), Rules(1.0, 1, 1.0)
    update(optics, tags, measured, AT_REST, sheet, 1.0, 0.1, state, np.eye(8), rules)
    scaled_prior(tags, state, np.eye(8), state)
    derivatives(optics, tags, seen, state)
    fit(optics, tags, seen, state, state, np.eye(8), 2, 1e-3)
    steps, drive = np.zeros((1, 5)), Drive(*[1.0] * len(Drive._fields)).packed()
    propagate(state.copy(), np.eye(8), steps, drive)
    predict(state, np.eye(8), steps, drive, -1, still)
    pose_by_marker(state, -1, still)
    rates_by_wheels(np.zeros((1, 3)), 0.0, 1.0, 0, np.ones(2), 1.0, 0.0)
    moved(AT_REST, 0.0, np.empty(3), np.empty(3))
    undistort(NO_LENS, pixels)
    coast(np.zeros(5), np.eye(5), 0.1, 1.0, 1.0, 1.0, 1.0)
    fuse(np.zeros(5), np.eye(5), np.zeros(3), frozen(np.eye(3)))
    refine_corners(np.zeros((16, 16), np.uint8), 4.0 + 2.0 * (pixels[None] - 2.0))
