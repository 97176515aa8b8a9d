"""The state of a close-range filter: the pose, and the errors of calibration that have a tolerance.

A robot knows the drawing of its camera and of the target's marker, and how precisely both were made. So an
estimate can say how far the errors of calibration, which no number of frames averages out, may have put it
off, and it can learn those that an approach shows (Schmidt, "Application of state-space methods to
navigation problems", 1966; here all of them are states, considered and estimated at the same time).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from msrr_perception.kernels.calibrated import (
    BORDER,
    CAMERA,
    CENTRE,
    CLOCK,
    FOCAL,
    K1,
    PARAMETERS,
    POSE,
    PRINT,
    TAG,
    TargetTags,
)
from msrr_perception.pose.marker_mounts import (
    OFF_FLOOR,
    ON_FLOOR,
    mounts_by_errors,
    reference_tag,
)
from msrr_perception.pose.tolerances import Tolerances
from msrr_scenes.arrays import Array
from msrr_scenes.specs.as_built import MountDeviations

#: Number of entries of a pose with tilt, and of the drive's errors that follow it in the state of a filter.
POSE_SIZE, DRIVE_SIZE = 5, 3

#: Number of exposures during which the errors of a tag that is not in the state are taken to be the same.
#: They last, and to take them for noise that is drawn anew would make the filter believe them, the sooner the
#: faster the camera is.
_LASTING_FRAMES = 25.0

#: Least standard deviation of an entry, so that a covariance can be inverted: far below any that matters.
_LEAST_SIGMA = 1e-6


@dataclass(frozen=True, slots=True)
class Quantity:
    """An error of calibration that a state has, by its name in ``as_built`` of a scene.

    Attributes:
        name: Group and key, such as ``onboard.focal_percent``; the key ends in its unit.
        scale: Number of these units in one unit of the state: m, rad, s, px or a ratio.
        tag: Id of the tag whose mount is meant; None for what is no mount of a tag.
    """

    name: str
    scale: float
    tag: int | None = None


def _mount_names(group: str) -> list[tuple[str, float]]:
    """Return name and scale of each quantity of a mount: x, y, z, roll, pitch, yaw."""
    keys = MountDeviations.model_fields
    return [(f"{group}.{key}", math.degrees(1.0) if key.endswith("_deg") else 1.0) for key in keys]


#: Name and scale of the parameters that ``as_built`` has, and of the errors of the drive.
_NAMES: Mapping[int, tuple[str, float]] = {
    **dict(enumerate(_mount_names("onboard"), CAMERA)),
    FOCAL: ("onboard.focal_percent", 100.0),
    CENTRE: ("onboard.cx_px", 1.0),
    CENTRE + 1: ("onboard.cy_px", 1.0),
    K1: ("onboard.k1", 1.0),
    CLOCK: ("onboard.clock_ms", 1e3),
    PRINT: ("tags.print_percent", 100.0),
    **dict(enumerate(_mount_names("tags"), TAG)),
}
_BRACKET = dict(enumerate(_mount_names("bracket")))
_DRIVE = tuple(Quantity(f"drive.{key}_percent", 100.0) for key in ("radius_left", "radius_right", "track"))


@dataclass(frozen=True, eq=False)
class StateLayout:
    """What the entries of a state stand for.

    Attributes:
        tags: The tags of the target, with the columns of each in the state.
        index: Index of each tag in ``tags``.
        prior: Standard deviations of the errors of calibration, shape (n - first,), behind pose and drive.
        by_errors: Entries of a state by these errors, shape (n - first, n - first): the place of a tag rests
            on the mount of its bracket too.
        first: Index of the first of them.
        marker: Index of the place (x, y, yaw) of the marker on the floor's plane, which no image shows; None
            if it is as designed.
        roof: Index of the place (x, y, yaw in U) of the tag on the roof of the unit, by which a camera above
            measures its pose; None if it is as designed.
        own: Indices of what does not depend on the target: of the drive and of the camera.
        quantities: What each entry behind the pose is called, shape (n - 5,); None for what a
            recording tells nobody: errors of the edges in an image, and the place of the tag on the roof.
    """

    tags: TargetTags
    index: Mapping[int, int]
    prior: Array = field(default_factory=lambda: np.zeros(0))
    by_errors: Array = field(default_factory=lambda: np.zeros((0, 0)))
    first: int = POSE_SIZE
    marker: int | None = None
    roof: int | None = None
    own: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    quantities: tuple[Quantity | None, ...] = ()

    @property
    def size(self) -> int:
        """Number n of the entries of a state."""
        return self.first + len(self.prior)

    @property
    def covariance(self) -> Array:
        """Covariance by the tolerances of the entries of a state behind pose and drive."""
        root = self.by_errors * self.prior
        covariance: Array = root @ root.T
        return covariance

    def errors(self, mean: Array, covariance: Array) -> tuple[Array, Array]:
        """Return the errors that :attr:`quantities` name, shape (n - 5,), and their covariance.

        Args:
            mean: Mean of the entries of a state behind the pose, shape (n - 5,).
            covariance: Their covariance.
        """
        by_state, drive = np.eye(len(mean)), self.first - POSE_SIZE
        by_state[drive:, drive:] = np.linalg.inv(self.by_errors)
        return by_state @ mean, by_state @ covariance @ by_state.T

    @property
    def clock(self) -> int | None:
        """Index of the time by which the clock of the camera is ahead; None if that is known."""
        columns = self.tags.columns[:1, CLOCK].tolist()
        return columns[0] if columns and columns[0] >= 0 else None


def pose_layout(corners_D: Mapping[int, Array], port_tags: Sequence[int]) -> StateLayout:
    """Return the layout of a state that is a pose with tilt alone: everything was built as designed.

    Args:
        corners_D: Tag id -> corners in D as designed, shape (4, 3) [m].
        port_tags: Ids of the tags on the marker of the target port.
    """
    ids = sorted(corners_D)
    corners = np.array([corners_D[i] for i in ids]).reshape(-1, 4, 3)
    centres = corners.mean(axis=1)
    columns = np.full((len(ids), PARAMETERS), -1)
    columns[:, POSE : POSE + POSE_SIZE] = np.arange(POSE_SIZE)
    marker = [ids.index(i) for i in port_tags]
    pivot = centres[marker].mean(axis=0) if marker else np.zeros(3)
    considered, none = np.zeros(columns.shape), np.zeros(0, np.int64)
    return StateLayout(
        TargetTags(corners - centres[:, None], centres, pivot, columns, considered, none, np.zeros(0)),
        {tag: k for k, tag in enumerate(ids)},
    )


def roof_layout(drawn: StateLayout, roof: Array) -> StateLayout:
    """Return the layout of the state of a unit that a camera above sees: pose, drive, tag on its roof.

    Where that tag is held is told by the way that the unit drives, which is along its own axis.

    Args:
        drawn: Layout of a pose without tags of a target.
        roof: Standard deviations of the place of the tag, x, y [m] and yaw [rad] in U, shape (3,).
    """
    first, held = POSE_SIZE + DRIVE_SIZE, bool(roof.any())
    return StateLayout(
        drawn.tags,
        drawn.index,
        np.maximum(roof, _LEAST_SIGMA) if held else np.zeros(0),
        np.eye(3 if held else 0),
        first,
        roof=first if held else None,
        own=np.arange(POSE_SIZE, first),
        quantities=(*_DRIVE, *(None for _ in ON_FLOOR if held)),
    )


def filter_layout(drawn: StateLayout, port_tags: Sequence[int], tolerances: Tolerances) -> StateLayout:
    """Return the layout of a filter's state: pose, drive, and every error of calibration with a tolerance.

    A filter linearises anew at every step. What no image shows it learns nevertheless if images depend on it,
    and wrongly (Julier and Uhlmann, "A counter example to the theory of simultaneous localization and map
    building", ICRA 2001). Therefore entries of the state are not the errors that ``quantities`` names, but
    as many sums of these:

    - The pose is that against the marker of the port, wherever that is held on the floor's plane. The place
      of the marker is that of one of its tags, the reference, and comes last in the state.
    - A tag of the port has one mount, for which its bracket and its own place add up, in the axes of D and on
      the floor's plane against the reference.

    The mounts of the tags of other ports, which are seen at a slant and from farther away, are considered as
    noise.
    """
    sigmas, columns, prior = tolerances.sigmas(), drawn.tags.columns.copy(), list[float]()
    first = own = POSE_SIZE + DRIVE_SIZE
    quantities: list[Quantity | None] = [*_DRIVE]

    def add(k: int, sigma: float, names: Mapping[int, tuple[str, float]], tag: int | None = None) -> int:
        prior.append(max(sigma, _LEAST_SIGMA))
        quantities.append(Quantity(*names[k], tag) if k in names and sigma > 0.0 else None)
        return first + len(prior) - 1

    def add_for_all(parameters: range) -> None:
        for k in parameters:
            if sigmas[k] > 0.0:
                columns[:, k] = add(k, sigmas[k], _NAMES)

    on_port = [drawn.index[i] for i in port_tags]
    mounts = any((*tolerances.bracket, *tolerances.tag))
    tags, sums, marker = drawn.tags, list[int](), None
    if on_port:
        add_for_all(range(CAMERA, PRINT))
        own = first + len(prior)
        add_for_all(range(PRINT, TAG))
        if mounts:
            sums += [add(k, tolerances.bracket[k], _BRACKET) for k in OFF_FLOOR]
        for tag_id in port_tags:
            tag = drawn.index[tag_id]
            if mounts:
                columns[tag, TAG:BORDER] = [add(k, sigmas[k], _NAMES, tag_id) for k in range(TAG, BORDER)]
                sums += columns[tag, TAG:BORDER].tolist()
            columns[tag, BORDER:] = [add(k, sigmas[k], _NAMES) for k in range(BORDER, PARAMETERS)]
        if mounts:
            marker = first + len(prior)
            sums += [add(k, tolerances.bracket[k], _BRACKET) for k in ON_FLOOR]
    by_errors, pivot, axes = np.eye(len(prior)), tags.pivot, _axes(tags.corners)
    elsewhere = [k for k in range(len(drawn.index)) if k not in on_port]
    considered = tags.considered.copy()
    considered[elsewhere, TAG:BORDER] = _seen_from_afar(
        tolerances, tags.centres[elsewhere] - pivot, axes[elsewhere]
    )
    if marker is not None:
        at = np.array(sums) - first
        by_errors[np.ix_(at, at)] = mounts_by_errors(tags.centres[on_port], axes[on_port])
        reference = on_port[reference_tag(tags.centres[on_port])]
        pivot = tags.centres[reference]
        columns[reference, [TAG + k for k in ON_FLOOR]] = -1
    # Distances from the pivot, radii of the wheels, and places of tags about the pivot.
    places, radii = columns[on_port, TAG : TAG + 3].ravel(), [POSE_SIZE, POSE_SIZE + 1]
    lengths = np.array([0, 1, *radii, *places[places >= 0]])
    origins = np.array([*pivot[:2], -1.0, -1.0, *(pivot - tags.centres[on_port]).ravel()[places >= 0]])
    return StateLayout(
        TargetTags(tags.corners, tags.centres, pivot, columns, considered, lengths, origins),
        drawn.index,
        np.array(prior),
        by_errors,
        first,
        marker,
        own=np.arange(POSE_SIZE, own),
        quantities=tuple(quantities),
    )


def _axes(corners: Array) -> Array:
    """Return the rotations R_DT of tags, shape (T, 3, 3), by corners about their middles, shape (T, 4, 3)."""
    x, y = corners[:, 1] - corners[:, 0], corners[:, 0] - corners[:, 3]
    axes = np.stack([x, y, np.cross(x, y)], axis=2)
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    return axes


def _seen_from_afar(tolerances: Tolerances, arms: Array, axes: Array) -> Array:
    """Return the variances of the mounts of tags of other ports, shape (T, 6), in the axes of D.

    They count twice, because those of the port of the target are off as well.

    Args:
        tolerances: Tolerances of the mounts.
        arms: Middles of the tags from the middle of the marker, shape (T, 3) [m].
        axes: Rotations R_DT of the tags, shape (T, 3, 3).
    """
    bracket, tag = np.square(tolerances.bracket), np.square(tolerances.tag)
    place, turn = axes**2 @ tag[:3] + bracket[:3], axes**2 @ tag[3:] + bracket[3:]
    x, y, z = np.square(arms).T
    roll, pitch, yaw = bracket[3:]
    place += np.stack([pitch * z + yaw * y, roll * z + yaw * x, roll * y + pitch * x], axis=1)
    variances: Array = 2.0 * _LASTING_FRAMES * np.concatenate([place, turn], axis=1)
    return variances
