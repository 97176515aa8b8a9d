"""Paths of circular arcs and straight lines, and the desired point that moves along them."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from msrr_control.kinematics.elementwise import at_least, at_most, cos, join, limit, number, sin, split, sqrt
from msrr_control.kinematics.unicycle import advance_components, advance_pose
from msrr_scenes.arrays import Array
from msrr_scenes.specs.spec import Duration, Length, Spec, Speed


class PathPoint(NamedTuple):
    """A point of a path (..., 2) [m], the tangent's angle (...) [rad] and the curvature (...) [1/m]."""

    point: Array
    heading: Array
    curvature: Array


class DesiredPoint(NamedTuple):
    """The desired point p_d and its first two derivatives in time, each of shape (..., 2) [m, m/s, m/s2]."""

    point: Array
    velocity: Array
    acceleration: Array


@dataclass(frozen=True, eq=False)
class Path:
    """Arcs and lines joined tangentially, or one such path for each of many trials.

    Attributes:
        start: Pose at s = 0, shape (..., 3) [m, m, rad].
        curvature: Curvature of each of K pieces, shape (..., K); 0 is a line, positive turns left [1/m].
        lengths: Length of each piece, shape (..., K) [m].
    """

    start: Array
    curvature: Array
    lengths: Array
    _knots: Array = field(init=False, repr=False)
    _poses: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        for name in ("start", "curvature", "lengths"):
            object.__setattr__(self, name, np.asarray(getattr(self, name), dtype=np.float64))
        pose, poses = self.start, [self.start]
        for k in range(self.curvature.shape[-1]):
            turn = self.curvature[..., k] * self.lengths[..., k]
            pose = advance_pose(pose, self.lengths[..., k], turn)
            poses.append(pose)
        knots = np.zeros((*self.lengths.shape[:-1], self.lengths.shape[-1] + 1))
        knots[..., 1:] = np.cumsum(self.lengths, axis=-1)
        object.__setattr__(self, "_knots", knots)
        object.__setattr__(self, "_poses", np.stack(poses, axis=-2))

    @property
    def length(self) -> Array:
        """Length of the path, shape (...) [m]."""
        total: Array = self._knots[..., -1]
        return total

    @cached_property
    def arc_end(self) -> Array:
        """Arc length at which the last arc ends, shape (...) [m]; 0 where there is none."""
        is_arc = self.curvature != 0.0
        ends: Array = np.max(np.where(is_arc, self._knots[..., 1:], 0.0), axis=-1)
        return ends

    def at(self, s: ArrayLike) -> PathPoint:
        """Return the points at arc lengths ``s`` [m], limited to the path.

        Args:
            s: Any shape for one path; shape (..., *leading shape of the paths) for many.
        """
        x, y, heading, curvature = self.components_at(np.asarray(s, dtype=np.float64))
        return PathPoint(join(x, y), np.asarray(heading), np.asarray(curvature))

    def components_at(self, s: Array) -> tuple[Any, Any, Any, Any]:
        """Return x, y, heading and curvature of :meth:`at`: floats for one point of one path, else arrays."""
        if s.ndim == 0 and self.start.ndim == 1:
            knots, poses, curvatures = self._plain
            place = limit(s.item(), 0.0, knots[-1])
            k = bisect_right(knots, place, 1, len(knots) - 1) - 1
            along = place - knots[k]
            return (*advance_components(poses[k], along, curvatures[k] * along), curvatures[k])
        within = np.minimum(np.maximum(s, 0.0), self.length)
        piece = (*self._rows, (within[..., None] >= self._knots[..., 1:-1]).sum(axis=-1))
        distance, curvature = within - self._knots[piece], self.curvature[piece]
        return (*advance_components(split(self._poses[piece]), distance, curvature * distance), curvature)

    @cached_property
    def _plain(self) -> tuple[list[float], list[list[float]], list[float]]:
        """Knots, poses and curvatures of a single path, as plain numbers."""
        return self._knots.tolist(), self._poses.tolist(), self.curvature.tolist()

    @cached_property
    def _rows(self) -> NDArray[np.int_]:
        """Indices of the paths, one array for each of their leading axes."""
        return np.indices(self.start.shape[:-1])

    def until(self, s: float) -> Path:
        """Return the path up to arc length ``s`` [m], a single path that ends there or where it ended."""
        return Path(self.start, self.curvature, np.clip(s - self._knots[:-1], 0.0, self.lengths))

    def sample(self, spacing: float) -> tuple[Array, Array]:
        """Return arc lengths and points every ``spacing`` [m] or less, both ends included, of a single path.

        Returns:
            s, shape (N,), and points, shape (N, 2).
        """
        s = np.linspace(0.0, float(self.length), int(np.ceil(float(self.length) / spacing)) + 2)
        return s, self.at(s).point


class PaceSpec(Spec):
    """Speed of the desired point along its path.

    Attributes:
        cruise_mps: Cruising speed.
        ramp_s: Time from rest to that speed and back.
        lag_m: Distance of the controlled point behind the desired one, along the path, at which the desired
            point slows down; at twice this distance it waits.
    """

    cruise_mps: Speed = 0.22
    ramp_s: Duration = 1.5
    lag_m: Length = 0.10

    @property
    def acceleration(self) -> float:
        """Acceleration of the ramps [m/s2]."""
        return self.cruise_mps / self.ramp_s


class Pace(NamedTuple):
    """Arc length s of the desired point on its path [m] and its speed [m/s], each of shape (...)."""

    s: Array
    speed: Array


def pace_start(pose: Array, s: float) -> Pace:
    """Return a desired point at rest at arc length ``s`` [m], for units of poses of shape (..., 3)."""
    return Pace(np.full(pose.shape[:-1], s), np.zeros(pose.shape[:-1]))


def pace_step(pace: Pace, path: Path, tip: Array, spec: PaceSpec, dt: float) -> tuple[Pace, DesiredPoint]:
    """Advance the desired point by ``dt`` [s] and return it with its derivatives.

    It ramps up, cruises, ramps down to rest at the end of the path, and waits for a controlled point that
    lags (that of an ideal unit never does).

    Source: Zheng et al., the circular guidance trajectory of the long-distance phase; waiting is an addition.

    Args:
        pace: Arc length and speed of the desired point.
        path: Path, leading shape (...).
        tip: Controlled point, shape (..., 2) [m].
        spec: Speeds.
        dt: Step [s].
    """
    x, y, heading, curvature = path.components_at(np.asarray(pace.s))
    (tip_x, tip_y), length = split(tip), number(path.length)
    arc_length, speed = number(pace.s), number(pace.speed)
    c, s = cos(heading), sin(heading)
    lag = (x - tip_x) * c + (y - tip_y) * s
    share = limit(2.0 - lag / spec.lag_m, 0.0, 1.0)
    a = spec.acceleration
    remaining = at_least(length - arc_length - speed * dt, 0.0)
    wanted = at_most(spec.cruise_mps * share, sqrt(2.0 * a * remaining))
    change = limit(wanted - speed, -a * dt, a * dt)
    speed = at_least(speed + change, 0.0)
    tangential, normal = change / dt, curvature * speed * speed
    after = Pace(np.asarray(at_most(arc_length + dt * speed, length)), np.asarray(speed))
    acceleration = join(tangential * c - normal * s, tangential * s + normal * c)
    return after, DesiredPoint(join(x, y), join(speed * c, speed * s), acceleration)
