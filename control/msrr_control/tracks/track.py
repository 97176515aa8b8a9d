"""Tracks: all poses that a unit passes on a route, and where two tracks come too near to each other."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from msrr_control.path_following.path import Path
from msrr_control.shapes.precedence import compose
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se2 import SE2, wrap_angle
from msrr_scenes.messages.coordination import LegKind, RouteLeg

#: Largest distance between the samples of a track [m], and the step with which the axle is integrated [m].
SPACING_M = 0.03
_STEP_M = 0.01

#: Stretch on which the controlled point comes onto a path beside which it begins [m].
_MERGE_M = 0.2


@dataclass(frozen=True, eq=False)
class Track:
    """The poses of the axle along a route.

    Attributes:
        legs: Legs of the route.
        s: Arc length of each sample, ascending, shape (N,) [m].
        poses: Pose of the axle at each sample in W, shape (N, 3) [m, m, rad].
        at_port: Whether a sample lies in a leg out of or into a port, shape (N,) bool.
    """

    legs: tuple[RouteLeg, ...]
    s: Array
    poses: Array
    at_port: NDArray[np.bool_]

    @property
    def length(self) -> float:
        """Arc length of the whole route [m]."""
        return float(self.s[-1])

    @cached_property
    def dock_start(self) -> float:
        """Arc length at which the dock leg begins, that of the whole route if there is none [m]."""
        return dock_start(self.legs, self.length)

    @property
    def end(self) -> SE2:
        """Pose at the end."""
        return SE2(*self.poses[-1].tolist())

    def at(self, s: float) -> SE2:
        """Return the pose at arc length ``s`` [m], between samples by interpolation."""
        if len(self.s) == 1:
            return self.end
        k = min(max(int(np.searchsorted(self.s, s)) - 1, 0), len(self.s) - 2)
        a, b = self.poses[k].tolist(), self.poses[k + 1].tolist()
        span = float(self.s[k + 1] - self.s[k])
        share = min(max((s - float(self.s[k])) / span, 0.0), 1.0) if span > 0.0 else 1.0
        yaw = a[2] + share * wrap_angle(b[2] - a[2])
        return SE2(a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1]), yaw)

    def to_port(self, X_WE: SE2) -> Track:
        """Return the same track, its leg into a port bent so that it ends at the pose ``X_WE``.

        A unit closes in on the port that its own camera sees, wherever sight from above shows it. The bend
        grows from nothing where that leg begins. The legs stay as they are.
        """
        if self.length <= self.dock_start:
            return self
        share = np.clip((self.s - self.dock_start) / (self.length - self.dock_start), 0.0, 1.0)
        moved = compose(X_WE @ self.end.inverse(), self.poses)
        moved[:, 2] = self.poses[:, 2] + wrap_angle(X_WE.yaw - self.end.yaw)
        return replace(self, poses=self.poses + share[:, None] * (moved - self.poses))

    def seen_progress(self, X_WU: SE2, low: float, high: float, off: float) -> float | None:
        """Return the arc length between ``low`` and ``high`` at which the track first passes a pose [m].

        A track may pass a pose more than once, as where a unit turns, drives off and comes back, or backs out
        of a port and drives on ahead. Only the first time is sure to lie behind the unit. A pose farther than
        ``off`` [m] from the track does not belong to it.

        Returns:
            Arc length of the sample before which the track comes nearer, and after which it does not; None if
            that part of the track does not pass.
        """
        begin = int(np.searchsorted(self.s, low))
        inside = self.poses[begin : int(np.searchsorted(self.s, high, side="right"))]
        delta = inside[:, :2] - X_WU.translation
        turned = np.abs(np.remainder(inside[:, 2] - X_WU.yaw + math.pi, 2.0 * math.pi) - math.pi)
        apart = np.hypot(delta[:, 0], delta[:, 1]) + 0.1 * turned
        near = apart < off
        if not near.any():
            return None
        first = int(near.argmax())
        leads_away = np.append(np.diff(apart[first:]) > 0.0, True)
        return float(self.s[begin + first + int(leads_away.argmax())])


class TrackBuilder:
    """Joins legs to a track, each beginning where the one before ends."""

    def __init__(self, X_WU: SE2, offset: float) -> None:
        """Begin at the pose ``X_WU`` of a unit whose controlled point is ``offset`` [m] ahead of the axle."""
        self._offset = offset
        self._legs: list[RouteLeg] = []
        self._s = [0.0]
        self._poses = [X_WU.as_array()]
        self._at_port = [False]

    @property
    def pose(self) -> SE2:
        """Where the unit is so far."""
        return SE2(*self._poses[-1].tolist())

    def back(self, distance: float) -> None:
        """Drive backwards by ``distance`` [m], out of a port."""
        if not self._legs:
            self._at_port[0] = True
        self._backwards(distance, LegKind.BACK)

    def reverse(self, distance: float) -> None:
        """Drive backwards by ``distance`` [m], in the open."""
        self._backwards(distance, LegKind.REVERSE)

    def _backwards(self, distance: float, kind: LegKind) -> None:
        count = math.ceil(distance / SPACING_M)
        start, s = self.pose, self._s[-1]
        for k in range(1, count + 1):
            way = distance * k / count
            self._append(s + way, (start @ SE2(-way, 0.0, 0.0)).as_array(), kind is LegKind.BACK)
        self._finish(kind, start)

    def ahead(self, distance: float) -> None:
        """Drive straight ahead by ``distance`` [m]."""
        self.follow(Path(self.pose.as_array(), np.zeros(1), np.array([distance + self._offset])))

    def turn_to(self, yaw: float) -> None:
        """Turn on the spot to the heading ``yaw`` [rad]."""
        self.turn_by(wrap_angle(yaw - self.pose.yaw))

    def turn_by(self, angle: float) -> None:
        """Turn on the spot by ``angle`` [rad], to the left where it is positive."""
        start, s = self.pose, self._s[-1]
        if abs(angle) < 1e-3:
            return
        count = math.ceil(self._offset * abs(angle) / SPACING_M)
        for k in range(1, count + 1):
            turned = angle * k / count
            self._append(
                s + self._offset * abs(turned), np.array([start.x, start.y, start.yaw + turned]), False
            )
        self._finish(LegKind.TURN, start, turn=angle)

    def follow(self, path: Path, kind: LegKind = LegKind.PATH) -> None:
        """Lead the controlled point along a path that begins at the axle, in the heading of the unit.

        The axle trails: with the heading h of the unit and p of the point's way, h' = sin(p - h) / l. Where
        the path bends at once, the point begins beside it; it comes onto it on the first stretch.
        """
        start, begin, l = self.pose, self._s[-1], self._offset
        length = float(path.length)
        if length <= l:
            return
        count = math.ceil((length - l) / _STEP_M)
        every = int(SPACING_M / ((length - l) / count))
        s = l + (length - l) * np.arange(1, count + 1) / count
        points = path.at(s).point
        tip = start.act([l, 0.0])
        share = np.maximum(1.0 - (s - l) / min(_MERGE_M, 0.5 * (length - l)), 0.0) ** 2
        points = points + share[:, None] * (tip - path.at(l).point)
        steps = np.diff(points, axis=0, prepend=tip[None])
        headings = np.arctan2(steps[:, 1], steps[:, 0])
        lengths = np.hypot(steps[:, 0], steps[:, 1]) / l
        h = start.yaw
        for k in range(count):
            # The middle of the step stands for all of it: exact to second order.
            p, step = float(headings[k]), float(lengths[k])
            half = h + 0.5 * step * math.sin(p - h)
            h += step * math.sin(p - half)
            if (k + 1) % every == 0 or k == count - 1:
                x, y = points[k].tolist()
                pose = np.array([x - l * math.cos(h), y - l * math.sin(h), h])
                self._append(begin + float(s[k]) - l, pose, kind is LegKind.DOCK)
        where = (float(path.start[0]), float(path.start[1]), float(path.start[2]))
        pieces = tuple(path.curvature.tolist()), tuple(path.lengths.tolist())
        self._legs.append(RouteLeg(kind, where, *pieces, 0.0, self._s[-1]))

    def dock(self, X_WE: SE2, distance: float) -> None:
        """Lead the controlled point along the docking axis over the last ``distance`` [m] to the port.

        ``X_WE`` is the pose of the axle when the unit is docked.
        """
        axle = X_WE @ SE2(-distance, 0.0, 0.0)
        self.follow(Path(axle.as_array(), np.zeros(1), np.array([distance + self._offset])), LegKind.DOCK)

    def track(self) -> Track:
        """Return the track so far."""
        return Track(
            tuple(self._legs),
            np.array(self._s),
            np.array(self._poses),
            np.array(self._at_port, dtype=np.bool_),
        )

    def _append(self, s: float, pose: Array, at_port: bool) -> None:
        self._s.append(s)
        self._poses.append(pose)
        self._at_port.append(at_port)

    def _finish(self, kind: LegKind, start: SE2, turn: float = 0.0) -> None:
        where = (start.x, start.y, start.yaw)
        self._legs.append(RouteLeg(kind, where, (), (), turn, self._s[-1]))


def dock_start(legs: Sequence[RouteLeg], length: float) -> float:
    """Return the arc length at which the dock leg of a route begins, its ``length`` if there is none [m]."""
    if legs and legs[-1].kind is LegKind.DOCK:
        return legs[-2].end if len(legs) > 1 else 0.0
    return length


def path_of(leg: RouteLeg) -> Path:
    """Return the path of the controlled point on a leg forwards."""
    return Path(np.array(leg.start), np.array(leg.curvature), np.array(leg.lengths))


def track_of(legs: Sequence[RouteLeg], X_WU: SE2, offset: float) -> Track:
    """Return the track of legs for a unit at ``X_WU`` with its controlled point ``offset`` [m] ahead."""
    builder, begin = TrackBuilder(X_WU, offset), 0.0
    for leg in legs:
        if leg.kind is LegKind.BACK:
            builder.back(leg.end - begin)
        elif leg.kind is LegKind.REVERSE:
            builder.reverse(leg.end - begin)
        elif leg.kind is LegKind.TURN:
            builder.turn_by(leg.turn)
        else:
            builder.follow(path_of(leg), leg.kind)
        begin = leg.end
    return builder.track()


def standing(X_WU: SE2, at_port: bool = False) -> Track:
    """Return the track of a unit that stays where it stands."""
    return Track((), np.zeros(1), X_WU.as_array()[None], np.array([at_port]))
