"""The radio: what is not lost arrives once, where it was sent to, late, and in a fixed order."""

from __future__ import annotations

from msrr_bullet.sensors.radio import Radio
from msrr_bullet.sensors.schedule import NEVER_NS, duration_ns
from msrr_scenes.messages.coordination import Authority, UnitMode, UnitReport
from msrr_scenes.specs.mission import RadioSpec, SilenceSpec

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


def _arrivals(radio: Radio, until_ms: int, step_ms: int = 10) -> dict[tuple[str, str], dict[int, int]]:
    """When each message arrives that is sent every so often in both directions [ms], by when it is sent."""
    arrivals: dict[tuple[str, str], dict[int, int]] = {(d, u): {} for d in ("up", "down") for u in UNITS}
    for now in range(0, until_ms + 200, step_ms):
        now_ns = now * 1_000_000
        if now < until_ms:
            for unit in UNITS:
                radio.from_units[unit].send(report(unit, now), now_ns)
                radio.to_units[unit].send(authority(unit, now), now_ns)
        for each in radio.arrived_at_base(now_ns):
            arrivals["up", each.unit][each.stamp_ns] = now
        for unit, some in radio.arrived_at_units(now_ns).items():
            arrivals["down", unit].update({each.seq: now for each in some})
    return arrivals


def test_a_silence_takes_what_is_sent_in_it_and_changes_nothing_else() -> None:
    """From its beginning on, until before its end, to and from its units, or all where none are named."""
    spec = RadioSpec(latency_ms=30.0, jitter_ms=60.0, loss=0.3)
    usual = _arrivals(Radio(spec, UNITS, seed=5), 1000)
    for units in ((), ("a", "c")):
        silence = SilenceSpec(from_s=0.3, until_s=0.6, units=units)
        radio = Radio(spec.model_copy(update={"silences": (silence,)}), UNITS, seed=5)
        for (way, unit), told in _arrivals(radio, 1000).items():
            kept = {k: at for k, at in usual[way, unit].items() if not 300 <= k < 600}
            assert told == (usual[way, unit] if units and unit not in units else kept)
    assert all(max(k for k in told if k < 600) >= 300 for told in usual.values())


def test_links_lose_and_delay_messages_of_their_own() -> None:
    radio = Radio(RadioSpec(latency_ms=30.0, jitter_ms=60.0, loss=0.3), UNITS, seed=5)
    arrivals = _arrivals(radio, 1000)
    assert len({tuple(sorted(told.items())) for told in arrivals.values()}) == len(arrivals)
    for told in arrivals.values():
        delays = [at - sent for sent, at in told.items()]
        assert 30 <= min(delays) < 50
        assert 70 < max(delays) <= 90


def test_a_radio_gives_the_time_of_its_next_message() -> None:
    radio = Radio(RadioSpec(latency_ms=20.0), UNITS, seed=0)
    assert radio.next_ns == NEVER_NS
    radio.to_units["a"].send(authority("a", 1), 7)
    assert radio.next_ns == 20_000_007
    radio.from_units["b"].send(report("b", 0), 2)
    assert radio.next_ns == 20_000_002
    assert radio.arrived_at_units(20_000_006) == {}
    assert radio.arrived_at_base(20_000_002) == [report("b", 0)]
    assert radio.next_ns == 20_000_007
