"""How long a unit waits for an overhead picture before it backs out where its own camera does not look."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from msrr_control.docking.controller import build_controller
from msrr_control.docking.law import DockSetup
from msrr_control.sequence.observation import Observation
from msrr_control.sequence.state_machine import PhaseMachine
from msrr_control.sequence.tuning import PhaseTuning
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import LockFeedback, LockPosition, Phase, PoseEstimate, Twist, seconds
from msrr_scenes.specs.plan import DockingSpec
from msrr_scenes.specs.spec import Choice

DT_NS = 20_000_000
TUNING = PhaseTuning()

#: The exposure time of the newest overhead picture, from the time and the time of the decision to back out.
Pictures = Callable[[int, int], int | None]


class _InPlace:
    """A long-distance phase that finds the unit where it should be."""

    def reset(self, reason: str) -> None: ...

    def step(self, senses: Observation) -> Twist | None:
        return None


def waited_s(
    facts: DockSetup, pictures: Pictures, overhead: bool = True, lock_opens_s: float = 0.0
) -> tuple[float, float]:
    """Return how long a unit that stalled before the port stands in its retreat, and how long that lasts."""
    law = build_controller(Choice(name="c1"), facts)
    spec = DockingSpec(attempts=1)
    machine = PhaseMachine(spec, facts, law, _InPlace() if overhead else None)
    X_DU = SE2(-facts.offset - 0.05, 0.0, 0.0)
    began, moved, now = -1, -1, 0
    while not machine.finished:
        now += DT_NS
        seen = pictures(now, began if began >= 0 else now)
        is_open = (seconds(now - began) if began >= 0 else 0.0) >= lock_opens_s
        lock = LockFeedback("a", now, LockPosition.OPEN if is_open else LockPosition.CLOSING)
        pose = PoseEstimate(now, X_DU, np.diag([1e-6, 1e-6, 1e-6]), now)
        action = machine.step(Observation(now, pose, lock=lock, looked_around_ns=seen))
        if action.phase is Phase.RETREAT:
            began = now if began < 0 else began
            moved = now if moved < 0 and action.twist.v < 0.0 else moved
    assert 0 < began <= moved
    return seconds(moved - began), seconds(now - began)


@pytest.mark.parametrize("late_s", [0.04, 0.16, 0.5])
def test_it_goes_when_a_picture_of_after_the_decision_arrives(facts: DockSetup, late_s: float) -> None:
    def pictures(now_ns: int, decided_ns: int) -> int | None:
        """One a tick after the decision, so late; up to then one from the instant of the decision itself."""
        return decided_ns + 1 if now_ns >= decided_ns + round(1e9 * late_s) else decided_ns

    waited, _ = waited_s(facts, pictures)
    assert waited == pytest.approx(late_s, abs=1e-9)


@pytest.mark.parametrize("pictures", [lambda now, decided: None, lambda now, decided: 0], ids=["none", "old"])
def test_it_goes_when_no_picture_comes(facts: DockSetup, pictures: Pictures) -> None:
    waited, lasted = waited_s(facts, pictures)
    assert waited == pytest.approx(TUNING.look_around_s + 1e-9 * DT_NS, abs=1e-9)
    # The unit is held where it is, as by a guard: the time for the way counts from where it may go.
    way_s = DockingSpec().retreat_m / TUNING.retreat.speed_mps + TUNING.retreat_margin_s
    assert lasted == pytest.approx(waited + way_s + TUNING.settle_s, abs=4e-9 * DT_NS)


def test_a_scene_without_an_overhead_camera_has_nothing_to_wait_for(facts: DockSetup) -> None:
    assert waited_s(facts, lambda now, decided: None, overhead=False)[0] == 0.0


def test_the_lock_has_to_be_open_as_well(facts: DockSetup) -> None:
    waited, _ = waited_s(facts, lambda now, decided: now, lock_opens_s=0.4)
    assert waited == pytest.approx(0.4, abs=1e-9)
