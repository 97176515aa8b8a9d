"""The command link: what arrives when, which of several counts, and what is lost."""

from __future__ import annotations

import numpy as np
import pytest

from msrr_bullet.sensors.command_link import CommandLink
from msrr_scenes.messages import Action, Phase, Twist
from msrr_scenes.random_streams import stream
from msrr_scenes.specs.vehicle import LinkSpec

MS = 1_000_000


def _action(stamp_ms: float) -> Action:
    """An action that can be told from every other one."""
    return Action(round(stamp_ms * MS), Phase.DOCK, 1, Twist(1e-3 * stamp_ms, 0.0))


def _link(latency_ms: float = 0.0, loss: float = 0.0, seed: int = 0) -> CommandLink:
    return CommandLink(LinkSpec(latency_ms=latency_ms, loss=loss), stream(seed, "unit/a/link"))


@pytest.mark.parametrize("latency_ms", [0.0, 7.5, 45.0])
def test_an_action_arrives_after_the_latency_and_once(latency_ms: float) -> None:
    link, action = _link(latency_ms), _action(100.0)
    link.send(action)
    due = round((100.0 + latency_ms) * MS)
    assert link.arrived(due - 1) is None
    assert link.arrived(due) is action
    assert link.arrived(due) is None
    assert link.arrived(due + 1000 * MS) is None


def test_of_several_that_arrived_the_newest_is_in_force() -> None:
    """Nobody asked for a while: what was commanded last counts, and the older ones never come up again."""
    link = _link(latency_ms=10.0)
    actions = [_action(20.0 * k) for k in range(5)]
    for action in actions:
        link.send(action)
    assert link.arrived(55 * MS) is actions[2]  # those of 0, 20 and 40 ms
    assert link.arrived(56 * MS) is None
    assert link.arrived(500 * MS) is actions[4]
    assert link.arrived(1000 * MS) is None


def test_two_of_the_same_instant_count_in_the_order_of_sending() -> None:
    link = _link()
    first, second = _action(5.0), _action(5.0)
    link.send(first)
    link.send(second)
    assert link.arrived(5 * MS) is second


def test_a_delay_longer_than_the_period_changes_no_order() -> None:
    """Actions every 20 ms, 130 ms under way, asked for every 5 ms: each arrives, in order, none twice."""
    link, arrived = _link(latency_ms=130.0), []
    for k in range(200):
        now_ms = 5.0 * k
        if k % 4 == 0:
            link.send(_action(now_ms))
        action = link.arrived(round(now_ms * MS))
        if action is not None:
            assert round(now_ms * MS) - action.stamp_ns == 130 * MS
            arrived.append(action.stamp_ns)
    assert arrived == [20 * MS * k for k in range(len(arrived))]
    assert len(arrived) == 44


@pytest.mark.parametrize("loss", [0.0, 0.2, 1.0])
def test_as_many_are_lost_as_told(loss: float) -> None:
    """2000 actions; the standard error at 20 % is 0.9 %: bounds of 5 % are more than five of them."""
    link, lost = _link(loss=loss), 0
    for k in range(2000):
        link.send(_action(20.0 * k))
        lost += link.arrived(20 * k * MS) is None
    assert lost / 2000 == (loss if loss in (0.0, 1.0) else pytest.approx(loss, abs=0.05))


def test_losses_do_not_move_the_luck_of_others() -> None:
    """Whatever a link loses, it draws one number for each action."""
    for loss in (0.0, 0.5, 1.0):
        rng = np.random.default_rng(4)
        link = CommandLink(LinkSpec(loss=loss), rng)
        for k in range(10):
            link.send(_action(float(k)))
        untouched = np.random.default_rng(4)
        untouched.random(10)
        assert rng.random() == untouched.random()
