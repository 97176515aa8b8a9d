"""The mouth and the funnel of the plant without contact, tick by tick."""

import math
from dataclasses import replace

import numpy as np
import pytest

from msrr_bullet.plant.kinematic_plant import KinematicPlant
from msrr_bullet.plant.kinematic_port import CaptureRange, face_half_width
from msrr_scenes.as_built import as_designed
from msrr_scenes.geometry.pin_and_hole import PinAndHole
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.solid import Solid
from msrr_scenes.messages import Twist
from msrr_scenes.random_streams import stream
from tests.bullet.conftest import before_port, bench, two_units

#: Where the pins are at the mouth of the shipped unit: gap of the faces [m].
MOUTH_M = 0.018


def _move(before: SE2, after: SE2) -> float:
    return math.hypot(after.x - before.x, after.y - before.y)


def test_the_face_of_the_shipped_unit_is_16_cm_wide() -> None:
    geometry = two_units().geometry("b")
    assert [face_half_width(geometry, port) for port in ("rear", "left", "right")] == pytest.approx(
        [0.08] * 3
    )


@pytest.mark.parametrize(
    "X_DP",
    [
        SE2(0.8, 0.0, 0.0),  # behind the unit docked to, on the axis of the port
        SE2(0.5, 0.005, math.pi),  # there, and turned to it
        SE2(0.1, 0.3, 0.0),  # beside it
        SE2(0.0, 1.0, 0.1),
        SE2(-0.01, 0.3, 0.0),  # in the plane of the mouth, beside the port
        SE2(-0.3, 0.0, 0.0),  # before it
        SE2(-0.3, 0.9, -1.0),
    ],
)
def test_a_unit_at_rest_stays_where_it_is(X_DP: SE2) -> None:
    with bench("unicycle", X_DP) as b:
        start = b.plant.pose("a")
        b.drive(0.0, 0.1)
        assert _move(start, b.plant.pose("a")) < 1e-12
        assert abs(b.plant.pose("a").yaw - start.yaw) < 1e-12
        assert not b.plant.pins_touch("a")
        assert b.plant.switches("a") == (False, False)


def test_nothing_moves_farther_in_a_tick_than_wheels_and_funnel_make_it() -> None:
    """60 units driven about from anywhere: the funnel draws in by at most 0.64 m sideways per m of depth."""
    rng = stream(3, "test/anywhere")
    for _ in range(60):
        X_DP = SE2(*rng.uniform((-0.3, -0.4, -math.pi), (0.5, 0.4, math.pi)))
        with bench("unicycle", X_DP) as b:
            for v, w in rng.uniform((-0.4, -1.5), (0.4, 1.5), (3, 2)):
                b.plant.command("a", Twist(v, w))
                for _ in range(40):
                    before = b.plant.pose("a")
                    b.plant.step()
                    # 0.4 m/s, and 1.5 rad/s of a port 0.1 m ahead of the axle, for a tick.
                    assert _move(before, b.plant.pose("a")) < 1.5 * (0.4 + 0.15) / 240.0


@pytest.mark.parametrize(("beside_m", "stopped"), [(0.02, True), (0.07, True), (0.09, False), (0.3, False)])
def test_the_mouth_is_as_wide_as_the_face(beside_m: float, stopped: bool) -> None:
    with bench("unicycle", SE2(-0.05, beside_m, 0.0)) as b:
        b.drive(0.1, 1.5)
        assert b.plant.pins_touch("a") is stopped
        assert (b.gap == pytest.approx(MOUTH_M, abs=1e-6)) if stopped else (b.gap < 0.0)


@pytest.mark.parametrize("yaw_deg", [0.0, 30.0, -60.0])
def test_the_tips_stop_at_the_mouth_at_any_angle(yaw_deg: float) -> None:
    with bench("unicycle", SE2(-0.03, 0.02, math.radians(yaw_deg))) as b:
        for _ in range(480):
            before = b.plant.pose("a")
            b.drive(0.1, b.dt)
            assert _move(before, b.plant.pose("a")) < 1.01 * 0.1 / 240.0
        assert b.plant.pins_touch("a")
        assert (b.X_DP() @ SE2(MOUTH_M)).x == pytest.approx(0.0, abs=1e-6)


def test_the_mouth_is_no_matter_to_pins_that_point_away_from_it() -> None:
    """Backing through the plane of the mouth: there the bodies overlap, and the judge has seen it."""
    with bench("unicycle", SE2(0.01, 0.03, math.pi)) as b:
        b.drive(-0.1, 1.0)
        assert b.gap < -0.08
        assert not b.plant.pins_touch("a")


def test_who_comes_out_through_the_port_is_not_held() -> None:
    """From inside the other unit, where only the judge has a say, to before it."""
    with bench("unicycle", SE2(0.05, 0.03, 0.0)) as b:
        b.drive(-0.1, 1.5)
        assert b.gap > 0.05
        assert not b.plant.pins_touch("a")
        b.drive(0.1, 2.5)  # and the same way again, from outside now
        assert b.gap == pytest.approx(MOUTH_M, abs=1e-6)


def test_pins_in_the_funnel_at_first_are_held_there() -> None:
    with bench("unicycle", SE2(-0.009, 0.004, 0.0)) as b:
        b.drive(0.05, 1.0)
        assert b.plant.switches("a") == (True, True)
        assert b.gap == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("mouth", [0.0005, 0.002, 0.015, 0.03])
def test_pins_enter_mouths_of_any_width_before_they_reach_their_edges(mouth: float) -> None:
    capture = CaptureRange.of(PinAndHole(pin_length=MOUTH_M, mouth=mouth, play=0.0004, pins=(0.04, -0.04)))
    assert 0.8 * mouth < capture.lateral_m < mouth


@pytest.mark.parametrize(("lateral_mm", "yaw_deg"), [(12.0, 0.0), (-12.0, 7.0), (2.0, -7.5)])
def test_the_play_narrows_with_depth(lateral_mm: float, yaw_deg: float) -> None:
    """In a straight line from the mouth to the bottom: 13 to 1.5 mm, and 8 deg to none."""
    capture = CaptureRange(0.013, math.radians(8.0), 0.0015)
    deepest, rooms = math.inf, []
    with bench("unicycle", SE2(-0.019, lateral_mm / 1e3, math.radians(yaw_deg))) as b:
        b.plant.command("a", Twist(0.05, 0.0))
        for _ in range(240):
            b.plant.step()
            at = b.X_DP()
            left = min(-at.x / MOUTH_M, 1.0)
            room = capture.play_m + left * (capture.lateral_m - capture.play_m)
            assert abs(at.y) <= room + 1e-9
            assert abs(at.yaw) <= left * capture.yaw_rad + 1e-9
            deepest = min(deepest, -at.x)
            rooms.append(room - abs(at.y))
    assert deepest == pytest.approx(0.0, abs=1e-9)
    if abs(lateral_mm) > 10.0:
        assert np.min(rooms) == pytest.approx(0.0, abs=1e-9)  # the wall of the funnel guides it
    assert abs(at.y) <= capture.play_m + 1e-9


def test_the_funnel_narrows_from_mouth_to_seat() -> None:
    """Half way down there is half the way from the mouth's room to the seat's."""
    scene = two_units()
    plant = KinematicPlant(scene, before_port(scene, SE2(-0.019, 0.012, 0.0)))
    plant.begin_dock(scene.plan[0])
    plant.command("a", Twist(0.05, 0.0))
    X_WD = plant.pose("b") @ scene.geometry("b").dock_frame("rear")
    while -(at := X_WD.inverse() @ plant.pose("a") @ scene.geometry("a").port("front")).x > 0.5 * MOUTH_M:
        plant.step()
        assert plant.tick < 240
    assert at.y == pytest.approx(0.0015 - at.x / MOUTH_M * (0.013 - 0.0015), abs=1e-9)
    assert at.y == pytest.approx(0.00725, abs=2e-4)


def test_pins_touch_where_the_switches_close_as_they_were_built() -> None:
    """Down the middle of the funnel nothing touches before the switches, whose travel is not as designed."""
    scene = two_units()
    for error_m in (-0.001, 0.001):
        drawn = as_designed(scene)
        units = {**drawn.units, "b": replace(drawn.units["b"], switch_travel_error_m=error_m)}
        placement = before_port(scene, SE2(-0.019, 0.0, 0.0))
        plant = KinematicPlant(scene, placement, built=replace(drawn, units=units))
        plant.begin_dock(scene.plan[0])
        plant.command("a", Twist(0.05, 0.0))
        closed = set()
        for _ in range(240):
            plant.step()
            closed.add(all(plant.switches("a")))
            assert plant.pins_touch("a") is all(plant.switches("a"))
        assert closed == {False, True}


@pytest.mark.parametrize("radius", [0.11, 0.25])
def test_a_port_may_be_on_the_rim_of_a_disc(radius: float) -> None:
    """Of that, only a point is in the plane of the face; the pins need more room than that, and have it."""
    body = Solid("base", "cylinder", SE3(p=np.array([0.0, 0.0, 0.1])), (radius, 0.1))
    geometry = two_units().geometry("b")
    disc = replace(geometry, solids=(body,))
    at_rim = {**geometry.frames, "port_rear": SE3.from_se2(SE2(-radius, 0.0, math.pi))}
    assert face_half_width(replace(disc, frames=at_rim), "rear") < 0.03
