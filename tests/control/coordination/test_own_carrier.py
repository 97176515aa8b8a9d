"""Moves of a unit to where the one stands that carries it: it leaves its port, then the other makes way."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
import pytest

from msrr_control.coordination.mission import Mission
from msrr_control.coordination.setup import CoordinationSetup
from msrr_control.tracks.route_params import RouteParams
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.unit_geometry import find_urdf, read_unit
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


@pytest.mark.parametrize("half_width", [0.35, 0.4])
def test_one_that_made_way_after_its_last_move_goes_back(half_width: float, rig: type[Rig]) -> None:
    """The mission was complete with the unit half a metre beside the end of its move."""
    lane = CoordinationSetup.of(
        read_unit(find_urdf("unit.urdf")), RouteParams(), (-2.0, 2.0, -half_width, half_width)
    )
    steps = [_move("a", SE2(), "first"), _move("b", SE2(1.4, 0.0, 0.0), "past")]
    run = rig(Mission(steps=steps), {"a": SE2(-0.8, 0.0, 0.0), "b": SE2(-1.6, 0.0, 0.0)}, setup=lane)
    assert run.run().state is MissionState.COMPLETE, run.status.reason
    assert run.units["a"].route == 3  # there, out of the way, and back
    for unit, X_WE in (("a", SE2()), ("b", SE2(1.4, 0.0, 0.0))):
        assert lane.tolerance.holds(X_WE.inverse() @ run.units[unit].X_WU), unit


def test_one_that_cannot_go_back_leaves_the_mission_incomplete(rig: type[Rig]) -> None:
    """Both ends of two moves cannot be had, for each is where the other one needs room."""
    steps = [_move("a", SE2(0.5, 0.0, 0.0), "first"), _move("b", SE2(0.78, 0.0, 0.0), "beside")]
    run = rig(Mission(steps=steps), {"a": SE2(-1.0, -0.5, 0.0), "b": SE2(-1.0, 0.5, 0.0)})
    assert run.run().state is MissionState.INCOMPLETE
    assert re.search("finds no route: [ab] stands", run.status.reason)
