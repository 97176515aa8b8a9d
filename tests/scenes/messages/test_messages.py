"""Messages: frozen, exported from one place, and the little that they compute."""

import dataclasses
import inspect

import pytest

from msrr_scenes import messages
from msrr_scenes.messages import NS_PER_S, SeatSwitches, Twist, seconds


def test_every_message_is_frozen() -> None:
    classes = [c for name in messages.__all__ if inspect.isclass(c := getattr(messages, name))]
    data = [c for c in classes if dataclasses.is_dataclass(c)]
    assert len(data) > 15
    assert all(c.__dataclass_params__.frozen for c in data)
    with pytest.raises(dataclasses.FrozenInstanceError):
        Twist().v = 1.0


def test_times_are_whole_nanoseconds() -> None:
    assert seconds(NS_PER_S) == 1.0
    assert seconds(-1_500_000) == -0.0015


@pytest.mark.parametrize(("left", "right"), [(True, True), (True, False), (False, True), (False, False)])
def test_a_unit_is_seated_when_both_switches_say_so(left: bool, right: bool) -> None:
    assert SeatSwitches("b", 0, left, right).both is (left and right)
