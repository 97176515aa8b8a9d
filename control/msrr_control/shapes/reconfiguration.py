"""From one shape to another: leaves leave their ports and dock again, as few as possible."""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from msrr_control.planning.free_space import Bounds
from msrr_control.shapes.least_hops import Form, Ports, least_hops
from msrr_control.shapes.precedence import Lanes
from msrr_control.shapes.shape import LEAST_GAP_M, Shape
from msrr_control.shapes.tasks import Task, TaskKind
from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.se2 import SE2

#: Largest number of forms that a search looks at.
_MOST_FORMS = 10_000

#: Weights of the bound: the fewest hops first; if that search takes too long, up to three times as many.
_WEIGHTS = (1.0, 3.0)

#: Poses on the way out of a port that has to be free, from the seat.
_WAY_OUT = np.array([[-0.04 * k, 0.0, 0.0] for k in range(13)])


class Hop(NamedTuple):
    """One unit leaves a place and docks in another one."""

    start: Ports
    end: Ports


def shape_ports(shape: Shape) -> dict[str, Ports]:
    """Return the ports from the root to every place of a shape, in the order of the shape."""
    ports: dict[str, Ports] = {shape.root.name: ()}
    for place in shape.places[1:]:
        assert place.parent is not None
        ports[place.name] = (*ports[place.parent], place.port)
    return ports


def assembly_ports(holders: Mapping[str, str]) -> dict[str, Ports]:
    """Return the ports from the root to every unit of an assembly.

    Args:
        holders: Port ``<unit>.<port>`` that each unit but the root is locked to.

    Raises:
        SceneError: The units are not one tree.
    """
    units = dict.fromkeys([*holders, *(port.partition(".")[0] for port in holders.values())])
    roots = [unit for unit in units if unit not in holders]
    if len(roots) != 1:
        raise SceneError(
            f"an assembly needs exactly one root, found {', '.join(roots) or 'none'}; a shape is built from "
            "one assembly, so lock all of its units to each other, or write a plan"
        )
    return shape_ports(Shape.from_tree({**dict.fromkeys(roots, "root"), **holders}))


def check_names(units: Sequence[str], named: Sequence[str]) -> None:
    """Refuse a shape whose places are not named by the units that it is built from, by the root for its root.

    Args:
        units: Units that are locked together, the root first.
        named: Names of the places of the shape, the root first.

    Raises:
        SceneError: The message says who.
    """
    others = [name for name in named if name not in units]
    if others:
        left = [unit for unit in units if unit not in named]
        raise SceneError(
            f"the places {', '.join(others)} are named by no unit of the assembly that the shape is built "
            f"from; name them {', '.join(left)}"
        )
    if named[0] != units[0]:
        raise SceneError(
            f"{named[0]!r} is to be the root of the shape, and the root of the assembly that it is built "
            f"from is {units[0]!r}, which stays where it is; make {units[0]!r} the root"
        )


class Reconfiguration:
    """Searches the hops that turn one assembly into another, with its root where it stands."""

    def __init__(self, lanes: Lanes, X_WR: SE2, box: Bounds) -> None:
        """Bind the search to the root's pose and to the space around it.

        Args:
            lanes: Lanes of the units.
            X_WR: Pose of the root.
            box: Where the axle may be and is seen: x low, x high, y low, y high [m].
        """
        self._lanes, self._box = lanes, box
        self._poses: dict[Ports, SE2] = {(): X_WR}
        self._inside: dict[Ports, bool] = {}
        self._pairs: dict[tuple[Ports, Ports], tuple[bool, bool]] = {}
        self._relative: dict[tuple[float, float, float], tuple[bool, bool]] = {}

    def pose(self, ports: Ports) -> SE2:
        """Return the pose of the unit in a place."""
        if ports not in self._poses:
            self._poses[ports] = self._lanes.body.docked(self.pose(ports[:-1]), ports[-1])
        return self._poses[ports]

    def hops(self, start: Mapping[Ports, str], goal: Mapping[Ports, str]) -> list[Hop]:
        """Return the hops from one form to another: the fewest, or, where that search would take long, few.

        Args:
            start: Places that are taken, with the name of the unit, or an empty one where any unit will do.
            goal: The same at the end.

        Returns:
            The hops, in an order in which they can be made one after another.

        Raises:
            SceneError: No way was found.
        """
        first, wanted = frozenset(start.items()), frozenset(goal.items())
        if not all(self._fits(place) for place, _ in wanted - first):
            raise SceneError(
                "the shape and the lanes to it do not fit into the arena from where the root of the assembly "
                "stands"
            )
        for weight in _WEIGHTS:
            hops, forms = self._search(first, wanted, weight)
            if hops is not None:
                return hops
            if forms <= _MOST_FORMS:
                raise SceneError(
                    "no order of leaving and docking again leads from one shape to the other; name others"
                )
        raise SceneError(
            "no order of leaving and docking again was found from one shape to the other among the "
            f"{_MOST_FORMS} forms that a search looks at; name others"
        )

    def _search(self, first: Form, wanted: Form, weight: float) -> tuple[list[Hop] | None, int]:
        """Return the hops of a way, None if none was found, and the number of forms that were looked at.

        This is A* with the bound of :func:`.least_hops` times the weight (Pohl 1970): no way has fewer hops
        than what is found, over the weight.
        """
        count = itertools.count()
        left = least_hops(first, wanted, self._closes)
        queue = [(weight * left, left, next(count), 0, first)]
        came: dict[Form, tuple[Form, Hop] | None] = {first: None}
        costs = {first: 0}
        while queue and len(costs) <= _MOST_FORMS:
            *_, cost, form = heapq.heappop(queue)
            if form == wanted:
                return _trace(came, form), len(costs)
            if cost > costs[form]:
                continue
            for hop, following in self._neighbours(form, wanted):
                if following not in costs or cost + 1 < costs[following]:
                    costs[following], came[following] = cost + 1, (form, hop)
                    left = least_hops(following, wanted, self._closes)
                    # Of equal ones that comes first which is nearest to the end.
                    heapq.heappush(queue, (cost + 1 + weight * left, left, next(count), cost + 1, following))
        return None, len(costs)

    def _neighbours(self, form: Form, wanted: Form) -> Iterator[tuple[Hop, Form]]:
        """Yield all hops of leaves and the forms to which they lead, those into missing places first."""
        taken = dict(sorted(form))
        parents = {ports[:-1] for ports in taken if ports}
        missing = sorted(wanted - form)
        for leaf, unit in taken.items():
            if not leaf or leaf in parents or not self._may_leave(leaf, taken):
                continue
            others = {ports for ports in taken if ports != leaf}
            places = [(*ports, port) for ports in sorted(others) for port in self._lanes.body.dock_frames]
            free = [place for place in places if place not in others and place != leaf]
            first = [place for place, name in missing if place in free and name == unit]
            for place in [*first, *(place for place in free if place not in first)]:
                if self._may_enter(place, others):
                    yield Hop(leaf, place), (form - {(leaf, unit)}) | {(place, unit)}

    def _may_leave(self, leaf: Ports, taken: Mapping[Ports, str]) -> bool:
        """Return whether the way out of a place is free."""
        return not any(self._blocks(leaf, p)[0] for p in taken if p not in (leaf, leaf[:-1]))

    def _may_enter(self, place: Ports, others: set[Ports]) -> bool:
        """Return whether a unit fits into a place and can come there."""
        return self._fits(place) and not any(self._closes(place, p) for p in others if p != place[:-1])

    def _fits(self, place: Ports) -> bool:
        """Return whether a place and the lane to it lie in the box."""
        if place not in self._inside:
            X, room = self.pose(place), self._lanes.spec.border_m + self._lanes.body.offset
            x0, x1, y0, y1 = self._box
            self._inside[place] = all(
                x0 + room <= pose.x <= x1 - room and y0 + room <= pose.y <= y1 - room
                for pose in (X, self._lanes.end(X))
            )
        return self._inside[place]

    def _closes(self, place: Ports, other: Ports) -> bool:
        """Return whether a unit in another place closes the way into a place."""
        return self._blocks(place, other)[1]

    def _blocks(self, place: Ports, other: Ports) -> tuple[bool, bool]:
        """Return whether a unit in another place blocks the way out of a place, and the way in."""
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


def reconfiguration_tasks(
    holders: Mapping[str, str],
    shape: Shape,
    lanes: Lanes,
    X_WR: SE2,
    box: Bounds,
    named: bool = False,
) -> list[Task]:
    """Return the tasks that turn an assembly into a shape; its root stays where it is.

    Args:
        holders: Port ``<unit>.<port>`` that each unit of the assembly but its root is locked to.
        shape: The shape.
        lanes: Lanes of the units.
        X_WR: Pose of the assembly's root.
        box: Where the axle may be and is seen: x low, x high, y low, y high [m].
        named: Whether the places of the shape are named by the units that have to take them.

    Raises:
        SceneError: Assembly and shape have different numbers of units, or there is no way.
    """
    ports = assembly_ports(holders)
    if len(ports) != len(shape.places):
        raise SceneError(f"the assembly has {len(ports)} units, the shape {len(shape.places)}")
    start = {place: unit if named else "" for unit, place in ports.items()}
    goal = {place: name if named else "" for name, place in shape_ports(shape).items()}
    hops = Reconfiguration(lanes, X_WR, box).hops(start, goal)
    unit_at = {place: unit for unit, place in ports.items()}
    task_of: dict[str, str] = {}  # the task that brings a unit to where it is by then
    visits: dict[str, int] = {}
    tasks: list[Task] = []
    for leaves, enters in hops:
        unit, holder = unit_at.pop(leaves), unit_at[enters[:-1]]
        hop = f"{unit} to {holder}.{enters[-1]}"
        # A unit may come to a port more than once, and tasks are told apart by their names.
        times = visits[hop] = visits.get(hop, 0) + 1
        name = hop if times == 1 else f"{hop} ({times})"
        tasks.append(
            Task(
                name,
                TaskKind.DOCK,
                unit,
                parent=task_of.get(holder),
                parent_unit=None if holder in task_of else holder,
                port=enters[-1],
                behind=(tasks[-1].name,) if tasks else (),
                after=(task_of[unit],) if unit in task_of else (),
                stays=True,
            )
        )
        unit_at[enters] = unit
        task_of[unit] = name
    return tasks


def _trace(came: Mapping[Form, tuple[Form, Hop] | None], form: Form) -> list[Hop]:
    hops: list[Hop] = []
    step = came[form]
    while step is not None:
        hops.append(step[1])
        step = came[step[0]]
    return hops[::-1]
