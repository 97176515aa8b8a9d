"""Messages: frozen, exported from one place, and the little that they compute."""

import dataclasses
import inspect

import pytest

from msrr_scenes import messages
from msrr_scenes.messages import NS_PER_S, Action, Phase, SeatSwitches, Twist, seconds


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
    switches = SeatSwitches("b", 0, left, right)
    assert (switches.both, switches.either) == (left and right, left or right)


def test_another_twist_changes_nothing_else_of_an_action() -> None:
    action = Action(5, Phase.DOCK, 2, Twist(0.1, 0.2), lock=True, reason="seen")
    told = [f.name for f in dataclasses.fields(action) if getattr(action, f.name) != f.default]
    assert len(told) == len(dataclasses.fields(action))  # a field left at its default would not be missed
    assert action.with_twist(Twist(0.3, 0.0)) == dataclasses.replace(action, twist=Twist(0.3, 0.0))
