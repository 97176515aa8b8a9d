"""A unit that a base station leads: what it does with the routes that it is granted."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from msrr_bullet.robot.guided_unit import GuidedUnit
from msrr_bullet.robot.interface import Estimates
from msrr_perception.tracking.seen_pose import SeenPose, SeenPoses
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import (
    OVERHEAD,
    Action,
    Exposure,
    FailureReason,
    GlobalPose,
    LockFeedback,
    LockPosition,
    Phase,
    PoseMeasurement,
    SeatSwitches,
    Twist,
    WheelOdometry,
)
from msrr_scenes.messages.coordination import Authority, Intent, LegKind, RouteLeg, UnitMode, UnitReport
from msrr_scenes.specs.scene import Scene
from tests.bullet.robot.conftest import locked_pair


def test_a_route_without_legs_ends_where_the_unit_stands() -> None:
    """A base station grants such a route to a unit that stands in its place, and waits for its report."""
    scene = Scene.model_validate(
        {"name": "one", "units": {"a": {"number": 0}}, "cameras": {"overhead": {}}, "shape": {"line": 1}}
    )
    unit = GuidedUnit(scene, "a")
    assert (unit.estimates, unit.dock_step) == (Estimates(), None)
    report = unit.report(0)
    assert (report.seq, report.route, report.progress, report.mode) == (0, 0, 0.0, UnitMode.STANDING)
    unit.authorise(Authority("a", 1, 1, 0, 3_000_000_000, 0.0, (), None, False))
    assert unit.active
    assert unit.step(20_000_000).twist == Twist()
    report = unit.report(20_000_000)
    assert (report.route, report.mode, report.progress) == (1, UnitMode.STANDING, 0.0)
    assert not unit.active


def _seen(name: str, stamp_ns: int, x: float) -> SeenPose:
    pose = GlobalPose(name, stamp_ns, SE2(x, 0.0, 0.0), 1e-6 * np.eye(3))
    return SeenPose(pose, np.zeros((3, 3)))


def test_a_new_route_begins_with_what_was_seen_before() -> None:
    """What stands is looked at once a second or two; until then its collision monitor let everything pass."""
    post = {"shape": "cylinder", "radius_m": 0.08, "height_m": 0.2, "tag_id": 500, "pose": {"x_m": 0.4}}
    scene = Scene.model_validate(
        {
            "name": "one",
            "units": {"a": {"number": 0}},
            "obstacles": {"post": post},
            "cameras": {"overhead": {}},
            "shape": {"line": 1},
        }
    )
    unit = GuidedUnit(scene, "a")
    assert not unit.active, "it listens on standby, too"
    unit.see(SeenPoses(100_000_000, (_seen("a", 100_000_000, 0.0), _seen("post", 100_000_000, 0.4))))
    turn = RouteLeg(LegKind.TURN, (0.0, 0.0, 0.0), (), (), 1.0, 0.1)
    path = RouteLeg(LegKind.PATH, (0.0, 0.0, 0.0), (0.0,), (0.1,), 0.0, 0.1)
    for route, leg in ((1, turn), (2, path)):
        unit.authorise(Authority("a", route, route, 0, 10_000_000_000, leg.end, (leg,), None, False))
        now_ns = 200_000_000 * route
        unit.step(now_ns)
        assert unit.route == route
        assert unit.estimates.arena is not None
        assert [o.name for o in unit.estimates.arena.obstacles] == ["post"]
        assert (unit.estimates.path is not None) is (leg is path), "of a turn there is none"


@pytest.mark.parametrize("turn", [1.0, -1.0])
def test_a_route_is_reported_from_its_first_command_to_its_end(turn: float) -> None:
    scene = Scene.model_validate(
        {"name": "one", "units": {"a": {"number": 0}}, "cameras": {"overhead": {}}, "shape": {"line": 1}}
    )
    unit, leg = GuidedUnit(scene, "a"), RouteLeg(LegKind.TURN, (0.0, 0.0, 0.0), (), (), turn, 0.1)
    assert not unit.uses_camera(OVERHEAD)
    unit.authorise(Authority("a", 1, 1, 0, 60_000_000_000, leg.end, (leg,), None, False))
    geometry, yaw = scene.geometry("a"), 0.0
    told = []
    for now_ns in range(20_000_000, 4_000_000_000, 20_000_000):
        way = 0.5 * geometry.track / geometry.wheel_radius * yaw
        unit.receive(WheelOdometry("a", now_ns, -way, way))
        if now_ns % 100_000_000 == 0:
            pose = GlobalPose("a", now_ns, SE2(0.0, 0.0, yaw), 1e-6 * np.eye(3))
            unit.see(SeenPoses(now_ns, (SeenPose(pose, np.zeros((3, 3))),)))
        w = unit.step(now_ns).twist.w
        yaw += 0.02 * w
        report = unit.report(now_ns)
        assert (report.seq, report.route, report.docked_to) == (1, 1, None)
        assert report.progress == pytest.approx(0.1 * abs(yaw), abs=0.005)
        assert (unit.estimates.assembly is not None) is (unit.active and unit.estimates.arena is not None)
        assert (report.mode is UnitMode.DRIVING) is (abs(w) >= 0.03)
        told.append((report.mode, unit.active))
    changes = [now for before, now in pairwise(told) if now != before]
    assert told[0] == (UnitMode.STANDING, True), "it has not been seen yet"
    assert changes[0] == (UnitMode.DRIVING, True)
    assert {mode for mode, _ in changes[1:]} == {UnitMode.STANDING}
    assert changes[-1] == (UnitMode.STANDING, False)
    assert report.progress == leg.end
    assert yaw == pytest.approx(turn, abs=0.02)


@pytest.mark.parametrize("share", [-1.0, 0.5, 1.0])
def test_a_locked_unit_opens_its_lock_only_for_a_route_of_which_the_way_out_is_free(share: float) -> None:
    scene = locked_pair()
    unit, leg = GuidedUnit(scene, "b", "a.rear"), RouteLeg(LegKind.BACK, (0.0, 0.0, 0.0), (), (), 0.0, 0.3)
    limit = share * leg.end
    unit.authorise(Authority("b", 4, 1, 0, 60_000_000_000, limit, (leg,), None, True))
    leaves = share == 1.0
    assert unit.active is leaves
    action, report = unit.step(20_000_000), unit.report(20_000_000)
    assert action.lock is not leaves
    assert action.phase is (Phase.RETREAT if leaves else Phase.DONE)
    assert unit.leaving is leaves
    assert (report.mode, report.docked_to) == (UnitMode.DOCKED, "a.rear"), "it is out when it is far enough"
    assert report.route == (4 if leaves else 0)
    older = Authority("b", 5, 1, 0, 60_000_000_000, leg.end, (leg,), None, True)
    unit.authorise(older)
    unit.step(40_000_000)
    assert unit.report(40_000_000).route == (4 if leaves else 0), "of the same number: it is not newer"


PERIOD_NS = 20_000_000
TIGHT = 1e-8 * np.eye(3)
NOISE = np.array([0.002, 0.002, 0.002])


class Rig:
    """Unit b behind the rear port of unit a, which stands: its software, ideal wheels and simple sensors.

    Attributes:
        unit: The software of b.
        X_DU: True pose of b in the dock frame of a.rear.
        seized: Whether the wheels do not follow their commands.
        unseen: Whether the base station does not see b.
        blind: Whether the camera of b sees nothing.
        jammed: Whether the lock stays closed.
        reports: What b has told after each instant.
    """

    def __init__(self, gap: float, docked_to: str | None = None) -> None:
        self.scene = locked_pair(perception="parametric")
        self.unit = GuidedUnit(self.scene, "b", docked_to)
        geometry = self.scene.geometry("b")
        self._offset, self._track = geometry.control_offset("front"), geometry.track
        self._radius = geometry.wheel_radius
        self._X_WD = self.scene.geometry("a").dock_frame("rear")
        self.X_DU = SE2(-gap - self._offset, 0.0, 0.0)
        self.seized = self.unseen = self.blind = self.jammed = False
        self._rng = np.random.default_rng(5)
        self.now_ns, self._seq, self._angles = 0, 0, np.zeros(2)
        self.action = Action(0, Phase.DONE, 1, lock=docked_to is not None)
        self.reports: list[UnitReport] = []

    @property
    def gap(self) -> float:
        return -self.X_DU.x - self._offset

    @property
    def report(self) -> UnitReport:
        return self.reports[-1]

    def leg(self, kind: LegKind, begin: float, end: float) -> RouteLeg:
        """Return a straight leg along the docking axis from where b stands, between two arc lengths."""
        ahead = self._offset if kind is LegKind.DOCK else -begin
        X = self._X_WD @ self.X_DU @ SE2(ahead, 0.0, 0.0)
        pieces = ((0.0,), (end - begin,)) if kind is LegKind.DOCK else ((), ())
        return RouteLeg(kind, (X.x, X.y, X.yaw), *pieces, 0.0, end)

    def grant(
        self,
        route: int,
        *legs: RouteLeg,
        share: float = 1.0,
        to: str | None = None,
        ahead: float | None = None,
    ) -> None:
        """Grant a route; ``ahead`` is where on the docking axis unit a says that it would still come."""
        self._seq += 1
        limit = share * legs[-1].end if legs else 0.0
        unlock = bool(legs) and legs[0].kind is LegKind.BACK
        X = None if ahead is None else self._X_WD @ SE2(-ahead, 0.0, 0.0)
        intents = () if X is None else (Intent("a", self.now_ns, ((X.x, X.y, X.yaw),)),)
        authority = Authority("b", route, self._seq, 0, 10**12, limit, legs, to, unlock, intents=intents)
        self.unit.authorise(authority)

    def step(self) -> Action:
        """Let an instant go by: what is sensed arrives, b decides, and its wheels do as told."""
        self.now_ns += PERIOD_NS
        now, k = self.now_ns, self.now_ns // PERIOD_NS
        self.unit.receive(WheelOdometry("b", now, *self._angles.tolist()))
        if k % 5 == 0 and not self.unseen:
            poses = {"a": SE2(), "b": self._X_WD @ self.X_DU}
            given = (SeenPose(GlobalPose(n, now, X, TIGHT), np.zeros((3, 3))) for n, X in poses.items())
            self.unit.see(SeenPoses(now, tuple(given)))
        if k % 2 == 0 and not self.blind and self.unit.uses_camera("b/onboard"):
            exposure = Exposure("b/onboard", k, now)
            seen = SE2(*(self.X_DU.as_array() + self._rng.normal(0.0, NOISE)))
            self.unit.receive(PoseMeasurement(exposure, seen, np.diag(NOISE**2), (None, None)))
        closed = self.gap < 1e-3
        position = LockPosition.CLOSED if self.action.lock or self.jammed else LockPosition.OPEN
        self.unit.receive(SeatSwitches("b", now, closed, closed))
        self.unit.receive(LockFeedback("b", now, position))
        self.action = self.unit.step(now)
        self.reports.append(self.unit.report(now))
        if not (self.seized or self.jammed or self.action.lock):
            v, w, dt = self.action.twist.v, self.action.twist.w, 1e-9 * PERIOD_NS
            turn = 0.5 * self._track * w
            self._angles += np.array([v - turn, v + turn]) * dt / self._radius
            X = self.X_DU @ SE2.exp(v * dt, 0.0, w * dt)
            self.X_DU = SE2(min(X.x, -self._offset), X.y, X.yaw)
        return self.action

    def run(self, limit_s: float = 30.0) -> None:
        """Let b go on until it has nothing to do."""
        end_ns = self.now_ns + round(1e9 * limit_s)
        self.step()
        while self.unit.active:
            assert self.now_ns < end_ns, self.action
            self.step()
        self.step()


def _never_falls(reports: list[UnitReport]) -> bool:
    return all(one.progress <= two.progress for one, two in pairwise(reports))


def test_a_unit_docks_and_leaves_its_port_and_reports_the_way() -> None:
    """Into the port, out of it and on backwards in the open, and once more into it."""
    rig = Rig(0.4)
    for route in (1, 3):
        way = rig.gap
        rig.grant(route, rig.leg(LegKind.DOCK, 0.0, way), to="a.rear")
        begun, shown = len(rig.reports), []
        rig.step()
        while rig.unit.active:
            rig.step()
            assert not rig.unit.uses_camera(OVERHEAD), "the base station reads its pictures"
            far = rig.action.phase is Phase.ASSEMBLE
            assert rig.unit.uses_camera("b/onboard") is not far
            estimates = rig.unit.estimates
            shown.append((estimates.los is not None, estimates.monitor is not None))
            assert rig.report.progress <= way
            if estimates.pose is not None:
                assert rig.report.progress == pytest.approx(way - rig.gap, abs=0.01)
        reports = rig.reports[begun:]
        assert {report.route for report in reports} == {route}
        assert (True, True) in shown, "it shows its line of sight and its monitor"
        assert _never_falls(reports)
        assert (rig.report.mode, rig.report.docked_to) == (UnitMode.DOCKED, "a.rear")
        assert rig.report.progress == way
        assert reports[0].progress < 0.01
        half = next(report for report in reports if report.progress > 0.5 * way)
        assert (half.mode, half.docked_to) == (UnitMode.DOCKING, None)
        assert half.progress < 0.55 * way
        assert rig.unit.estimates.assembly is None
        if route == 3:
            return

        back, reverse = rig.leg(LegKind.BACK, 0.0, 0.3), rig.leg(LegKind.REVERSE, 0.3, 0.5)
        rig.grant(2, back, reverse)
        out = len(rig.reports)
        rig.step()
        assert rig.unit.leaving
        while rig.unit.leaving:
            assert rig.report.progress == pytest.approx(max(rig.gap, 0.0), abs=0.01)
            assert rig.report.progress <= 0.3, "the rest is not covered before it is begun"
            assert rig.unit.active
            rig.step()
        assert rig.gap == pytest.approx(0.3, abs=0.02)
        assert rig.report.progress >= 0.3
        assert (rig.report.docked_to, rig.unit.dock_step, rig.unit.estimates.pose) == (None, None, None)
        assert not rig.action.lock
        modes, intends = {UnitMode.STANDING}, False
        while rig.unit.active:
            rig.step()
            modes.add(rig.report.mode)
            slow = abs(rig.action.twist.v) < 0.01 and abs(rig.action.twist.w) < 0.03
            assert rig.report.mode is (UnitMode.STANDING if slow else UnitMode.DRIVING)
            intends |= bool(rig.report.stopping)
        assert intends, "who drives tells where it would still come"
        assert rig.report.stopping == ()
        assert modes == {UnitMode.STANDING, UnitMode.DRIVING}
        assert _never_falls(rig.reports[out:])
        assert rig.report.progress == 0.5
        assert rig.gap == pytest.approx(0.5, abs=0.02)


def test_a_unit_that_only_leaves_its_port_is_on_standby_then() -> None:
    """One that begins docked has no program yet that has docked it. Its next route begins when it is out."""
    rig = Rig(0.0, "a.rear")
    assert rig.step().lock
    rig.grant(1, rig.leg(LegKind.BACK, 0.0, 0.2))
    rig.step()
    rig.grant(2, rig.leg(LegKind.REVERSE, 0.0, 0.1))
    while rig.unit.leaving:
        assert rig.report.route == 1
        rig.step()
    assert (rig.reports[-2].progress, rig.action.reason) == (0.2, "on standby")
    assert rig.gap == pytest.approx(0.2, abs=0.02)
    assert (rig.unit.dock_step, rig.unit.estimates.pose, rig.unit.docked_to) == (None, None, None)
    rig.run()
    assert (rig.report.route, rig.report.mode) == (2, UnitMode.STANDING)


def test_a_unit_whose_lock_does_not_open_fails_in_its_port() -> None:
    rig = Rig(0.0, "a.rear")
    rig.jammed = True
    rig.grant(1, rig.leg(LegKind.BACK, 0.0, 0.2))
    rig.run()
    assert (rig.report.mode, rig.report.docked_to) == (UnitMode.FAILED, "a.rear")
    assert rig.report.progress < 0.01


def test_a_unit_keeps_out_of_where_one_that_goes_first_would_still_come() -> None:
    """From the first instant of a route on, from when it is told, and from where it is out of a port."""
    for told_s in (0.0, 1.0):
        rig = Rig(0.4)
        for _ in range(10):
            rig.step()
        reverse, now_s = rig.leg(LegKind.REVERSE, 0.0, 0.5), 0.0
        rig.grant(1, reverse)
        while now_s < told_s:
            now_s += 1e-9 * PERIOD_NS
            rig.step()
        assert (rig.action.twist.v < 0.0) is (told_s > 0.0)
        rig.grant(1, reverse, ahead=rig.gap + 0.32)
        assert {rig.step().twist for _ in range(40)} == {Twist()}

    rig = Rig(0.0, "a.rear")
    legs = rig.leg(LegKind.BACK, 0.0, 0.3), rig.leg(LegKind.REVERSE, 0.3, 0.6)
    rig.grant(1, *legs)
    rig.step()
    while rig.unit.leaving:
        rig.grant(1, *legs, ahead=rig.gap + 0.32 if rig.action.phase is Phase.DONE else None)
        rig.step()
    assert {rig.action.twist, *(rig.step().twist for _ in range(40))} == {Twist()}


def test_a_unit_drives_as_far_as_the_newest_authority_of_its_route_lets_it() -> None:
    rig = Rig(0.4)
    leg = rig.leg(LegKind.REVERSE, 0.0, 0.4)
    rig.grant(1, leg, share=0.5)
    for share in (0.5, 1.0):
        for _ in range(250):
            rig.step()
        assert rig.gap == pytest.approx(0.4 + 0.4 * share, abs=0.02)
        assert rig.unit.active is (share < 1.0)
        rig.grant(1, leg)

    rig = Rig(0.1)
    leg = rig.leg(LegKind.DOCK, 0.0, 0.1)
    rig.grant(1, leg, share=0.0, to="a.rear")
    for _ in range(100):
        assert rig.step().twist == Twist()
    rig.grant(1, leg, to="a.rear")
    rig.run()
    assert rig.report.docked_to == "a.rear"


def test_a_unit_that_is_to_stay_where_it_stands_has_no_dock_any_more() -> None:
    rig = Rig(0.4)
    rig.grant(1, rig.leg(LegKind.DOCK, 0.0, 0.4), to="a.rear")
    for _ in range(100):
        rig.step()
    assert rig.unit.dock_step is not None
    rig.grant(2)
    assert rig.step().twist == Twist()
    assert (rig.unit.dock_step, rig.unit.estimates.pose, rig.report.mode) == (None, None, UnitMode.STANDING)


def test_a_route_that_may_not_be_driven_is_not_begun() -> None:
    rig = Rig(0.4)
    rig.grant(1, rig.leg(LegKind.REVERSE, 0.0, 0.2), share=-1.0)
    assert not rig.unit.active
    rig.step()
    assert (rig.report.route, rig.action.reason) == (0, "on standby")


def test_a_unit_whose_wheels_stand_gives_up_and_stays_where_it_is() -> None:
    rig = Rig(0.4)
    rig.seized = True
    rig.grant(1, rig.leg(LegKind.REVERSE, 0.0, 0.3))
    rig.run()
    assert rig.unit.estimates.belief.setback is FailureReason.SEIZED
    assert (rig.report.mode, rig.action.twist, rig.action.phase) == (UnitMode.FAILED, Twist(), Phase.FAILED)
    assert "the drive has seized" in rig.report.reason
    rig.grant(2, rig.leg(LegKind.REVERSE, 0.0, 0.2))
    assert not rig.unit.active, "no route makes its wheels turn"


def test_a_unit_that_nobody_sees_is_lost_until_it_is_seen_on_another_route() -> None:
    rig = Rig(0.4)
    rig.unseen = True
    rig.grant(1, rig.leg(LegKind.REVERSE, 0.0, 0.2))
    rig.run()
    assert rig.report.mode is UnitMode.LOST
    rig.unseen = False
    rig.grant(2, rig.leg(LegKind.REVERSE, 0.0, 0.2))
    rig.run()
    assert (rig.report.mode, rig.report.progress) == (UnitMode.STANDING, 0.2)
    assert math.isclose(rig.gap, 0.6, abs_tol=0.02)


@pytest.mark.parametrize("beside", [False, True])
def test_in_a_dock_leg_a_unit_has_come_as_far_as_it_is_near_to_the_port(beside: bool) -> None:
    """The first sight has the wrong one of the two poses of one tag: far aside, in the plane of the face."""
    rig = Rig(0.7)
    rig.grant(1, rig.leg(LegKind.DOCK, 0.0, 0.7), to="a.rear")
    rig.blind = True
    while not rig.unit.uses_camera("b/onboard"):
        rig.step()
    if beside:
        wrong, P = SE2(-0.11, 0.85, -1.2), np.diag([0.5, 0.5, 0.7]) ** 2
        exposure = Exposure("b/onboard", 0, rig.now_ns + PERIOD_NS)
        rig.unit.receive(PoseMeasurement(exposure, wrong, P, (None, None)))
        rig.step()
        pose = rig.unit.estimates.pose
        assert pose is not None
        assert pose.X_DU.x > -0.2
        assert rig.report.progress < 0.05
    rig.blind = False
    rig.run()
    assert _never_falls(rig.reports)
    assert (rig.report.progress, rig.report.docked_to) == (0.7, "a.rear")
