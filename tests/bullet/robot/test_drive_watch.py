"""A unit notices by its own commands and encoders that its drive has seized."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from msrr_bullet.robot.drive_watch import SEIZED_S, DriveWatch
from msrr_scenes.geometry.unit_geometry import find_urdf, read_unit
from msrr_scenes.messages import Action, Conviction, FailureReason, Phase, Twist, WheelOdometry

PERIOD_NS = 20_000_000
FORWARDS, TURN = Twist(0.15, 0.0), Twist(0.0, 0.5)


def run(
    watch: DriveWatch,
    twist: Twist,
    time_s: float,
    rate_radps: float = 0.0,
    phase: Phase = Phase.ASSEMBLE,
    start_s: float = 0.0,
    gap: Callable[[float], float | None] = lambda time_s: None,
) -> list[Action]:
    """Command a twist for a time while the wheels turn at a rate; return what the watch lets through."""
    actions = []
    for k in range(round(1e9 * time_s / PERIOD_NS)):
        now_ns = round(1e9 * start_s) + k * PERIOD_NS
        angle = 40.0 + rate_radps * 1e-9 * now_ns  # it has driven before
        watch.read(WheelOdometry("a", now_ns, angle, angle))
        actions.append(watch.judge(Action(now_ns, phase, 1, twist, reason="leg 1"), gap(1e-9 * now_ns)))
    return actions


@pytest.fixture
def watch() -> DriveWatch:
    return DriveWatch(read_unit(find_urdf("unit.urdf")))


@pytest.mark.parametrize("twist", [FORWARDS, TURN, Twist(0.0, 0.06)])  # the last: the end of a turn
def test_wheels_that_stand_against_commands_end_the_way(watch: DriveWatch, twist: Twist) -> None:
    actions = run(watch, twist, SEIZED_S + 1.0)
    phases = [action.phase for action in actions]
    first = phases.index(Phase.FAILED)
    assert 1e-9 * first * PERIOD_NS == pytest.approx(SEIZED_S, abs=0.1)
    assert set(phases[first:]) == {Phase.FAILED}
    assert actions[-1].twist == Twist()
    assert "seized" in actions[-1].reason
    assert watch.belief is not None
    assert (watch.belief.conviction, watch.belief.setback) == (Conviction.GAVE_UP, FailureReason.SEIZED)


@pytest.mark.parametrize(
    ("twist", "rate_radps", "phase"),
    [
        (FORWARDS, 0.3, Phase.ASSEMBLE),  # slow, but it turns
        (Twist(), 0.0, Phase.ASSEMBLE),  # it waits for an authority
        (Twist(0.001, 0.0), 0.0, Phase.ASSEMBLE),  # too little for any drive
        (FORWARDS, 0.0, Phase.DOCK),  # it presses against a port
    ],
)
def test_a_healthy_unit_goes_on(watch: DriveWatch, twist: Twist, rate_radps: float, phase: Phase) -> None:
    assert {a.phase for a in run(watch, twist, 3.0 * SEIZED_S, rate_radps, phase)} == {phase}
    assert watch.belief is None


@pytest.mark.parametrize("phase", [Phase.DOCK, Phase.RETREAT])
def test_wheels_that_stand_away_from_the_port_end_it_if_the_unit_is_seen_to_stand(
    watch: DriveWatch, phase: Phase
) -> None:
    """Encoders that stand alone do not: the unit sees that it gets nearer."""
    run(watch, FORWARDS, 3.0 * SEIZED_S, phase=phase, gap=lambda time_s: 0.9 - 0.02 * time_s)
    assert watch.belief is None
    actions = run(watch, FORWARDS, SEIZED_S + 1.0, phase=phase, start_s=20.0, gap=lambda time_s: 0.5)
    assert actions[-1].phase is Phase.FAILED


@pytest.mark.parametrize("share", [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0), (-1.0, 1.0)])
def test_one_wheel_that_turns_is_enough(watch: DriveWatch, share: tuple[float, float]) -> None:
    """On the spot, or about the other wheel."""
    for k in range(round(1e9 * 2.0 * SEIZED_S / PERIOD_NS)):
        angle = 0.006 * k
        watch.read(WheelOdometry("a", k * PERIOD_NS, share[0] * angle, share[1] * angle))
        assert watch.judge(Action(k * PERIOD_NS, Phase.ASSEMBLE, 1, TURN), None).phase is Phase.ASSEMBLE


@pytest.mark.parametrize(("rim_mps", "seized"), [(0.0019, False), (0.0021, True)])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_turn_asks_for_motion_by_the_speed_of_its_rims(rim_mps: float, seized: bool, sign: float) -> None:
    """On the spot, and about one wheel."""
    unit = read_unit(find_urdf("unit.urdf"))
    w = sign * rim_mps / (0.5 * unit.track)
    for twist in (Twist(0.0, w), Twist(0.5 * rim_mps, 0.5 * w)):
        assert (run(DriveWatch(unit), twist, SEIZED_S + 1.0)[-1].phase is Phase.FAILED) is seized


@pytest.mark.parametrize("speed_mps", [0.003, 0.006])
def test_a_unit_that_is_held_and_creeps_to_and_fro_has_not_seized(
    watch: DriveWatch, speed_mps: float
) -> None:
    """In front of an obstacle the law asks for some millimetres per second, forwards and backwards."""
    now_s = 0.0
    for k in range(40):
        twist = Twist(speed_mps if k % 2 else -speed_mps, 0.0)
        assert {a.phase for a in run(watch, twist, 0.5, start_s=now_s)} == {Phase.ASSEMBLE}
        now_s += 0.5
    assert watch.belief is None


def test_time_without_sensors_does_not_count(watch: DriveWatch) -> None:
    run(watch, FORWARDS, 0.6 * SEIZED_S)
    run(watch, Twist(), 0.1, start_s=0.6 * SEIZED_S)  # at its end; then the sensors are off
    actions = run(watch, FORWARDS, 0.3 * SEIZED_S, start_s=100.0)
    assert Phase.FAILED not in {action.phase for action in actions}
    assert run(watch, FORWARDS, 0.2 * SEIZED_S, start_s=110.0)[-1].phase is Phase.FAILED


def test_a_time_without_readings_is_none_of_standing(watch: DriveWatch) -> None:
    """Between two routes the sensors of a unit are off; at the next one it is commanded at once."""
    run(watch, Twist(), 0.2)
    watch.restart()
    watch.judge(Action(30_000_000_000, Phase.ASSEMBLE, 1, FORWARDS, reason="leg 1"), None)
    actions = run(watch, FORWARDS, SEIZED_S - 0.5, start_s=30.02)
    assert {action.phase for action in actions} == {Phase.ASSEMBLE}
    assert run(watch, FORWARDS, 1.0, start_s=30.02 + SEIZED_S - 0.5)[-1].phase is Phase.FAILED


def test_a_new_route_begins_anew_although_no_reading_has_arrived_since(watch: DriveWatch) -> None:
    """The decision comes first; what the wheels did not do for the route before told it to give up."""
    run(watch, FORWARDS, SEIZED_S)
    end_ns = round(1e9 * SEIZED_S)
    for k in range(2):  # the last of these is more than it waits, and nothing is decided on it any more
        watch.read(WheelOdometry("a", end_ns + k * PERIOD_NS, 40.0, 40.0))
    watch.restart()
    assert watch.judge(Action(end_ns, Phase.ASSEMBLE, 1, FORWARDS), None).phase is Phase.ASSEMBLE
    assert watch.belief is None
