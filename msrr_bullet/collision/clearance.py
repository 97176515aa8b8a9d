"""The clearance record: the distance between two bodies and their nearest points."""

from __future__ import annotations

from dataclasses import dataclass

#: A point in the plane [m].
Point = tuple[float, float]

#: The unordered names of two bodies.
Pair = frozenset[str]


@dataclass(frozen=True, slots=True)
class Clearance:
    """The distance between two bodies.

    In an overlap the distance [m] is minus the penetration depth of the deepest pair of parts. The nearest
    points, in an overlap the deepest ones, are in W [m].
    """

    distance: float
    body_a: str
    body_b: str
    point_a: Point
    point_b: Point

    @property
    def pair(self) -> Pair:
        """The unordered names of the two bodies."""
        return frozenset((self.body_a, self.body_b))
