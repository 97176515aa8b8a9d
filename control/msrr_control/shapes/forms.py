"""Forms of an assembly, and hops from one to another: a unit leaves its port and docks in another one."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

#: Ports from the root to a place; the root itself is the empty path. A unit that stands free has a place of
#: its own, see :func:`beside`.
Ports = tuple[str, ...]

#: A form that an assembly can have: every place that is taken, with the name of the unit, or an empty one
#: where it does not matter which unit that is.
Form = frozenset[tuple[Ports, str]]


class Hop(NamedTuple):
    """One unit leaves a place and docks in another one."""

    start: Ports
    end: Ports


#: The form from which a search came to each form, and the hop; None for the first one.
CameFrom = dict[Form, tuple[Form, Hop] | None]


def beside(unit: str) -> Ports:
    """Return the place of a unit that stands free."""
    return ("", unit)


def stands_free(place: Ports) -> bool:
    """Return whether a place is that of a unit that stands free."""
    return place[:1] == ("",)


def after_hop(form: Form, hop: Hop, unit: str) -> Form:
    """Return the form after a hop of a unit."""
    return (form - {(hop.start, unit)}) | {(hop.end, unit)}


def hops_to(form: Form, came: Mapping[Form, tuple[Form, Hop] | None]) -> list[Hop]:
    """Return the hops by which a search came to a form."""
    hops: list[Hop] = []
    step = came[form]
    while step is not None:
        hops.append(step[1])
        step = came[step[0]]
    return hops[::-1]
