"""Where the units of the ledger stand, for the planning of another one: by sight, and by their docks."""

from __future__ import annotations

from collections.abc import Collection, Iterable

from msrr_control.coordination.ledger import UnitRecord
from msrr_control.shapes.bodies import Body
from msrr_control.tracks.route_request import Standing
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages.coordination import UnitState


def standing_unit(
    unit: UnitRecord,
    units: Collection[UnitRecord],
    leaves: tuple[str, str] | None,
    enters: tuple[str, str] | None,
    body: Body,
) -> Standing:
    """Return the body of a unit for the planning of another one: at the end of its route, or where it is.

    Args:
        unit: The unit.
        units: All units, of which some may be docked to this one, or be on the way there.
        leaves: Unit and port at which the other one's track begins; None in the open.
        enters: Unit and port at which it ends; None in the open.
        body: Form of the units.
    """
    X_WS, X_WE = (None if port is None else _seat(unit, port, units, body) for port in (leaves, enters))
    if unit.under_way:
        return Standing(unit.name, unit.destination, unit.enters is not None, X_WS, X_WE)
    holds = any(unit.name == port[0] for other in units for port in other.docks)
    docked = bool(unit.docks) or unit.state is UnitState.DOCKED
    return Standing(unit.name, unit.pose, holds or docked, X_WS, X_WE)


def _seat(unit: UnitRecord, port: tuple[str, str], units: Iterable[UnitRecord], body: Body) -> SE2 | None:
    """Return the pose of a unit docked to a port of the assembly of another one, as seen from that one.

    Sight errs by centimetres for one that has just stopped, pins and holes by less than a millimetre: the way
    from there to the port goes from dock to dock, of which some may be yet to come. None if none does.
    """
    docks = {u.name: dock for u in units if (dock := u.enters if u.under_way else u.holder) is not None}
    poses = {unit.name: unit.destination}
    while port[0] not in poses:
        found = {}
        for name, (holder, slot) in docks.items():
            if holder in poses and name not in poses:
                found[name] = body.docked(poses[holder], slot)
            elif name in poses and holder not in poses:
                found[holder] = poses[name] @ body.docked(SE2(), slot).inverse()
        if not found:
            return None
        poses |= found
    return body.docked(poses[port[0]], port[1])
