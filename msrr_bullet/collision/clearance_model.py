"""How far the bodies are apart, and where.

A body is as far from another as the nearest two of their parts
(:mod:`msrr_bullet.collision.convex_distance`). Where the
smallest clearance alone is asked for, only those parts are measured that may be the nearest.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from itertools import combinations

from msrr_bullet.collision.clearance import Clearance, Pair
from msrr_bullet.collision.convex_distance import ROUNDING, PartPair, PlacedPart
from msrr_bullet.collision.footprint import Part, obstacle_parts, unit_parts
from msrr_scenes.errors import UnknownNameError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.specs.scene import Scene


class _Body:
    """A body's parts, moved together."""

    def __init__(self, name: str, parts: Sequence[Part]) -> None:
        self.name = name
        self.parts = tuple(PlacedPart(part) for part in parts)
        self.reach = max(math.hypot(*part.middle) + part.circumradius for part in self.parts)
        self.pose = SE2()

    def place(self, X_WB: SE2) -> None:
        if self.pose is X_WB or self.pose == X_WB:
            return
        c, s = math.cos(X_WB.yaw), math.sin(X_WB.yaw)
        for part in self.parts:
            part.place(X_WB, c, s)
        self.pose = X_WB


class _BodyPair:
    """Two bodies with all pairs of their parts."""

    def __init__(self, a: _Body, b: _Body) -> None:
        self._a, self._b = a, b
        self._reach = a.reach + b.reach + ROUNDING
        self._parts = tuple(PartPair(p, q) for p in a.parts for q in b.parts)
        self._nearest: PartPair | None = None

    def circles_apart(self) -> float:
        """Return a distance [m] that the two bodies have at least, from the circles about them."""
        a, b = self._a.pose, self._b.pose
        return math.hypot(a.x - b.x, a.y - b.y) - self._reach

    def clearance(self, below: float) -> Clearance | None:
        """Return their clearance where they are, or None when it is not below ``below`` [m].

        Those parts that were nearest the last time come first, for they tell best what need not be measured.
        What is found does not depend on it.
        """
        first = self._nearest or min(self._parts, key=PartPair.circles_apart)
        found = None if first.farther_than(below) else first.measure()
        nearest, gap = None, None
        for parts in self._parts:
            if parts is first:
                measured = found
            else:
                enough = below if found is None else min(below, found.distance)
                measured = None if parts.farther_than(enough) else parts.measure()
            if measured is not None and measured.distance < below:
                nearest, gap, below = parts, measured, measured.distance
        if gap is None:
            return None
        self._nearest = nearest
        return Clearance(gap.distance, self._a.name, self._b.name, gap.point_a, gap.point_b)


class ClearanceModel:
    """The shapes of a scene, ready to be placed and measured.

    Two obstacles are never measured against each other: neither moves.
    """

    def __init__(self, scene: Scene) -> None:
        """Take the units' shapes from their URDFs and the obstacles' from the scene."""
        footprints = {name: unit_parts(scene.geometry(name)) for name in scene.units}
        footprints |= {name: obstacle_parts(spec) for name, spec in scene.obstacles.items()}
        self._build(footprints, scene.obstacles)

    @classmethod
    def from_footprints(
        cls, footprints: Mapping[str, Sequence[Part]], fixed: Collection[str] = ()
    ) -> ClearanceModel:
        """Build from footprints by name; the ``fixed`` ones are not measured against each other."""
        model = cls.__new__(cls)
        model._build(footprints, fixed)
        return model

    def _build(self, footprints: Mapping[str, Sequence[Part]], fixed: Collection[str]) -> None:
        self._bodies = {name: _Body(name, parts) for name, parts in footprints.items()}
        self._fixed = frozenset(fixed)
        self._met: dict[tuple[str, str], _BodyPair] = {}

    def query(
        self, poses: Mapping[str, SE2], exempt: Collection[Pair] = frozenset()
    ) -> tuple[Clearance, ...]:
        """Return the clearance of every pair of bodies, nearest first.

        Args:
            poses: ``X_WB`` by name: frame U of a unit, the middle of an obstacle. Bodies that are not named
                are not there (yet).
            exempt: Pairs to leave out, such as two units whose contact is authorised.

        Raises:
            UnknownNameError: A pose for a body that the scene does not have.
        """
        found = [pair.clearance(math.inf) for pair in self._pairs(poses, exempt)]
        return tuple(sorted((c for c in found if c is not None), key=lambda c: c.distance))

    def minimum(self, poses: Mapping[str, SE2], exempt: Collection[Pair] = frozenset()) -> Clearance | None:
        """Return the smallest clearance, cheaper than by :meth:`query`; None when there is no pair."""
        return self._smallest(self._pairs(poses, exempt))

    def nearest(self, name: str, X_WB: SE2, others: Mapping[str, SE2]) -> Clearance | None:
        """Return the smallest clearance of one body, of pose ``X_WB``, from others; None if there are none.

        Raises:
            UnknownNameError: A body that the scene does not have.
        """
        own = self._placed(name, X_WB)
        return self._smallest(self._pair(own, self._placed(other, X)) for other, X in others.items())

    def _placed(self, name: str, X_WB: SE2) -> _Body:
        body = self._bodies.get(name)
        if body is None:
            raise UnknownNameError("body", name, self._bodies)
        body.place(X_WB)
        return body

    def _pair(self, a: _Body, b: _Body) -> _BodyPair:
        names = (a.name, b.name)
        pair = self._met.get(names)
        if pair is None:
            pair = self._met[names] = _BodyPair(a, b)
        return pair

    def _pairs(self, poses: Mapping[str, SE2], exempt: Collection[Pair]) -> Iterator[_BodyPair]:
        present = [self._placed(name, X_WB) for name, X_WB in poses.items()]
        for a, b in combinations(present, 2):
            if a.name in self._fixed and b.name in self._fixed:
                continue
            if not exempt or frozenset((a.name, b.name)) not in exempt:
                yield self._pair(a, b)

    def _smallest(self, pairs: Iterable[_BodyPair]) -> Clearance | None:
        """Take pairs in the order of what the circles about them promise, until none can be nearer."""
        best: Clearance | None = None
        bounded = sorted(((pair.circles_apart(), i, pair) for i, pair in enumerate(pairs)))
        for bound, _, pair in bounded:
            if best is not None and bound >= best.distance:
                break
            best = pair.clearance(best.distance if best else math.inf) or best
        return best
