"""The motion of a lock: the closing time, and what commands in between change."""

from hypothesis import given, settings
from hypothesis import strategies as st

from msrr_bullet.plant.lock_actuator import LockActuator
from msrr_scenes.messages import LockPosition


def test_closing_takes_the_closing_time_and_starts_again_after_opening():
    lock = LockActuator(0.5)
    assert not lock.step(1.0)
    lock.command(True)
    assert [lock.step(0.1) for _ in range(6)] == [False] * 4 + [True, False]
    lock.command(True)  # stays closed
    assert lock.position is LockPosition.CLOSED
    lock.command(False)
    lock.command(True)
    assert not lock.step(0.4)
    lock.command(False)
    lock.command(True)
    assert not lock.step(0.4)  # opened in between, so that closing starts again
    assert lock.step(0.1)


@settings(deadline=None)
@given(st.floats(0.01, 3.0), st.lists(st.one_of(st.booleans(), st.floats(0.001, 0.5)), max_size=60))
def test_a_lock_is_closed_only_after_the_closing_time_without_a_command_to_open(close_time_s, events):
    """Commands (bool) and time steps (float) in any order."""
    lock, since_command_s = LockActuator(close_time_s), None
    for event in events:
        if isinstance(event, bool):
            lock.command(event)
            since_command_s = (since_command_s or 0.0) if event else None
        else:
            was_closed = lock.position is LockPosition.CLOSED
            has_closed = lock.step(event)
            assert has_closed is (lock.position is LockPosition.CLOSED and not was_closed)
            if since_command_s is not None:
                since_command_s += event
        if since_command_s is None:
            assert lock.position is LockPosition.OPEN
        elif abs(since_command_s - close_time_s) > 1e-6:
            closed = since_command_s > close_time_s
            assert lock.position is (LockPosition.CLOSED if closed else LockPosition.CLOSING)
