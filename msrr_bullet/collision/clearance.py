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

    Attributes:
        distance: Distance [m]; in an overlap, minus the penetration depth of the deepest pair of parts.
        body_a: Name of one body.
        body_b: Name of the other body.
        point_a: Nearest point of ``body_a`` in W [m]; in an overlap, the deepest point.
        point_b: Nearest point of ``body_b`` in W [m]; in an overlap, the deepest point.
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
