"""Where units stand for the planning of another one: by their docks where there are any."""

from __future__ import annotations

import numpy as np

from msrr_control.coordination.ledger import UnitRecord
from msrr_control.coordination.setup import CoordinationSetup
from msrr_control.coordination.standing_units import standing_unit
from msrr_control.tracks.track import standing
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages.coordination import UnitState


def test_a_port_is_where_the_docks_put_it_seen_from_any_unit_of_the_assembly(
    setup: CoordinationSetup,
) -> None:
    """One that is on its way counts with the port that it enters, one in the open belongs to no assembly."""
    body, X = setup.lanes.body, SE2(0.3, -0.2, 0.7)
    docks = {"b": ("a", "left"), "c": ("b", "rear"), "d": ("a", "right"), "e": ("d", "rear")}
    units = {"a": UnitRecord("a", X_WU=X, state=UnitState.DOCKED), "free": UnitRecord("free", X_WU=SE2())}
    for name, (holder, port) in docks.items():
        X_WU = body.docked(units[holder].destination, port)
        units[name] = UnitRecord(name, X_WU=X_WU, state=UnitState.DOCKED, holder=(holder, port))
    arriving = units["e"]
    arriving.state, arriving.holder, arriving.enters = UnitState.UNDER_WAY, None, docks["e"]
    arriving.X_WU, arriving.track = SE2(-1.0, 1.0, 0.0), standing(units["e"].pose, at_port=True)
    for holder in "abcde":
        for name in "abcde":
            seen = standing_unit(units[name], units.values(), (holder, "rear"), (holder, "left"), body)
            for seat, port in ((seen.X_WS, "rear"), (seen.X_WE, "left")):
                assert seat is not None
                place = body.docked(units[holder].destination, port)
                np.testing.assert_allclose((seat.inverse() @ place).as_array(), 0.0, atol=1e-12)
        free = standing_unit(units["free"], units.values(), (holder, "rear"), (holder, "left"), body)
        assert (free.X_WS, free.X_WE) == (None, None)
    there = standing_unit(units["c"], units.values(), None, None, body)
    assert (there.X_WS, there.X_WE) == (None, None)
