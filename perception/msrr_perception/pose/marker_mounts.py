"""Where the tags of a port are, by the errors of the mounts of their bracket and of their own.

What holds a tag where it is no image tells apart, and neither where all tags of a marker are together on the
floor's plane from where the unit is. So a filter has the sums of errors of mounts in its state that images
depend on, and those that they do not depend on apart from these.
"""

from __future__ import annotations

import numpy as np

from msrr_scenes.arrays import Array

#: Indices of the place on the floor's plane, x, y and yaw, in a mount, and of the rest: z, roll and pitch.
ON_FLOOR, OFF_FLOOR = (0, 1, 5), (2, 3, 4)

#: Number of entries of a mount: x, y, z, roll, pitch, yaw.
MOUNT_SIZE = 6


def reference_tag(centres: Array) -> int:
    """Return which of the tags of a marker is its reference: that nearest to their middle.

    ``centres`` are the middles of the tags, shape (N, 3) [m].
    """
    return int(np.linalg.norm(centres - centres.mean(axis=0), axis=1).argmin())


def mounts_by_errors(centres: Array, axes: Array) -> Array:
    """Return the sums of errors of mounts that a state has, by these errors, shape (6 + 6 N, 6 + 6 N).

    Errors are z, roll and pitch of the bracket about the middle of its tags, in the axes of D; then x, y, z,
    roll, pitch and yaw of each tag in its own axes; then x, y and yaw of the bracket. Sums are z, roll and
    pitch of the bracket; then the mount of each tag about its middle, in the axes of D and on the floor's
    plane against the reference, of which that is its own place there; then x, y and yaw of the reference.

    Args:
        centres: Middles of the N tags in D as designed, shape (N, 3) [m].
        axes: Rotations R_DT of the tags, shape (N, 3, 3).
    """
    count = len(centres)
    size, middle, reference = MOUNT_SIZE * (1 + count), centres.mean(axis=0), reference_tag(centres)
    mounts = np.zeros((count, MOUNT_SIZE, size))
    for mount, centre, R_DT, own in zip(mounts, centres, axes, range(3, size, MOUNT_SIZE), strict=False):
        mount[:3, own : own + 3] = mount[3:, own + 3 : own + 6] = R_DT
        mount[2, 0] = 1.0
        for column, axis in ((1, np.array([1.0, 0.0, 0.0])), (2, np.array([0.0, 1.0, 0.0]))):
            mount[:3, column], mount[3:, column] = np.cross(axis, centre - middle), axis
    place = mounts[reference, ON_FLOOR]
    sums = np.eye(size)
    for tag, (mount, centre) in enumerate(zip(mounts, centres, strict=True)):
        rows = mount.copy()
        if tag == reference:
            rows[ON_FLOOR, :3] = 0.0
        else:
            rows[ON_FLOOR, :] -= _carried(place, centre - centres[reference])
        sums[3 + MOUNT_SIZE * tag :][:MOUNT_SIZE] = rows
    sums[-3:] = _carried(sums[-3:], centres[reference] - middle) + place
    return sums


def _carried(place: Array, arm: Array) -> Array:
    """Return x, y and yaw at the end of an arm of a body by those of its begin, rows of shape (3, n)."""
    x, y, yaw = place
    return np.array([x - arm[1] * yaw, y + arm[0] * yaw, yaw])
