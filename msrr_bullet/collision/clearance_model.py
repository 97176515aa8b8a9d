"""Clearances between the bodies of a scene.

The clearance of two bodies is the smallest distance between their parts
(:mod:`msrr_bullet.collision.convex_distance`). Where only the smallest clearance is asked for, only those
parts are measured that may be the nearest. A pair of bodies of which neither has moved is not measured again.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from itertools import combinations

from msrr_bullet.collision.clearance import Clearance, Pair
from msrr_bullet.collision.convex_distance import ROUNDING, PartPair, PlacedPart
from msrr_bullet.collision.footprint import Part, obstacle_parts, unit_parts
from msrr_scenes.errors import UnknownNameError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.specs.scene import Scene


class _Body:
    """The parts of a body, and its present pose; the parts are moved there only when they are measured."""

    def __init__(self, name: str, parts: Sequence[Part]) -> None:
        self.name = name
        self.parts = tuple(PlacedPart(part) for part in parts)
        self.reach = max(math.hypot(*part.centre) + part.circumradius for part in self.parts)
        self.pose = self._pose_of_parts = SE2()

    def place(self, X_WB: SE2) -> None:
        if self.pose is not X_WB and self.pose != X_WB:
            self.pose = X_WB

    def place_parts(self) -> None:
        X_WB = self.pose
        if self._pose_of_parts is X_WB:
            return
        c, s = math.cos(X_WB.yaw), math.sin(X_WB.yaw)
        for part in self.parts:
            part.place(X_WB, c, s)
        self._pose_of_parts = X_WB


class _BodyPair:
    """Two bodies with all pairs of their parts."""

    def __init__(self, a: _Body, b: _Body) -> None:
        self._a, self._b = a, b
        self.names: Pair = frozenset((a.name, b.name))
        self._reach = a.reach + b.reach + ROUNDING
        self._parts = tuple(PartPair(p, q) for p in a.parts for q in b.parts)
        self._nearest: PartPair | None = None
        self._poses: tuple[SE2, SE2] | None = None  # those for which the next two hold
        self._bound = 0.0
        self._measured: Clearance | None = None

    def lower_bound(self) -> float:
        """Return a lower bound of the clearance [m]: from circles about the bodies, or as it was measured."""
        a, b = self._a.pose, self._b.pose
        if self._poses is None or a is not self._poses[0] or b is not self._poses[1]:
            self._poses, self._measured = (a, b), None
            self._bound = math.hypot(a.x - b.x, a.y - b.y) - self._reach
        return self._bound

    def clearance(self, below: float) -> Clearance | None:
        """Return the clearance of the two bodies, or None when it is not below ``below`` [m].

        The pair of parts that was nearest the last time is measured first, because it excludes most of the
        others. The result does not depend on the order.
        """
        if self.lower_bound() >= below:
            return None
        if self._measured is None:
            self._measured = self._measure(below)
            self._bound = below if self._measured is None else self._measured.distance
        return self._measured

    def _measure(self, below: float) -> Clearance | None:
        self._a.place_parts()
        self._b.place_parts()
        first = self._nearest or min(self._parts, key=PartPair.circle_distance)
        first_gap = None if first.farther_than(below) else first.measure()
        nearest, gap = None, None
        for parts in self._parts:
            if parts is first:
                measured = first_gap
            else:
                limit = below if first_gap is None else min(below, first_gap.distance)
                measured = None if parts.farther_than(limit) else parts.measure()
            if measured is not None and measured.distance < below:
                nearest, gap, below = parts, measured, measured.distance
        if gap is None:
            return None
        self._nearest = nearest
        return Clearance(gap.distance, self._a.name, self._b.name, gap.point_a, gap.point_b)


class ClearanceModel:
    """The footprints of named bodies, which are placed and measured against each other."""

    def __init__(self, footprints: Mapping[str, Sequence[Part]], fixed: Collection[str] = ()) -> None:
        """Build the model.

        Parts are in the frame of their body. Those bodies that are ``fixed`` never move and are not measured
        against each other.
        """
        self._bodies = {name: _Body(name, parts) for name, parts in footprints.items()}
        self._fixed = frozenset(fixed)
        self._body_pairs: dict[tuple[str, str], _BodyPair] = {}
        # Names of the bodies that were present the last time, and all pairs of them.
        self._present: tuple[tuple[str, ...], list[_BodyPair]] | None = None

    @classmethod
    def from_scene(cls, scene: Scene) -> ClearanceModel:
        """Build the model of a scene, with the obstacles fixed."""
        footprints = {name: unit_parts(scene.geometry(name)) for name in scene.units}
        footprints |= {name: obstacle_parts(spec) for name, spec in scene.obstacles.items()}
        return cls(footprints, scene.obstacles)

    def query(
        self, poses: Mapping[str, SE2], exempt: Collection[Pair] = frozenset()
    ) -> tuple[Clearance, ...]:
        """Return the clearance of every pair of bodies, nearest first.

        Poses ``X_WB`` are those of all present bodies; B is frame U of a unit, the middle of an obstacle.
        Pairs such as two units that may touch are ``exempt`` and left out.

        Raises:
            UnknownNameError: A name is not that of a body of the model.
        """
        found = [pair.clearance(math.inf) for pair in self._pairs(poses, exempt)]
        return tuple(sorted((c for c in found if c is not None), key=lambda c: c.distance))

    def minimum(
        self, poses: Mapping[str, SE2], exempt: Collection[Pair] = frozenset(), below: float = math.inf
    ) -> Clearance | None:
        """Return the smallest clearance of all pairs, cheaper than :meth:`query`.

        None if no pair is nearer than ``below`` [m]; from there on nothing is measured.
        """
        # In order of lower bounds, as far as needed.
        pairs = self._pairs(poses, exempt)
        bounded = [(bound, i, pair) for i, pair in enumerate(pairs) if (bound := pair.lower_bound()) < below]
        if not bounded:
            return None
        best = min(bounded)[2].clearance(below)
        if best is not None:
            below = best.distance
        # Most pairs are farther than this one is, and need not be put in order.
        for bound, _, pair in sorted(each for each in bounded if each[0] < below):
            if bound >= below:
                break
            nearer = pair.clearance(below)
            if nearer is not None:
                best, below = nearer, nearer.distance
        return best

    def nearest(self, name: str, X_WB: SE2, others: Mapping[str, SE2]) -> Clearance | None:
        """Return the smallest clearance of one body at ``X_WB`` from others; None without any.

        Raises:
            UnknownNameError: A name is not that of a body of the model.
        """
        own, x, y = self._placed(name, X_WB), X_WB.x, X_WB.y
        best: Clearance | None = None
        below = math.inf
        # Bodies are placed in order of lower bounds, and most of them are too far away to be placed at all.
        bounded = [
            (math.hypot(X.x - x, X.y - y) - self._body(other).reach, other) for other, X in others.items()
        ]
        for distance, other in sorted(bounded):
            if distance - own.reach - ROUNDING >= below:
                break
            nearer = self._pair(own, self._placed(other, others[other])).clearance(below)
            if nearer is not None:
                best, below = nearer, nearer.distance
        return best

    def within(self, a: str, X_WA: SE2, b: str, X_WB: SE2, distance: float) -> bool:
        """Return whether the clearance of two bodies is less than ``distance`` [m].

        Raises:
            UnknownNameError: A name is not that of a body of the model.
        """
        return self._pair(self._placed(a, X_WA), self._placed(b, X_WB)).clearance(distance) is not None

    def _body(self, name: str) -> _Body:
        body = self._bodies.get(name)
        if body is None:
            raise UnknownNameError("body", name, self._bodies)
        return body

    def _placed(self, name: str, X_WB: SE2) -> _Body:
        body = self._body(name)
        body.place(X_WB)
        return body

    def _pair(self, a: _Body, b: _Body) -> _BodyPair:
        names = (a.name, b.name)
        pair = self._body_pairs.get(names)
        if pair is None:
            pair = self._body_pairs[names] = _BodyPair(a, b)
        return pair

    def _pairs(self, poses: Mapping[str, SE2], exempt: Collection[Pair]) -> list[_BodyPair]:
        """Place all bodies, and return the pairs that are to be measured."""
        for name, X_WB in poses.items():
            self._placed(name, X_WB)
        names = tuple(poses)
        if self._present is None or names != self._present[0]:
            bodies = [self._bodies[name] for name in names]
            pairs = [
                self._pair(a, b)
                for a, b in combinations(bodies, 2)
                if not (a.name in self._fixed and b.name in self._fixed)
            ]
            self._present = names, pairs
        return [pair for pair in self._present[1] if pair.names not in exempt]
