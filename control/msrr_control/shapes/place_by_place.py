"""A way from one form to another place by place, also for many units with names; not that of the fewest hops.

The search for the fewest hops looks at all that units can do, which for a dozen of them is too much. Here one
place after another is filled for good, and only what is in the way of that hops.
"""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Iterable, Mapping, Sequence

from msrr_control.shapes.forms import CameFrom, Hop, Ports, after_hop, hops_to, stands_free
from msrr_control.shapes.hop_rules import HopRules

#: Largest number of forms that are looked at to fill one place.
_MOST_FORMS = 6_000

#: Largest number of hops for each unit.
_MOST_HOPS = 8

#: What it costs to move a unit out of the way that is where it is to be, in hops of others.
_UNSETTLED = 5


def place_by_place(
    start: Mapping[Ports, str], goal: Mapping[Ports, str], rules: HopRules
) -> list[Hop] | None:
    """Return hops from one form to another; None if none were found this way.

    Where all hops can be made backwards, the way back is a way there, too: the shorter one is returned. Both
    forms have the same root and as many places; see :func:`msrr_control.shapes.reconfiguration.hops_between`.
    """
    there, back = _PlaceByPlace(goal, rules).hops(start), _PlaceByPlace(start, rules).hops(goal)
    back = None if back is None else [Hop(end, begin) for begin, end in reversed(back)]
    ways = [hops for hops in (there, back) if hops is not None and _can_be_made(hops, start, rules)]
    found = (_shortened(hops, start, rules) for hops in ways)
    return min(found, key=len, default=None)


class _PlaceByPlace:
    """Fills the places of a form; a place is settled when it is filled and those before it are settled."""

    def __init__(self, goal: Mapping[Ports, str], rules: HopRules) -> None:
        self._goal, self._rules = goal, rules
        #: Places in the open in which units that are out of action stay, which have no holder.
        self._always = {place for place in goal if place in rules.out and stands_free(place)}
        # A place comes after its holder, and after all to which it closes the lane.
        self._before = {
            place: {place[:-1]} | {other for other in goal if place != other and rules.closes(other, place)}
            for place in goal
            if place and place not in self._always
        }
        self._closed: dict[Ports, set[Ports]] = {}  # places of the goal to which a place closes the lane

    def hops(self, start: Mapping[Ports, str]) -> list[Hop] | None:
        """Return hops from a form to the goal, None if they were not found."""
        form, hops = dict(start), list[Hop]()
        settled: set[Ports] = {(), *self._always}
        while len(settled) < len(self._goal) and len(hops) <= _MOST_HOPS * len(self._goal):
            ready = [place for place, before in self._before.items() if before <= settled]
            costs = {place: self._cost(place, form, settled) for place in ready if place not in settled}
            for place in sorted(costs, key=lambda p: (costs[p], len(p), p)):
                kept = self._kept(settled, self._hindering(place, form, settled))
                found = self._fill(place, form, kept)
                if found is not None:
                    hops, form, settled = hops + found[0], found[1], kept | {place}
                    break
            else:
                return None
        return hops if len(settled) == len(self._goal) else None

    def _filled(self, place: Ports, form: Mapping[Ports, str]) -> bool:
        return form.get(place) == self._goal[place]

    def _cost(self, place: Ports, form: Mapping[Ports, str], settled: set[Ports]) -> int:
        hindering = self._hindering(place, form, settled)
        return -1 if self._filled(place, form) else len(hindering) + _UNSETTLED * len(hindering & settled)

    def _hindering(self, place: Ports, form: Mapping[Ports, str], settled: set[Ports]) -> set[Ports]:
        """Return the fewest units, by their places, that hop before another unit fills a place."""
        if self._filled(place, form):
            return set()
        # Nobody is settled in a lane to a place that comes later: those places come first.
        off = {p for p in form if p not in settled and (p == place or self._rules.closes(place, p))}
        unit = self._goal[place]
        sources = (p for p, name in form.items() if name == unit and p not in settled)
        return min((self._hops_before(p, off, form) for p in sources), key=len)

    def _hops_before(self, source: Ports, off: set[Ports], form: Iterable[Ports]) -> set[Ports]:
        """Return the units that hop before one is free to go, and others are out of the way."""
        found, queue = {source, *off}, [source, *off]
        for place in queue:  # the list grows while it is walked
            for other in form:
                above = other[: len(place)] == place
                if other and other not in found and (above or self._rules.holds_in(place, other)):
                    found.add(other)
                    queue.append(other)
        # One that stands on, or is, what has to go comes back afterwards.
        again = any(source[: len(place)] == place for place in off)
        return found if again else found - {source}

    def _kept(self, settled: set[Ports], hindering: set[Ports]) -> set[Ports]:
        """Return what stays settled if some units hop out of the way."""
        kept = settled - hindering
        while lost := {place for place in kept if place and not self._before[place] <= kept}:
            kept -= lost
        return kept

    def _fill(
        self, place: Ports, form: dict[Ports, str], settled: set[Ports]
    ) -> tuple[list[Hop], dict[Ports, str]] | None:
        """Return hops, none of them of a settled unit, after which a place is filled, and the form then.

        This is a greedy best-first search by the number of units that are in the way.
        """
        first = frozenset(form.items())
        came: CameFrom = {first: None}
        count = itertools.count()
        queue = [(0, 0, 0.0, next(count), first)]
        while queue and len(came) <= _MOST_FORMS:
            _, cost, _, _, reached = heapq.heappop(queue)
            taken = dict(sorted(reached))  # sets have another order in every process
            if self._filled(place, taken):
                return hops_to(reached, came), taken
            for hop in self._rules.hops(taken):
                unit = taken[hop.start]
                if hop.start in settled or (hop.end == place and unit != self._goal[place]):
                    continue
                following = after_hop(reached, hop, unit)
                if following in came:
                    continue
                came[following] = reached, hop
                left = 0 if hop.end == place else 1 + len(self._hindering(place, dict(following), settled))
                entry = (left, cost + 1, self._disturbance(hop.end, unit, settled), next(count), following)
                heapq.heappush(queue, entry)
        return None

    def _disturbance(self, place: Ports, unit: str, settled: set[Ports]) -> float:
        """Return in how many lanes and places that are filled later a unit stands in a place."""
        if place not in self._closed:
            self._closed[place] = {p for p in self._goal if self._rules.closes(p, place)}
        if self._goal.get(place) == unit:
            return float(len(self._closed[place] - settled))
        return len(self._closed[place] - settled) + (1.0 if place in self._goal else 0.5)


def _shortened(hops: list[Hop], start: Mapping[Ports, str], rules: HopRules) -> list[Hop]:
    """Return hops to the same form, with one hop instead of two of a unit wherever that can be made."""
    for first, hop in enumerate(hops):
        second = next((k for k in range(first + 1, len(hops)) if hops[k].start == hop.end), None)
        if second is None:
            continue
        before, between, after = hops[:first], hops[first + 1 : second], hops[second + 1 :]
        one = Hop(hop.start, hops[second].end)
        middles = [between] if one.start == one.end else [[*between, one], [one, *between]]
        for middle in middles:
            if _can_be_made([*before, *middle, *after], start, rules):
                return _shortened([*before, *middle, *after], start, rules)
    return hops


def _can_be_made(hops: Sequence[Hop], start: Mapping[Ports, str], rules: HopRules) -> bool:
    taken = dict(start)
    for hop in hops:
        if not rules.allow(taken, hop):
            return False
        taken[hop.end] = taken.pop(hop.start)
    return True
