"""Moves of a unit to where the one stands that carries it: it leaves its port, then the other makes way."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from msrr_control.coordination.mission import Mission
from msrr_control.coordination.setup import CoordinationSetup
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages.coordination import MissionState
from msrr_scenes.specs.plan import DockStep, MoveStep
from msrr_scenes.specs.spec import PoseSpec

Rig = Any


def _move(unit: str, X: SE2, name: str = "there") -> MoveStep:
    return MoveStep(move=unit, name=name, pose=PoseSpec(x_m=X.x, y_m=X.y, yaw_deg=math.degrees(X.yaw)))


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("port", ["rear", "left", "right"])
def test_a_unit_takes_the_place_of_the_one_that_carries_it(
    seed: int, port: str, rig: type[Rig], setup: CoordinationSetup
) -> None:
    """Wherever the two stand, however near the end is, and whether or not the carrier has a step as well."""
    rng = np.random.default_rng([seed, len(port)])
    A = SE2(*rng.uniform([-0.6, -0.4, -math.pi], [0.6, 0.4, math.pi]))
    end = A @ SE2(*rng.uniform([-0.05, -0.05, -math.pi], [0.05, 0.05, math.pi]))
    steps = [_move("b", end), _move("a", SE2(-1.3, 0.9, 0.0), "away")][: 1 + seed % 2]
    starts = {"a": A, "b": setup.lanes.body.docked(A, port)}
    run = rig(Mission(steps=steps, holders={"b": f"a.{port}"}), starts)
    assert run.run().state is MissionState.COMPLETE, run.status.reason
    assert setup.tolerance.holds(end.inverse() @ run.units["b"].X_WU)


def test_so_does_one_that_docked_in_the_plan(rig: type[Rig]) -> None:
    starts = {"a": SE2(0.3, 0.0, 0.0), "b": SE2(-1.2, 0.0, 0.0)}
    run = rig(Mission(steps=[DockStep(unit="b", to="a.rear"), _move("b", starts["a"])]), starts)
    assert run.run().state is MissionState.COMPLETE, run.status.reason


def test_one_that_everybody_has_left_makes_way(rig: type[Rig], setup: CoordinationSetup) -> None:
    A = SE2(0.3, 0.0, 0.0)
    steps = [_move("b", SE2(-1.0, -0.9, 0.0), "out"), _move("b", A)]
    run = rig(
        Mission(steps=steps, holders={"b": "a.rear"}), {"a": A, "b": setup.lanes.body.docked(A, "rear")}
    )
    assert run.run().state is MissionState.COMPLETE, run.status.reason
    assert run.status.replans == 0


def test_nobody_leaves_its_port_for_a_place_that_stays_taken(
    rig: type[Rig], setup: CoordinationSetup
) -> None:
    A, docked = SE2(0.3, 0.0, 0.0), setup.lanes.body.docked
    starts = {"a": A, "b": docked(A, "rear"), "c": docked(A, "left")}
    run = rig(Mission(steps=[_move("b", A)], holders={"b": "a.rear", "c": "a.left"}), starts)
    assert run.run().state is MissionState.INCOMPLETE
    assert run.joints == {"b": "a.rear", "c": "a.left"}
    assert run.status.reason == "there: b finds no route: a stands on the end of its way"
