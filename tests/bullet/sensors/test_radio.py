"""The radio: what is not lost arrives once, where it was sent to, late, and in a fixed order."""

from __future__ import annotations

from msrr_bullet.sensors.radio import Radio
from msrr_bullet.sensors.schedule import duration_ns
from msrr_scenes.messages.coordination import Authority, UnitMode, UnitReport
from msrr_scenes.specs.mission import RadioSpec

UNITS = ("c", "a", "b")


def report(unit: str, stamp_ns: int) -> UnitReport:
    return UnitReport(unit, stamp_ns, seq=0, route=0, progress=0.0, mode=UnitMode.STANDING, docked_to=None)


def authority(unit: str, seq: int) -> Authority:
    return Authority(
        unit, route=0, seq=seq, stamp_ns=0, expires_ns=0, limit=0.0, legs=(), to=None, unlock=False
    )


def test_messages_arrive_once_at_their_receivers_in_the_order_of_the_units() -> None:
    spec = RadioSpec(latency_ms=20.0, jitter_ms=30.0, loss=0.2)
    radio = Radio(spec, UNITS, seed=3)
    sent_ns: dict[tuple[str, int], int] = {}
    heard: list[tuple[str, int]] = []
    obeyed: list[tuple[str, int]] = []
    for k in range(1000):
        now = k * duration_ns(0.01)
        if k < 900:
            for unit in reversed(UNITS):
                sent_ns[unit, k] = now
                radio.from_units[unit].send(report(unit, k), now)
                radio.to_units[unit].send(authority(unit, k), now)
        reports, authorities = radio.arrived_at_base(now), radio.arrived_at_units(now)
        order = [UNITS.index(each.unit) for each in reports]
        assert order == sorted(order)
        assert all(each.unit == unit for unit, some in authorities.items() for each in some)
        arrived = [(r.unit, r.stamp_ns) for r in reports]
        given = [(a.unit, a.seq) for some in authorities.values() for a in some]
        delays = [now - sent_ns[key] for key in (*arrived, *given)]
        assert all(duration_ns(0.02) <= delay <= duration_ns(0.06) for delay in delays)
        heard += arrived
        obeyed += given
    for messages in (heard, obeyed):
        assert len(set(messages)) == len(messages)
    assert len(heard) + len(obeyed) == radio.sent - radio.lost
    assert 0 < radio.lost < radio.sent == 2 * len(sent_ns)
