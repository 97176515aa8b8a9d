"""Rotation vectors of many rotations at a time. Source: J. Sola et al., "A micro Lie theory", 2018."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from msrr_scenes.arrays import Array


def hat(vectors: Array) -> Array:
    """Return the matrices of the cross products with vectors, shapes (..., 3) and (..., 3, 3)."""
    x, y, z = np.moveaxis(vectors, -1, 0)
    o = np.zeros_like(x)
    return np.stack([o, -z, y, z, o, -x, -y, x, o], axis=-1).reshape(*vectors.shape, 3)


def exponential(vectors: Array) -> Array:
    """Return the rotations by rotation vectors, shapes (N, 3) [rad] and (N, 3, 3)."""
    return np.asarray(Rotation.from_rotvec(vectors).as_matrix())
