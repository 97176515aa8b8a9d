"""Which hops the units of an assembly can make."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from types import MappingProxyType

import numpy as np

from msrr_control.planning.free_space import Bounds
from msrr_control.shapes.forms import Hop, Ports, stands_free
from msrr_control.shapes.precedence import Lanes, compose
from msrr_control.shapes.shape import LEAST_GAP_M
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import ObstacleEstimate

#: Shortest way straight back out of a port [m].
LEAST_WAY_OUT_M = 0.30

#: Distance by which a unit may come farther out of the box on it [m].
_SLACK_M = 1e-3

#: Poses on the way out of a port that has to be free, from the seat.
_WAY_OUT = np.array([[-0.04 * k, 0.0, 0.0] for k in range(13)])

#: Poses on the shortest of these ways.
_SHORTEST_WAY_OUT = np.array([[-x, 0.0, 0.0] for x in np.linspace(0.0, LEAST_WAY_OUT_M, 10)])


class HopRules:
    """Says which hops can be made; most of them can be made backwards, too.

    A unit leaves its place if it carries nobody, the way out is free and leads no farther out of the box, and
    it enters a place of which the holder is there, the lane is free and lies in the box. One that stands free
    is in nobody's way, for it can be sent elsewhere. One that is out of action stays where it is, and nobody
    docks to it.
    """

    def __init__(
        self,
        lanes: Lanes,
        X_WR: SE2,
        box: Bounds,
        obstacles: Sequence[ObstacleEstimate] = (),
        roomy: bool = False,
        out: Mapping[Ports, SE2] = MappingProxyType({}),
    ) -> None:
        """Bind the rules to the root's pose and to the space around it.

        The axle may be and is seen in ``box``: x low, x high, y low, y high [m]. The known obstacles keep out
        of the whole lanes if they are ``roomy``, and not only of where a unit drives straight. ``out`` are
        the places of the units that are out of action, with their poses.
        """
        self._roomy = roomy
        self._lanes, self._box, self.obstacles = lanes, box, obstacles
        self.out = frozenset(out)
        self._poses: dict[Ports, SE2] = {(): X_WR} | {p: X for p, X in out.items() if stands_free(p)}
        self._unfit: dict[Ports, str | None] = {}
        self._shut: dict[Ports, bool] = {}
        self._pairs: dict[tuple[Ports, Ports], tuple[bool, bool]] = {}
        self._relative: dict[tuple[float, float, float], tuple[bool, bool]] = {}

    def pose(self, ports: Ports) -> SE2:
        """Return the pose of the unit in a place."""
        if ports not in self._poses:
            self._poses[ports] = self._lanes.body.docked(self.pose(ports[:-1]), ports[-1])
        return self._poses[ports]

    def hops(self, taken: Mapping[Ports, str]) -> Iterator[Hop]:
        """Yield all hops of units that stand in some places."""
        order = sorted(taken)
        parents = {ports[:-1] for ports in order if ports}
        for leaf in order:
            if not leaf or leaf in parents or not self._may_leave(leaf, taken):
                continue
            others = {ports for ports in order if ports != leaf}
            for holder in order:
                for port in self._lanes.body.dock_frames if holder != leaf else ():
                    place = (*holder, port)
                    if place not in taken and self.may_enter(place, others):
                        yield Hop(leaf, place)

    def allow(self, taken: Mapping[Ports, str], hop: Hop) -> bool:
        """Return whether a hop can be made by a unit of those that stand in some places."""
        start, end = hop
        others = {ports for ports in taken if ports != start}
        leaf = start in taken and bool(start) and not any(ports[:-1] == start for ports in others if ports)
        reachable = end not in taken and end[:-1] in others
        return leaf and reachable and self._may_leave(start, taken) and self.may_enter(end, others)

    def hindrance(self, place: Ports) -> str | None:
        """Return what keeps everybody from a place, in words: border or obstacle; None if nothing does."""
        if place not in self._unfit:
            X, room = self.pose(place), self._lanes.spec.border_m + self._lanes.body.offset
            x0, x1, y0, y1 = self._box
            fits = all(
                x0 + room <= pose.x <= x1 - room and y0 + room <= pose.y <= y1 - room
                for pose in (X, self._lanes.end(X))
            )
            obstacle = self._lanes.obstacle_in(X, self.obstacles, self._roomy)
            stands = None if obstacle is None else f"{obstacle} stands in the lane to a place of the shape,"
            self._unfit[place] = stands if fits else "the shape and the lanes to it do not fit into the arena"
        return self._unfit[place]

    def closes(self, place: Ports, other: Ports) -> bool:
        """Return whether a unit in another place closes the way into a place."""
        return other != place[:-1] and self._blocks(place, other)[1]

    def holds_in(self, place: Ports, other: Ports) -> bool:
        """Return whether a unit in another place blocks the way out of a place."""
        return other != place[:-1] and self._blocks(place, other)[0]

    def stuck(self, taken: Iterable[Ports]) -> set[Ports]:
        """Return the places of the units that never hop: out of action, or kept where they are for good."""
        found, more = set(self.out), set(self.out)
        while more:
            more = {
                place
                for place in taken
                if place not in found
                and not stands_free(place)
                and (
                    any(other[: len(place)] == place or self.holds_in(place, other) for other in found)
                    or self._is_shut(place)
                )
            }
            found |= more
        return found

    def _is_shut(self, place: Ports) -> bool:
        """Return whether the shortest way out of a place leads farther out of the box, or at an obstacle."""
        if place not in self._shut:
            (x0, x1, y0, y1), X = self._box, self.pose(place)
            ends = X, X @ SE2(-LEAST_WAY_OUT_M, 0.0, 0.0)
            here, there = (max(x0 - end.x, end.x - x1, y0 - end.y, end.y - y1) for end in ends)
            out = compose(X, _SHORTEST_WAY_OUT)
            held = any(self._lanes.body.comes_near(out, obstacle) for obstacle in self.obstacles)
            self._shut[place] = held or there > max(here, 0.0) + _SLACK_M
        return self._shut[place]

    def _may_leave(self, leaf: Ports, taken: Mapping[Ports, str]) -> bool:
        if leaf in self.out or stands_free(leaf):
            return leaf not in self.out
        return not self._is_shut(leaf) and not any(self.holds_in(leaf, p) for p in taken if p != leaf)

    def may_enter(self, place: Ports, others: Iterable[Ports]) -> bool:
        """Return whether a unit can enter a place while others stand in theirs."""
        if place[:-1] in self.out or stands_free(place):
            return False
        return self.hindrance(place) is None and not any(self.closes(place, p) for p in others)

    def _blocks(self, place: Ports, other: Ports) -> tuple[bool, bool]:
        """Return whether a unit in another place blocks the way out of a place, and the way in."""
        if any(stands_free(p) and p not in self.out for p in (place, other)):
            return False, False
        found = self._pairs.get((place, other))
        if found is None:
            X = self.pose(place).inverse() @ self.pose(other)
            key = (round(X.x, 4), round(X.y, 4), round(X.yaw, 4))
            if key not in self._relative:  # few, for all places lie on a grid
                body = X.as_array()[None]
                out = bool(self._lanes.body.near(_WAY_OUT, body, LEAST_GAP_M).any())
                self._relative[key] = out, bool(self._lanes.closes(SE2(), body)[0])
            found = self._pairs[place, other] = self._relative[key]
        return found
