"""Shapes: trees of places that are joined by ports, and what makes a shape impossible."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

from msrr_control.shapes.bodies import ACTIVE_PORT, Body
from msrr_scenes.errors import SceneError, nearest
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.specs.mission import Pattern, ShapeSpec

#: Gap between two bodies below which they would touch while one of them docks [m].
LEAST_GAP_M = 0.02


@dataclass(frozen=True, slots=True)
class Place:
    """A place of a shape, and the passive port of its parent that it docks to; the root has neither."""

    name: str
    parent: str | None = None
    port: str = ""


@dataclass(frozen=True)
class Shape:
    """A tree of places, each after its parent, the root first; others dock with their active front port."""

    places: tuple[Place, ...]

    @classmethod
    def of(cls, spec: ShapeSpec) -> Shape:
        """Return the shape that a scene describes.

        Raises:
            SceneError: The tree has no root, more than one, or a place that is not joined to it.
        """
        if spec.pattern is not None:
            return build_pattern(*spec.pattern)
        return cls.from_tree(spec.tree or {})

    @classmethod
    def from_tree(cls, tree: Mapping[str, str]) -> Shape:
        """Return the shape of a tree: every place with ``<place>.<port>`` or ``root``.

        Raises:
            SceneError: The tree has no root, more than one, or a place that is not joined to it.
        """
        roots = [name for name, to in tree.items() if to == "root"]
        if len(roots) != 1:
            found = ", ".join(roots) or "none"
            raise SceneError(f"a shape needs exactly one root, found {found}; write `root` for one place")
        places = [Place(roots[0])]
        for place in places:  # the list grows while it is walked: each place brings those docked to it
            for name, to in tree.items():
                parent, _, port = to.partition(".")
                if to != "root" and parent == place.name:
                    places.append(Place(name, parent, port))
        for name, to in tree.items():
            parent = to.partition(".")[0]
            if to != "root" and parent not in tree:
                raise SceneError(f"{name}: no place named {parent!r}{nearest(parent, tree)}")
        missing = [name for name in tree if name not in {p.name for p in places}]
        if missing:
            raise SceneError(
                f"not joined to the root {roots[0]!r}: {', '.join(missing)}; dock each to a place of the tree"
            )
        return cls(tuple(places))

    @property
    def root(self) -> Place:
        """The place that docks to nobody."""
        return self.places[0]

    @cached_property
    def by_name(self) -> Mapping[str, Place]:
        """The places by name."""
        return {place.name: place for place in self.places}

    def poses(self, X_WR: SE2, body: Body) -> dict[str, SE2]:
        """Return the pose of the unit in every place, with the root at ``X_WR``."""
        poses = {self.root.name: X_WR}
        for place in self.places[1:]:
            assert place.parent is not None
            poses[place.name] = body.docked(poses[place.parent], place.port)
        return poses

    def problem(self, body: Body) -> str | None:
        """Return why no order of docking can build this shape, as far as its places tell; None if none does.

        Lanes that what was built closes are the matter of
        :func:`~msrr_control.shapes.precedence.precede`.
        """
        taken: dict[tuple[str | None, str], str] = {}
        for place in self.places[1:]:
            port = f"{place.parent}.{place.port}"
            if place.port not in body.dock_frames:
                passive = ", ".join(body.dock_frames)
                active = " is the active port and" if place.port == ACTIVE_PORT else ""
                return f"{place.name}: {port}{active} takes nobody; dock it to a passive port: {passive}"
            other = taken.setdefault((place.parent, place.port), place.name)
            if other != place.name:
                return f"{place.name}: {port} is taken by {other}; dock it to another port"
        poses = self.poses(SE2(), body)
        for a, b in combinations(self.places, 2):
            if a.name == b.parent or b.name == a.parent:
                continue
            gap = body.gap(poses[a.name], poses[b.name])
            if gap < LEAST_GAP_M:
                how = "overlap" if gap < -LEAST_GAP_M else "touch"
                only = "units stand side by side only where a port joins them; dock one of them elsewhere"
                return f"{a.name} and {b.name} would {how}: {only}"
        return None


def build_pattern(pattern: Pattern, count: int) -> Shape:
    """Return a pattern of ``count`` units, with the places ``p0`` (the root), ``p1`` and so on.

    Raises:
        ValueError: There is no unit.
    """
    if count < 1:
        raise ValueError(f"a pattern of {count} units; it has at least one, its root")
    joints: list[tuple[int, str]]
    match pattern:
        case "line":
            joints = _chain(0, count - 1)
        case "tee":
            bar = count // 2 + 1
            joints = _chain(0, bar - 1)
            joints += _chain(bar // 2, count - bar, "left", first=bar)
        case "cross":
            joints, rest, length = [], count - 1, 0
            for share, port in ((3, "rear"), (2, "left"), (1, "right")):
                length = -(-rest // share)
                joints += _chain(0, length, port, first=len(joints) + 1)
                rest -= length
        case "comb":
            spine = next(m for m in range(1, count + 1) if m + (m + 1) // 2 >= count)
            joints = _chain(0, spine - 1)
            joints += [(2 * k, "left") for k in range(count - spine)]
        case "zigzag":
            turns = ("left", "right")
            joints = [(k, "rear" if k == 0 else turns[(k + 1) % 2]) for k in range(count - 1)]
    places = (Place(f"p{k + 1}", f"p{parent}", port) for k, (parent, port) in enumerate(joints))
    return Shape((Place("p0"), *places))


def _chain(parent: int, length: int, port: str = "rear", first: int = 1) -> list[tuple[int, str]]:
    """Return the joints of a line whose first unit, number ``first``, docks to ``port`` of ``parent``."""
    rest = [(first + k, "rear") for k in range(length - 1)]
    return [(parent, port), *rest] if length > 0 else []
