"""The program of a route into the open: what it commands, what it passes, and how it ends."""

from __future__ import annotations

from contextlib import nullcontext

import numpy as np
import pytest

from msrr_bullet.robot.route_program import RouteProgram
from msrr_bullet.robot.unit_programs import UnitPrograms, check_programs
from msrr_perception.tracking.seen_pose import SeenPose, SeenPoses
from msrr_scenes.errors import SceneError, UnknownNameError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import (
    Conviction,
    FailureReason,
    GlobalPose,
    MonitorState,
    Phase,
    Twist,
    WheelOdometry,
)
from msrr_scenes.messages.coordination import Authority, LegKind, RouteLeg
from msrr_scenes.specs.scene import Scene

S = 1_000_000_000
PERIOD_NS = S // 50
#: A turn to the left by 1 rad.
TURN = RouteLeg(LegKind.TURN, (0.0, 0.0, 0.0), (), (), 1.0, 0.1)


def _scene(**changes: object) -> Scene:
    return Scene.model_validate(
        {
            "name": "arena",
            "units": {"a": {"number": 0}, "b": {"number": 1}},
            "obstacles": {"post": {"shape": "cylinder", "radius_m": 0.06, "height_m": 0.2, "tag_id": 500}},
            "cameras": {"overhead": {}},
            "plan": [{"unit": "a", "to": "b.rear"}],
            **changes,
        }
    )


@pytest.fixture(scope="module")
def scene() -> Scene:
    return _scene()


def _see(programs: UnitPrograms, stamp_ns: int, **poses: SE2) -> None:
    seen = [
        SeenPose(GlobalPose(name, stamp_ns, X, 1e-6 * np.eye(3)), np.zeros((3, 3)))
        for name, X in poses.items()
    ]
    programs.overhead.see(SeenPoses(stamp_ns, tuple(seen)))


def _granted(programs: UnitPrograms) -> RouteProgram:
    program, guided = programs.along_route()
    guided.receive(Authority("a", 1, 1, 0, 600 * S, TURN.end, (TURN,), None, unlock=False))
    return program


def test_it_turns_as_its_route_does_once_it_has_been_seen(scene: Scene) -> None:
    programs = UnitPrograms(scene, "a")
    program = _granted(programs)
    action = program.step(PERIOD_NS)
    assert (action.twist, action.phase, program.estimates.arena) == (Twist(), Phase.ASSEMBLE, None)
    _see(programs, 2 * PERIOD_NS, a=SE2())
    action = program.step(2 * PERIOD_NS)
    assert program.estimates.arena is not None
    assert action.twist.w > 0.1
    assert action.twist.v == 0.0
    assert (action.stamp_ns, action.phase, action.reason[:5]) == (2 * PERIOD_NS, Phase.ASSEMBLE, "turn:")
    monitor = program.estimates.monitor
    assert monitor is not None
    assert (monitor.stamp_ns, monitor.state) == (2 * PERIOD_NS, MonitorState.FREE)


def test_only_what_its_collision_monitor_lets_pass_is_commanded(scene: Scene) -> None:
    """A post stands at the side of the unit, where its front corner would come."""
    programs = UnitPrograms(scene, "a")
    program, states = _granted(programs), []
    corner = scene.geometry("a").footprint.max(axis=0)
    _see(programs, 0, a=SE2(), post=SE2(0.5 * float(corner[0]), float(corner[1]) + 0.06 + 0.02))
    for k in range(1, 10):
        action = program.step(k * PERIOD_NS)
        monitor = program.estimates.monitor
        assert monitor is not None
        states.append(monitor.state)
        assert monitor.body == "post"
        assert (action.twist == Twist()) is (monitor.state is MonitorState.STOP)
    assert MonitorState.STOP in states


def test_one_that_is_not_seen_gives_up_and_stands(scene: Scene) -> None:
    programs = UnitPrograms(scene, "a")
    program, now_ns = _granted(programs), 0
    while program.phase is Phase.ASSEMBLE:
        now_ns += S // 5
        assert program.step(now_ns).twist == Twist()
        assert now_ns < 600 * S
    for later_ns in (now_ns, now_ns + S):
        belief = program.estimates.belief
        assert (belief.conviction, belief.setback) == (Conviction.GAVE_UP, FailureReason.NOT_LOCALISED)
        _see(programs, later_ns, a=SE2())  # too late
        action = program.step(later_ns + 1)
        assert (action.phase, action.twist, action.reason) == (Phase.FAILED, Twist(), belief.reason)


def test_one_that_faces_the_end_of_its_route_is_done_when_its_wheels_stand(scene: Scene) -> None:
    programs = UnitPrograms(scene, "a")
    program, angle = _granted(programs), 0.0
    for k in range(30):
        turns = k < 20
        angle += 0.05 if turns else 0.0
        program.receive(WheelOdometry("a", k * PERIOD_NS, -angle, angle))
        _see(programs, k * PERIOD_NS, a=SE2(0.0, 0.0, 1.0))
        if k > 0:  # the first reading tells no speed
            action = program.step(k * PERIOD_NS)
            assert action.attempt == 1
            assert action.phase is Phase.ASSEMBLE or not turns
    assert (action.phase, action.twist) == (Phase.DONE, Twist())
    assert program.estimates.belief.conviction is not Conviction.GAVE_UP


@pytest.mark.parametrize(("grade", "lag_s"), [("perfect", 0.0), ("rough", 0.4)])
def test_a_unit_stops_as_far_ahead_as_it_takes_to_react_and_to_brake(grade: str, lag_s: float) -> None:
    """Within a period of control, the delay of the link and the lag of the drive it drives on as it did."""
    scene = _scene(control={"rate_hz": 10.0}, link={"latency_ms": 70.0}, as_built={"grade": grade})
    _, guided = UnitPrograms(scene, "a").along_route()
    react_s = 0.1 + 0.07 + 1.0 / scene.limits.kappa_per_s + lag_s
    braking = 0.5 * 0.3**2 / (0.8 * scene.limits.a_max_mps2)
    assert guided.authority.stopping_distance(0.3) == pytest.approx(0.3 * react_s + braking)


def test_a_route_into_the_open_waits_for_no_sight_of_the_target_before(scene: Scene) -> None:
    programs = UnitPrograms(scene, "a")
    _see(programs, 0, a=SE2())
    programs.at_port(scene.docks[0])
    assert programs.overhead.estimate(1, None) is None
    program = _granted(programs)
    program.step(PERIOD_NS)
    assert program.estimates.arena is not None
    assert program.estimates.arena.target is None


@pytest.mark.parametrize("single", [False, True])
def test_programs_that_cannot_be_built_are_found_before_a_trial(single: bool) -> None:
    """Those of the routes for every unit, and those of the docks where there is another unit with a port."""
    alone = {"units": {"a": {"number": 0}}, "plan": [{"move": "a", "pose": {"x_m": 0.5}}]}
    changes = alone if single else {}
    check_programs(_scene(**changes))
    with pytest.raises(SceneError, match="drive by 'c1' or 'c2'"):
        check_programs(_scene(**changes, control={"assembly": {"name": "unheard_of"}}))
    docks = _scene(**changes, control={"docking": {"name": "unheard_of"}})
    with nullcontext() if single else pytest.raises(UnknownNameError, match="unheard_of"):
        check_programs(docks)
