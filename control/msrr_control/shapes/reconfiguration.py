"""From one shape to another: leaves leave their ports and dock again, as few as possible."""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Collection, Mapping, Sequence
from types import MappingProxyType

from msrr_control.planning.free_space import Bounds
from msrr_control.shapes.forms import CameFrom, Form, Hop, Ports, after_hop, hops_to, stands_free
from msrr_control.shapes.hop_rules import HopRules
from msrr_control.shapes.least_hops import least_hops
from msrr_control.shapes.place_by_place import place_by_place
from msrr_control.shapes.precedence import Lanes
from msrr_control.shapes.shape import Shape
from msrr_control.shapes.tasks import Task, TaskKind
from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import ObstacleEstimate

#: Largest number of forms that a search looks at.
_MOST_FORMS = 10_000


def shape_ports(shape: Shape) -> dict[str, Ports]:
    """Return the ports from the root to every place of a shape, in the order of the shape."""
    ports: dict[str, Ports] = {shape.root.name: ()}
    for place in shape.places[1:]:
        assert place.parent is not None
        ports[place.name] = (*ports[place.parent], place.port)
    return ports


def assembly_ports(holders: Mapping[str, str]) -> dict[str, Ports]:
    """Return the ports from the root to every unit of an assembly, by the ports that hold all but the root.

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

    In both the root comes first.

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


def hops_between(start: Mapping[Ports, str], goal: Mapping[Ports, str], *rules: HopRules) -> list[Hop]:
    """Return the hops from one form to another: the fewest, or, where that search would take long, few.

    Places have the name of the unit, or an empty one where any unit will do; ``goal`` is for all units or for
    some of them. Where the hops by the first rules lead nowhere, those by the next ones are made.

    Returns:
        The hops, in an order in which they can be made one after another.

    Raises:
        SceneError: No way was found.
    """
    why = ""
    for each in rules:
        found = _hops_or_reason(start, goal, each)
        if not isinstance(found, str):
            return found
        why = found
    raise SceneError(why)


def _hops_or_reason(
    start: Mapping[Ports, str], goal: Mapping[Ports, str], rules: HopRules
) -> list[Hop] | str:
    """Return the hops from one form to another, or why there are none."""
    first, wanted = frozenset(start.items()), frozenset(goal.items())
    for place, _ in sorted(wanted - first):
        hindrance = rules.hindrance(place)
        if hindrance is not None:
            return f"{hindrance} from where the root of the assembly stands"
    past = f" past {', '.join(obstacle.name for obstacle in rules.obstacles)}" if rules.obstacles else ""
    hops, forms = _fewest_hops(first, wanted, rules)
    if hops is None and forms <= _MOST_FORMS:
        return f"no order of leaving and docking again leads from one shape to the other{past}; name others"
    if hops is None and len(goal) == len(start):
        hops = place_by_place(start, goal, rules)
    if hops is None:
        return (
            f"no order of leaving and docking again was found from one shape to the other{past}, neither "
            f"among the {_MOST_FORMS} forms that a search looks at nor place by place; name others"
        )
    return hops


def _fewest_hops(first: Form, wanted: Form, rules: HopRules) -> tuple[list[Hop] | None, int]:
    """Return the fewest hops, None if none were found, and the number of forms that were looked at.

    This is A* with the bound of :func:`.least_hops`.
    """
    count = itertools.count()
    left = least_hops(first, wanted, rules.closes)
    queue = [(left, left, next(count), 0, first)]
    came: CameFrom = {first: None}
    costs = {first: 0}
    while queue and len(costs) <= _MOST_FORMS:
        *_, cost, form = heapq.heappop(queue)
        if wanted <= form:
            return hops_to(form, came), len(costs)
        if cost > costs[form]:
            continue
        taken = dict(sorted(form))
        missing = wanted - form
        # Of equally good hops of a unit those come first that fill a missing place.
        fills = {hop: (hop.end, taken[hop.start]) in missing for hop in rules.hops(taken)}
        for hop in sorted(fills, key=lambda hop: (hop.start, (0, hop.end) if fills[hop] else (1, ()))):
            following = after_hop(form, hop, taken[hop.start])
            if following not in costs or cost + 1 < costs[following]:
                costs[following], came[following] = cost + 1, (form, hop)
                left = least_hops(following, wanted, rules.closes)
                # Of equal ones that comes first which is nearest to the end.
                heapq.heappush(queue, (cost + 1 + left, left, next(count), cost + 1, following))
    return None, len(costs)


def reconfiguration_tasks(
    holders: Mapping[str, str],
    shape: Shape,
    lanes: Lanes,
    X_WR: SE2,
    box: Bounds,
    named: bool = False,
    obstacles: Sequence[ObstacleEstimate] = (),
) -> list[Task]:
    """Return the tasks that turn an assembly into a shape; its root stays where it is.

    The arguments are those of :func:`tasks_from`, but for the port ``<unit>.<port>`` that each unit but the
    root is locked to.

    Raises:
        SceneError: Assembly and shape have different numbers of units, or there is no way.
    """
    ports = assembly_ports(holders)
    if len(ports) != len(shape.places):
        raise SceneError(f"the assembly has {len(ports)} units, the shape {len(shape.places)}")
    return tasks_from(ports, shape, lanes, X_WR, box, named, obstacles, past=True)[0]


def tasks_from(
    places: Mapping[str, Ports],
    shape: Shape,
    lanes: Lanes,
    X_WR: SE2,
    box: Bounds,
    named: bool = False,
    obstacles: Sequence[ObstacleEstimate] = (),
    out: Mapping[str, SE2] = MappingProxyType({}),
    past: bool = False,
) -> tuple[list[Task], bool]:
    """Return the tasks that lead from the places of all units to a shape, or to as much of it as is left.

    ``places`` has the place of each unit, by its name, the root's included. Of those that stand free the
    first ones are taken where there are more than places for them. Those in ``out``, with their poses, are
    out of action and stay in their places. The places of the shape may be ``named`` by the units that have to
    take them, and ``box`` is as for :class:`~msrr_control.shapes.hop_rules.HopRules`. If ``past``, hops may
    lead past an obstacle farther before a port than a unit has to drive straight, where there are no others.
    It may leave a way there, or none.

    Returns:
        The tasks, and whether they lead to the whole shape, without a unit beside it that is locked to it.

    Raises:
        SceneError: There is no way.
    """
    start = {place: unit if named else "" for unit, place in places.items()}
    goal = whole = {place: name if named else "" for name, place in shape_ports(shape).items()}
    still = {places[unit]: X for unit, X in out.items()}
    rules = [HopRules(lanes, X_WR, box, obstacles, roomy=bool(obstacles), out=still)]
    if obstacles and past:
        rules.append(HopRules(lanes, X_WR, box, obstacles, out=still))
    stuck = rules[-1].stuck(start)
    start = _without_spares(start, goal, stuck)
    if still:
        goal = _part(start, goal, rules[-1], stuck)
    hops = hops_between(start, goal, *rules)
    unit_at = {place: unit for unit, place in places.items()}
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
    return tasks, whole.items() <= goal.items() and all(p in whole or stands_free(p) for p in stuck)


def _without_spares(
    start: Mapping[Ports, str], goal: Mapping[Ports, str], stuck: Collection[Ports]
) -> dict[Ports, str]:
    """Return the places that are taken without those of units that stand free and are not needed.

    A hop of one of these would save no hop of another unit, but might leave it in a port beside the shape.
    The goal is for the whole shape.
    """
    free = [place for place in start if stands_free(place) and place not in stuck]
    if any(goal.values()):
        return {place: unit for place, unit in start.items() if place not in free or unit in goal.values()}
    others = [place for place in start if place not in free and (place not in stuck or place in goal)]
    spare = free[max(len(goal) - len(others), 0) :]
    return {place: unit for place, unit in start.items() if place not in spare}


def _part(
    start: Mapping[Ports, str], goal: Mapping[Ports, str], rules: HopRules, stuck: Collection[Ports]
) -> dict[Ports, str]:
    """Return the part of a shape that can be filled although some units are out of action.

    Places that are taken already come first, so that no unit hops from one place of the part to another. The
    goal is for the whole shape, each place after its holder.
    """
    part = {place: start[place] for place in stuck}
    left = [unit for place, unit in start.items() if place not in stuck]
    for place in sorted(goal, key=lambda place: place not in start):
        unit = goal[place]
        held = not place or place[:-1] in part
        if place in part or unit not in left or not held:
            continue
        if start.get(place) == unit or rules.may_enter(place, stuck):
            part[place] = unit
            left.remove(unit)
    return part
