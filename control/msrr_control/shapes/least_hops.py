"""A lower bound of the hops from one form to another, by which the search for the fewest hops is led.

A unit docks in a place only after all units that stand in the lane to it have left, and a unit leaves only
after all that are docked to it. So every missing place has a set of units that hop before it is filled.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from graphlib import CycleError, TopologicalSorter
from itertools import chain

from msrr_control.shapes.forms import Form, Ports


def least_hops(form: Form, wanted: Form, closes: Callable[[Ports, Ports], bool]) -> int:
    """Return a number of hops without which no way leads from a form to the one that is wanted.

    Every missing place needs a hop that fills it. Where it does not matter which unit that is, let the places
    be sorted by how many units hop before they are filled. Of the places from number k on (from 0), let the
    first one to be filled need n units: n - 1 of them hop before, and not more than k of these hops fill the
    other places. The rest fill none, or fill one that was left again, which is a hop more as well.

    Where it matters, a unit that makes one hop alone fills its own place with it. Of units each of which has
    to hop before the next one is in its place, and the last before the first, one needs a second hop. Places
    have the name of the unit, or an empty one where any unit will do. Both forms have the same root, and
    there are no more places in the one that is wanted. ``closes`` tells whether a unit in the second place
    closes the lane to the first one.
    """
    missing = sorted(wanted - form, key=lambda member: (len(member[0]), member))  # parents come first
    before = _hops_before(form, missing, closes)
    if not any(unit for _, unit in wanted):
        counts = sorted(len(units) for units in before.values())
        return len(missing) + max([0, *(n - 1 - k for k, n in enumerate(counts))])
    place_of = {unit: place for place, unit in form}
    moves = {place_of[unit]: before[place] for place, unit in missing}
    returns = set(chain.from_iterable(moves.values())) - set(moves)  # they fill none of the missing places
    waits = {place: sorted(units & moves.keys()) for place, units in moves.items()}
    back = returns & {place for place, _ in form & wanted}  # the others may stay where they hop to
    return len(missing) + len(returns) + len(back) + _separate_rings(waits)


def _hops_before(
    form: Form, missing: list[tuple[Ports, str]], closes: Callable[[Ports, Ports], bool]
) -> dict[Ports, set[Ports]]:
    """Return the units, by their places in a form, that hop before each missing place is filled for good."""
    taken = [place for place, _ in form]
    place_of = {unit: place for place, unit in form if unit}
    filled_by = dict(missing)
    before: dict[Ports, set[Ports]] = {}
    for place, unit in missing:
        parent, start = place[:-1], place_of.get(unit)
        leave = {p for p in taken if p != parent and p != start and (p == place or closes(place, p))}
        units = {p for p in taken if any(p[: len(q)] == q for q in leave)}
        units |= {p for p in taken if start is not None and p != start and p[: len(start)] == start}
        if parent in before:
            units |= before[parent]
            if filled_by[parent]:
                units.add(place_of[filled_by[parent]])
        before[place] = units
    return before


def _separate_rings(waits: Mapping[Ports, list[Ports]]) -> int:
    """Return how many rings of nodes, each of which waits for the next, were found without a common node."""
    left, rings = dict(waits), 0
    while True:
        graph = {node: [other for other in others if other in left] for node, others in left.items()}
        try:
            TopologicalSorter(graph).prepare()
        except CycleError as error:
            rings += 1
            for node in set(error.args[1]):
                del left[node]
        else:
            return rings
