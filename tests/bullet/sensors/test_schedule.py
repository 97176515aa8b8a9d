"""Periodic events and delayed messages on an integer time axis."""

from __future__ import annotations

import math
from bisect import bisect_left
from fractions import Fraction

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from msrr_bullet.sensors.schedule import NEVER_NS, Delayed, Periodic, duration_ns

S = 1_000_000_000


def test_durations_are_whole_nanoseconds() -> None:
    assert duration_ns(0.04) == 40_000_000
    assert duration_ns(1.0 / 3.0) == 333_333_333
    assert duration_ns(2.0 / 3.0) == 666_666_667


@settings(deadline=None)
@given(st.floats(0.5, 300.0), st.floats(20.0, 1000.0), st.integers(0, S))
def test_an_event_happens_at_the_first_tick_at_or_after_each_due_time(
    rate_hz: float, tick_hz: float, start_ns: int
) -> None:
    """Without drift: after any time the number of events is that of the due times, up to the tick rate."""
    event = Periodic(rate_hz, start_ns)
    assert not event.due(start_ns - 1)
    ticks = [start_ns + round(k * S / tick_hz) for k in range(400)]
    events = [tick for tick in ticks if event.due(tick)]
    assert events[0] == start_ns
    due = [start_ns + round(k * S / rate_hz) for k in range(int(400 * rate_hz / tick_hz) + 2)]
    due = [time for time in due if time <= ticks[-1]]
    expected = {ticks[bisect_left(ticks, time)] for time in due}
    # A due time within a nanosecond of a tick may fall on either side of it by rounding.
    ambiguous = sum(ticks[bisect_left(ticks, time - 1)] <= time + 1 for time in due[1:])
    assert len(set(events) ^ expected) <= 2 * ambiguous
    assert len(events) == len(set(events))


@pytest.mark.parametrize("first", range(6))
@pytest.mark.parametrize("tick_hz", [240, 250, 480, 960])
@pytest.mark.parametrize("rate_hz", [10, 25, 30, 48, 50, 60, 80, 120, 240])
def test_an_event_that_begins_at_any_tick_misses_no_tick_that_is_due(
    rate_hz: int, tick_hz: int, first: int
) -> None:
    """At 240 Hz one of three encoder readings was lost in a step that began at such a tick."""
    ticks = [round(k * S / tick_hz) for k in range(first, first + 4 * tick_hz)]
    event = Periodic(float(rate_hz), ticks[0])
    happened = [k for k, tick in enumerate(ticks) if event.due(tick)]
    due = [math.ceil(Fraction(k * tick_hz, rate_hz)) for k in range(4 * rate_hz)]
    assert happened == sorted({k for k in due if k < len(ticks)})


@settings(deadline=None)
@given(st.floats(0.5, 300.0), st.integers(0, S))
def test_an_event_is_due_at_the_time_that_it_gives_and_not_before(rate_hz: float, start_ns: int) -> None:
    event = Periodic(rate_hz, start_ns)
    for _ in range(50):
        next_ns = event.next_ns
        assert not event.due(next_ns - 1)
        assert event.due(next_ns)
        assert event.next_ns > next_ns


def test_a_queue_gives_the_time_of_its_next_message() -> None:
    queue: Delayed[str] = Delayed()
    assert queue.next_ns == NEVER_NS
    queue.send(30, "late")
    queue.send(20, "early")
    assert queue.next_ns == 20
    assert queue.arrived(20) == ["early"]
    assert queue.next_ns == 30


def test_events_that_nobody_asked_for_count_as_one() -> None:
    event = Periodic(10.0)
    assert event.due(0)
    assert event.due(S)  # nine were missed
    assert not event.due(S + 1)
    assert event.due(S + S // 10)


@settings(deadline=None)
@given(st.lists(st.tuples(st.integers(0, 50), st.integers(0, 20)), max_size=40))
def test_every_message_arrives_once_in_order_of_arrival_and_sending(messages: list[tuple[int, int]]) -> None:
    """Messages of (time of arrival, time step before the next poll), which cannot be compared."""
    queue: Delayed[complex] = Delayed()
    for i, (arrival, _) in enumerate(messages):
        queue.send(arrival, complex(i))
    arrived, now = [], 0
    for _, step in [*messages, (0, 51)]:
        now += step
        batch = [int(message.real) for message in queue.arrived(now)]
        assert all(messages[i][0] <= now for i in batch)
        arrived += batch
    assert arrived == sorted(range(len(messages)), key=lambda i: (messages[i][0], i))
    assert queue.arrived(10**9) == []
