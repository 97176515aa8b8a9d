"""The distance between two bodies, as it is measured, logged and drawn."""

from __future__ import annotations

from dataclasses import dataclass

#: A point in the plane [m].
Point = tuple[float, float]

#: The names of two bodies, in no order.
Pair = frozenset[str]


@dataclass(frozen=True, slots=True)
class Clearance:
    """The distance between two bodies.

    Attributes:
        distance: [m]; 0 or less where they touch: minus the way that would part the deepest pair of parts.
        body_a: Name of one body.
        body_b: Name of the other.
        point_a: The nearest point of ``body_a`` in W [m]; in an overlap, its deepest one.
        point_b: The nearest point of ``body_b`` in W [m].
    """

    distance: float
    body_a: str
    body_b: str
    point_a: Point
    point_b: Point

    @property
    def pair(self) -> Pair:
        """The two names, in no order."""
        return frozenset((self.body_a, self.body_b))
