"""A robot whose program fails stands still from then on, and knows nothing."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from msrr_bullet.robot.fail_safe import FailSafeLedRobot, FailSafeRobot, led_robot
from msrr_bullet.robot.interface import Estimates
from msrr_scenes.errors import ProgramFailedError, SceneError
from msrr_scenes.messages import (
    Action,
    Belief,
    Conviction,
    Exposure,
    LosObservation,
    LosStatus,
    Phase,
    Twist,
    WheelOdometry,
)
from msrr_scenes.messages.coordination import Authority, LegKind, RouteLeg, UnitMode
from msrr_scenes.specs.plan import DockStep
from tests.bullet.robot.conftest import locked_pair

FAILURE = ProgramFailedError("controller 'mine:Law', mine.py line 3: step returned None; expected a Twist")
EXPOSURE = Exposure("a/onboard", 0, 0)
LOS = LosObservation(0, 0.1, -0.1, 0.1, LosStatus.SEEN)


class Fragile:
    """A robot that closes its lock while it drives, and fails in one respect once it is told to."""

    def __init__(self) -> None:
        self.fails_in = ""
        self.estimates = Estimates(los=LOS, belief=Belief(Conviction.DOCKED))

    def _try(self, what: str) -> Any:
        if what == self.fails_in:
            raise FAILURE

    def uses_camera(self, camera: str) -> bool:
        return True

    def expose(self, exposure: Exposure, fetch: Any) -> Any:
        return self._try("expose")

    def receive(self, message: Any) -> None:
        self._try("receive")

    def step(self, now_ns: int) -> Action:
        self._try("step")
        return Action(now_ns, Phase.LOCK, 2, Twist(0.1, 0.2), lock=True, reason="seated")


@pytest.mark.parametrize("fails_in", ["expose", "receive", "step"])
def test_it_stands_still_from_its_failure_on(fails_in: str) -> None:
    inner: Any = Fragile()
    robot = FailSafeRobot(lambda: inner)
    assert robot.step(1) == inner.step(1)
    assert (robot.failure, robot.estimates) == (None, inner.estimates)
    assert robot.uses_camera("a/onboard")

    inner.fails_in = fails_in
    robot.expose(EXPOSURE, lambda window: None)
    robot.receive(WheelOdometry("a", 2, 0.0, 0.0))
    for now_ns in (2, 3):  # the lock stays as it was: whatever hangs on it must not fall
        stop = Action(now_ns, Phase.LOCK, 2, Twist(), lock=True, reason=str(FAILURE))
        assert robot.step(now_ns) == stop
    assert robot.failure is FAILURE
    assert robot.estimates == Estimates(belief=Belief(reason=str(FAILURE)))
    assert not robot.uses_camera("a/onboard"), "no more frames are exposed"
    assert robot.expose(EXPOSURE, lambda window: None) is None


def test_one_that_cannot_be_built_stands_still_too() -> None:
    def build() -> Any:
        raise FAILURE

    robot = FailSafeRobot(build)
    assert robot.failure is FAILURE
    assert robot.step(5) == Action(5, Phase.ASSEMBLE, 1, reason=str(FAILURE))


def test_an_unusable_scene_is_not_hidden() -> None:
    def build() -> Any:
        raise SceneError("no tags")

    with pytest.raises(SceneError, match="no tags"):
        FailSafeRobot(build)


#: A law that no unit can build when it is to leave its port.
UNBUILDABLE = """
class Law:
    def __init__(self, setup):
        raise OSError("no such device")

    def reset(self, inputs): ...

    def step(self, inputs): ...
"""


def test_a_locked_unit_whose_program_fails_still_says_where_it_hangs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Else the base station takes its holder for one that carries nobody, and may let it drive away."""
    (tmp_path / "unbuildable.py").write_text(UNBUILDABLE)
    monkeypatch.syspath_prepend(str(tmp_path))
    scene = locked_pair(control={"docking": "unbuildable:Law"})
    unit = led_robot(scene, "b")
    leg = RouteLeg(LegKind.BACK, (0.0, 0.0, 0.0), (), (), 0.0, 0.3)
    unit.authorise(Authority("b", 1, 1, 0, 3_000_000_000, leg.end, (leg,), None, True))
    unit.step(20_000_000)
    assert unit.failure is not None
    report = unit.report(20_000_000)
    assert (report.mode, report.docked_to) == (UnitMode.FAILED, "a.rear")


class FragileDocker(Fragile):
    """A led robot before, in or behind a port, which has closed its lock or not."""

    route, leaving = 3, False
    dock_step = DockStep(unit="b", port="front", to="a.rear")

    def __init__(self, lock: bool, docked_to: str | None) -> None:
        super().__init__()
        self.lock, self.docked_to = lock, docked_to

    def step(self, now_ns: int) -> Action:
        self._try("step")
        return Action(now_ns, Phase.LOCK if self.lock else Phase.DOCK, 1, lock=self.lock)


@pytest.mark.parametrize(
    ("lock", "docked_to", "port"),
    [
        (False, None, None),
        (True, None, "a.rear"),  # it has not noticed yet that it is locked
        (True, "a.rear", "a.rear"),
        (False, "a.rear", "a.rear"),  # its lock may not have opened yet
    ],
)
def test_one_that_fails_near_a_port_hangs_in_it_unless_it_has_never_closed_its_lock_there(
    lock: bool, docked_to: str | None, port: str | None
) -> None:
    inner: Any = FragileDocker(lock, docked_to)
    robot = FailSafeLedRobot("b", lambda: inner, docked_to="c.left")  # it was in another port at the start
    robot.step(1)
    inner.fails_in = "step"
    robot.step(2)
    report = robot.report(2)
    assert (report.mode, report.route, report.docked_to) == (UnitMode.FAILED, 3, port)
