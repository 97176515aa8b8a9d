"""The drive in front of a port by which a unit calibrates itself: its way, its turns, and what ends it."""

import math

import numpy as np
import pytest

from msrr_control.docking.controller import build_controller
from msrr_control.sequence.state_machine import PhaseMachine
from msrr_control.sequence.tuning import CalibrationDriveSpec, PhaseTuning
from msrr_scenes.messages import Action, Phase

SPEC = CalibrationDriveSpec()


def _to_calibrate(robot, spec: CalibrationDriveSpec = SPEC) -> None:
    """Let a toy robot begin its drive."""
    law = build_controller(robot.controller, robot.facts)
    tuning = PhaseTuning(calibration=spec)
    robot.machine = PhaseMachine(robot.spec, robot.facts, law, tuning=tuning, calibrate=True)
    assert robot.step().phase is Phase.CALIBRATE


def _drive(robot) -> list[tuple[float, float, Action]]:
    """Let it drive, and return gap, heading and action of every instant."""
    driven = []
    while robot.machine.phase is Phase.CALIBRATE:
        assert robot.now_ns < 1e9 * (SPEC.time_s + 1.0)
        driven.append((robot.gap, robot.X_DU.yaw, robot.step()))
    return driven[:-1]


def test_it_comes_near_turns_to_each_heading_backs_out_and_then_docks(toy) -> None:
    robot = toy()
    _to_calibrate(robot)
    driven = _drive(robot)
    gaps, yaws, v, w = np.array([(gap, yaw, a.twist.v, a.twist.w) for gap, yaw, a in driven]).T
    turns = v == 0.0
    assert np.all(gaps[turns] == pytest.approx(SPEC.near_m, abs=0.02))
    assert np.abs(w[turns]).max() == SPEC.turn_radps
    # The headings are reached, one after another, before the unit turns the other way.
    signs = np.sign(w[turns])
    ends = [*(np.flatnonzero(np.diff(signs)) + 1), len(signs)]
    reached = np.degrees(yaws[turns][np.array(ends) - 1])
    assert reached == pytest.approx(SPEC.headings_deg, abs=SPEC.heading_tolerance_deg + 1.0)
    first, last = np.flatnonzero(turns)[[0, -1]]
    assert np.all(v[1:first] > 0.0)
    assert np.all(v[last + 1 :] < 0.0)
    assert gaps[-1] == pytest.approx(SPEC.far_m - SPEC.arrived_m, abs=0.01)
    robot.run()
    assert robot.phases().count(Phase.CALIBRATE) == 1
    assert robot.machine.phase is Phase.DONE


def test_towards_a_port_that_it_has_lost_it_does_not_drive(toy) -> None:
    robot = toy()
    _to_calibrate(robot)
    for _ in range(20):
        robot.step()
    robot.blind, lost_ns = True, robot.now_ns
    driven = _drive(robot)
    assert 1e-9 * (robot.now_ns - lost_ns) == pytest.approx(robot.spec.lost_time_s, abs=0.05)
    assert all(action.twist.v > 0.0 for _, _, action in driven)
    assert robot.machine.phase is Phase.HAND_OVER


def test_while_it_turns_it_may_lose_the_port(toy) -> None:
    robot = toy()
    _to_calibrate(robot)
    while robot.step().twist.v != 0.0:
        pass
    robot.blind = True
    yaws = [math.degrees(yaw) for _, yaw, _ in _drive(robot)]
    assert max(yaws) > 20.0
    assert min(yaws) < -20.0


def test_one_that_something_holds_gives_up_in_time(toy) -> None:
    robot = toy()
    _to_calibrate(robot, CalibrationDriveSpec(time_s=1.0))
    began, X_DU = robot.now_ns, robot.X_DU
    while robot.machine.phase is Phase.CALIBRATE:
        robot.X_DU = X_DU
        robot.step()
    assert 1e-9 * (robot.now_ns - began) == pytest.approx(1.0, abs=0.05)
