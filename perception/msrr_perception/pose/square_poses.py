"""The poses at which a single flat tag appears as it was seen, by its four corners."""

from __future__ import annotations

import cv2
import numpy as np

from msrr_scenes.arrays import Array
from msrr_scenes.geometry.pinhole import PinholeCamera
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.unit_geometry import tag_corners


def square_poses(camera: PinholeCamera, corners: Array, size: float) -> list[tuple[SE3, float]]:
    """Return the poses X_CT of a tag, each with the RMS error of its corners [px], best first.

    There are two, of which one or both may be far off, and none for corners on a line.

    Source: Collins and Bartoli, "Infinitesimal plane-based pose estimation", IJCV 109, 2014 (IPPE).
    ``corners`` are those in the image of the ideal camera, shape (4, 2) [px], and ``size`` is the edge of the
    black square [m].
    """
    _, rotations, places, errors = cv2.solvePnPGeneric(
        tag_corners(size), corners, camera.matrix(), np.zeros(4), flags=cv2.SOLVEPNP_IPPE_SQUARE
    )
    poses = [
        SE3(np.asarray(cv2.Rodrigues(w)[0], dtype=np.float64), np.asarray(p, dtype=np.float64))
        for w, p in zip(rotations, places, strict=True)
    ]
    return list(zip(poses, [] if errors is None else np.ravel(errors).tolist(), strict=True))
