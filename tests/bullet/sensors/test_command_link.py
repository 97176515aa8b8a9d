"""The command link: latency, order, and loss of actions."""

from __future__ import annotations

import numpy as np
import pytest

from msrr_bullet.sensors.command_link import CommandLink
from msrr_scenes.messages import Action, Phase, Twist
from msrr_scenes.random_streams import stream
from msrr_scenes.specs.vehicle import LinkSpec

MS = 1_000_000


def _action(stamp_ms: float) -> Action:
    """An action that differs from that of any other time."""
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


def test_the_newest_of_several_arrived_actions_is_returned() -> None:
    """Older actions that arrived since the last call are dropped."""
    link = _link(latency_ms=10.0)
    actions = [_action(20.0 * k) for k in range(5)]
    for action in actions:
        link.send(action)
    assert link.arrived(55 * MS) is actions[2]  # those of 0, 20 and 40 ms
    assert link.arrived(56 * MS) is None
    assert link.arrived(500 * MS) is actions[4]
    assert link.arrived(1000 * MS) is None


def test_actions_of_one_instant_keep_the_order_of_sending() -> None:
    link = _link()
    first, second = _action(5.0), _action(5.0)
    link.send(first)
    link.send(second)
    assert link.arrived(5 * MS) is second


def test_a_latency_longer_than_the_period_keeps_the_order() -> None:
    """Actions every 20 ms with a latency of 130 ms, polled every 5 ms: each arrives once and in order."""
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
def test_the_share_of_lost_actions_is_that_of_the_specification(loss: float) -> None:
    """2000 actions; the standard error at 20 % is 0.9 %: bounds of 5 % are more than five of them."""
    link, lost = _link(loss=loss), 0
    for k in range(2000):
        link.send(_action(20.0 * k))
        lost += link.arrived(20 * k * MS) is None
    assert lost / 2000 == (loss if loss in (0.0, 1.0) else pytest.approx(loss, abs=0.05))


def test_one_number_is_drawn_per_action_whatever_the_loss() -> None:
    for loss in (0.0, 0.5, 1.0):
        rng = np.random.default_rng(4)
        link = CommandLink(LinkSpec(loss=loss), rng)
        for k in range(10):
            link.send(_action(float(k)))
        untouched = np.random.default_rng(4)
        untouched.random(10)
        assert rng.random() == untouched.random()
