"""Paths of circular arcs and straight lines, and the pace at which they are followed."""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from msrr_control.kinematics.elementwise import at_least, at_most, cos, join, limit, number, sin, split, sqrt
from msrr_scenes.arrays import Array
from msrr_scenes.specs.spec import Positive, Spec


class PathPoint(NamedTuple):
    """A point of a path: where, shape (..., 2) [m]; tangent's angle (...) [rad]; curvature (...) [1/m]."""

    point: Array
    heading: Array
    curvature: Array


class Desired(NamedTuple):
    """p_d and its first two derivatives in time, each of shape (..., 2) [m, m/s, m/s2]."""

    point: Array
    velocity: Array
    acceleration: Array


@dataclass(frozen=True, eq=False)
class Path:
    """Arcs and lines joined tangentially, or one such path for each of many trials.

    Attributes:
        start: Pose at s = 0, shape (..., 3) [m, m, rad].
        curvature: Of each of K pieces, shape (..., K); 0 is a line, positive turns left [1/m].
        lengths: Of each piece, shape (..., K) [m].
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
            pose = _along(pose, self.curvature[..., k], self.lengths[..., k])
            poses.append(pose)
        knots = np.zeros((*self.lengths.shape[:-1], self.lengths.shape[-1] + 1))
        knots[..., 1:] = np.cumsum(self.lengths, axis=-1)
        object.__setattr__(self, "_knots", knots)
        object.__setattr__(self, "_poses", np.stack(poses, axis=-2))

    @property
    def length(self) -> Array:
        """Length, shape (...) [m]."""
        total: Array = self._knots[..., -1]
        return total

    @cached_property
    def arc_end(self) -> Array:
        """Arc length at which the last arc ends, shape (...) [m]; 0 where there is none."""
        bent = self.curvature != 0.0
        ends: Array = np.max(np.where(bent, self._knots[..., 1:], 0.0), axis=-1)
        return ends

    def at(self, s: ArrayLike) -> PathPoint:
        """Return the point at arc length ``s`` [m], shape (...), which is held within the path."""
        asked = np.asarray(s, dtype=np.float64)
        if asked.ndim == 0 and self.start.ndim == 1:
            x, y, heading, bent = self._place(asked.item())
            return PathPoint(np.array([x, y]), np.array(heading), np.array(bent))
        reached = np.minimum(np.maximum(asked, 0.0), self.length)
        piece = (reached[..., None] >= self._knots[..., 1:-1]).sum(axis=-1)
        if self.start.ndim == 1:  # one path, and s of any shape
            pose, curvature, began = self._poses[piece], self.curvature[piece], self._knots[piece]
        else:
            at = piece[..., None]
            pose = np.take_along_axis(self._poses, at[..., None], axis=-2)[..., 0, :]
            curvature = np.take_along_axis(self.curvature, at, axis=-1)[..., 0]
            began = np.take_along_axis(self._knots, at, axis=-1)[..., 0]
        poses = _along(pose, curvature, reached - began)
        return PathPoint(poses[..., :2], poses[..., 2], curvature)

    def _place(self, s: float) -> tuple[float, float, float, float]:
        """Return x, y, heading and curvature at one arc length [m] of a single path."""
        knots = self._knots.tolist()
        s = limit(s, 0.0, knots[-1])
        piece = bisect_right(knots, s, 1, len(knots) - 1) - 1
        x, y, yaw = self._poses[piece].tolist()
        curvature = self.curvature[piece].item()
        half = 0.5 * curvature * (s - knots[piece])
        chord = (s - knots[piece]) * _sinc(half)
        return x + chord * cos(yaw + half), y + chord * sin(yaw + half), yaw + 2.0 * half, curvature

    def sample(self, spacing: float) -> tuple[Array, Array]:
        """Return arc lengths and points every ``spacing`` [m] or less, both ends included, of a single path.

        Returns:
            s, shape (N,), and points, shape (N, 2).
        """
        s = np.linspace(0.0, float(self.length), int(np.ceil(float(self.length) / spacing)) + 2)
        return s, self.at(s).point


def _sinc(angle: float) -> float:
    """Return sin(angle) / angle, to the bit as :func:`_along` has it from numpy."""
    y = math.pi * (angle / math.pi) if angle else 1e-20
    return sin(y) / y


def _along(pose: Array, curvature: Array, s: Array) -> Array:
    """Move poses, shape (..., 3), by ``s`` along circles of the given curvature (along the chord)."""
    half = 0.5 * curvature * s
    chord = s * np.sinc(half / np.pi)
    middle = pose[..., 2] + half
    moved = np.empty(np.broadcast_shapes(pose.shape, (*np.shape(half), 3)))
    moved[..., 0] = pose[..., 0] + chord * np.cos(middle)
    moved[..., 1] = pose[..., 1] + chord * np.sin(middle)
    moved[..., 2] = pose[..., 2] + 2.0 * half
    return moved


class PaceSpec(Spec):
    """How fast a path is followed.

    Attributes:
        cruise_mps: Speed of the desired point.
        ramp_s: Time from rest to that speed and back.
        lag_m: Distance of the controlled point behind the desired one, along the path, at which that slows;
            at twice this it waits.
    """

    cruise_mps: Positive = 0.22
    ramp_s: Positive = 1.5
    lag_m: Positive = Field(default=0.10)

    @property
    def acceleration(self) -> float:
        """Acceleration of the ramps [m/s2]."""
        return self.cruise_mps / self.ramp_s


class Pace(NamedTuple):
    """Where the desired point is on its path, (...) [m], and its speed [m/s]."""

    s: Array
    speed: Array


def pace_step(pace: Pace, path: Path, tip: Array, spec: PaceSpec, dt: float) -> tuple[Pace, Desired]:
    """Advance the desired point by ``dt`` [s] and return it with its derivatives.

    It ramps up, cruises, ramps down to rest at the end of the path, and waits for a controlled point that
    lags (which an ideal unit never does).

    Source: Zheng et al., the circular guidance trajectory of the long-distance phase; waiting is an addition.

    Args:
        pace: Where the desired point is.
        path: The path, leading shape (...).
        tip: The controlled point, shape (..., 2) [m].
        spec: Speeds.
        dt: Step [s].
    """
    now = path.at(pace.s)
    (x, y), (tip_x, tip_y) = split(now.point), split(tip)
    heading, curvature, length = number(now.heading), number(now.curvature), number(path.length)
    reached, before = number(pace.s), number(pace.speed)
    c, s = cos(heading), sin(heading)
    behind = (x - tip_x) * c + (y - tip_y) * s
    patience = limit(2.0 - behind / spec.lag_m, 0.0, 1.0)
    a = spec.acceleration
    left = at_least(length - reached - before * dt, 0.0)
    wish = at_most(spec.cruise_mps * patience, sqrt(2.0 * a * left))
    change = limit(wish - before, -a * dt, a * dt)
    speed = at_least(before + change, 0.0)
    bend = curvature * speed * speed
    rate = change / dt
    onward = Pace(np.asarray(at_most(reached + dt * speed, length)), np.asarray(speed))
    acceleration = join(rate * c - bend * s, rate * s + bend * c)
    return onward, Desired(now.point, join(speed * c, speed * s), acceleration)
