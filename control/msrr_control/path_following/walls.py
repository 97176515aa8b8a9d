"""The side on which a unit passes an obstacle, and the wall that keeps it there."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import model_validator

from msrr_control.kinematics.elementwise import cos, join, number, sin, split, where
from msrr_control.path_following.path import Path
from msrr_control.path_following.reference import SideWall
from msrr_scenes.arrays import Array
from msrr_scenes.errors import MsrrError
from msrr_scenes.specs.spec import Distance, Length, Spec

#: Distance between the points of a path at which its distance from an obstacle is compared [m].
_SPACING_M = 0.02

#: Largest distance of a wall from an obstacle, over the distance before it at which the wall rises.
_STEEPEST = 0.6


class PassageError(MsrrError):
    """No wall can lead around an obstacle; the message says what would have to change."""


class WallSpec(Spec):
    """When walls stand and how far from an obstacle.

    Attributes:
        margin_m: Distance added to the obstacle's radius and half the body's width; it covers overshoot,
            tracking error and the error of the estimates of robots that are built with care.
        ahead_m: Distance before the obstacle, along the path's tangent there, at which the wall rises.
        early_m: Largest depth of the path inside the wall when the wall rises, beyond the depth where path
            and obstacle are nearest. On the outside of a bend the wall rises later by this rule; otherwise
            the unit would swing out twice.
        past_m: Distance of the axle behind the obstacle at which the wall is released.
        widest_m: Largest distance of a wall from the obstacle's middle; a unit cannot move further out within
            ``ahead_m``.
        before_end_m: Smallest distance from the obstacle to the end of the path that leaves room to come back
            to the path.
    """

    margin_m: Distance = 0.055
    ahead_m: Length = 0.65
    early_m: Length = 0.12
    past_m: Distance = 0.02
    widest_m: Length = 0.32
    before_end_m: Length = 0.8

    @model_validator(mode="after")
    def _has_room(self) -> WallSpec:
        if self.widest_m > _STEEPEST * self.ahead_m:
            raise ValueError(
                f"widest_m = {self.widest_m:g} cannot be reached from ahead_m = {self.ahead_m:g} before the "
                f"obstacle; at most {_STEEPEST * self.ahead_m:.2f}"
            )
        return self

    def release_m(self, offset: float) -> float:
        """Return how far the controlled point, ``offset`` [m] ahead, is behind the obstacle by then [m]."""
        return offset + self.past_m

    def half_width(self, radius: float, body_half_width: float) -> float:
        """Return d, the distance [m] of the wall from the middle of an obstacle.

        Raises:
            PassageError: A wall that far out could not be reached in time.
        """
        d = radius + body_half_width + self.margin_m
        if d > self.widest_m:
            raise PassageError(
                f"an obstacle of radius {radius:.3f} m needs a wall {d:.3f} m from its middle (half the "
                f"body {body_half_width:.3f}, margin {self.margin_m:.3f}); at most {self.widest_m:.3f} m"
            )
        return d


class Encounter(NamedTuple):
    """How a path passes an obstacle, one for each trial (leading shape (...)).

    Attributes:
        s: Arc length at which the path is nearest to the obstacle, shape (...) [m].
        heading: Angle of the path's tangent there, shape (...) [rad].
        blocked: Whether the path comes nearer to the obstacle than the wall, shape (...) bool.
        detours: Depth of the path there inside the wall on the right and on the left of the obstacle,
            shape (..., 2) [m].
        rise: Distance before the obstacle, along the tangent, at which the wall on the right and on the left
            of it rises, shape (..., 2) [m].
    """

    s: Array
    heading: Array
    blocked: NDArray[np.bool_]
    detours: Array
    rise: Array

    @property
    def side(self) -> Array:
        """Side of the smaller detour: -1 right, +1 left, shape (...)."""
        smaller: Array = np.where(self.detours[..., 0] < self.detours[..., 1], -1.0, 1.0)
        return smaller


def find_encounter(path: Path, centre: Array, half_width: Array, spec: WallSpec) -> Encounter:
    """Return how a path passes an obstacle.

    Args:
        path: One path, or one for each trial (leading shape (...)).
        centre: Middle of the obstacle, shape (..., 2) [m].
        half_width: d, distance of the wall from that middle, shape (...) [m].
        spec: When walls stand.
    """
    count = 1 + int(np.ceil(float(np.max(path.length)) / _SPACING_M))
    share = np.linspace(0.0, 1.0, count).reshape(-1, *(1,) * path.length.ndim)
    s = share * path.length
    points = path.at(s)
    apart = points.point - centre
    distance = np.hypot(apart[..., 0], apart[..., 1])
    nearest = distance.argmin(axis=0)[None]
    s_near = np.take_along_axis(s, nearest, axis=0)[0]
    heading = np.take_along_axis(points.heading, nearest, axis=0)[0]
    c, n = np.cos(heading), np.sin(heading)
    along = c * apart[..., 0] + n * apart[..., 1]
    left_of = c * apart[..., 1] - n * apart[..., 0]
    inside = half_width[..., None] + np.stack([left_of, -left_of], axis=-1)
    # The detour is judged where the path is nearest: measured amplitudes on either side are 2 cm larger.
    detours = np.maximum(np.take_along_axis(inside, nearest[..., None], axis=0)[0], 0.0)
    before = (s <= s_near) & (along >= -spec.ahead_m)
    too_early = before[..., None] & (inside > detours + spec.early_m)
    rise = np.min(np.where(too_early, -along[..., None], spec.ahead_m), axis=0)
    blocked = distance.min(axis=0) < half_width
    return Encounter(s_near, heading, blocked, detours, rise)


def side_wall(
    encounter: Encounter,
    side: Array,
    tip: Array,
    centre: Array,
    half_width: Array,
    spec: WallSpec,
    offset: float,
) -> SideWall:
    """Return the wall beside an obstacle; it stands from before the obstacle until the unit has passed.

    The wall's normal is that of the path at the obstacle. Walls along the axes of the world cost 30 % more
    amplitude, and walls along both axes at once deadlock the unit.

    Source: Zheng et al., eq. 9; frame, side and times were found in a study of 200 starts per case.

    Args:
        encounter: How the path passes the obstacle, leading shape (...).
        side: Side to pass it on, -1 right, +1 left, shape (...).
        tip: Controlled point, shape (..., 2) [m].
        centre: Middle of the obstacle, as estimated now, shape (..., 2) [m].
        half_width: d, distance of the wall from that middle, shape (...) [m].
        spec: When walls stand.
        offset: l, distance of the controlled point ahead of the axle [m].
    """
    heading, side, d = number(encounter.heading), number(side), number(half_width)
    (x, y), (centre_x, centre_y) = split(tip), split(centre)
    rise = where(side < 0.0, number(encounter.rise[..., 0]), number(encounter.rise[..., 1]))
    along = cos(heading) * (x - centre_x) + sin(heading) * (y - centre_y)
    normal = heading + 0.5 * np.pi * side
    foot = join(centre_x + d * cos(normal), centre_y + d * sin(normal))
    stands = np.asarray(encounter.blocked & (along >= -rise) & (along <= spec.release_m(offset)))
    return SideWall(stands, foot, np.asarray(normal))
