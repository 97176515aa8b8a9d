"""A robot whose program fails stands still from then on, and knows nothing."""

from __future__ import annotations

from typing import Any

import pytest

from msrr_bullet.robot.fail_safe import FailSafeRobot
from msrr_scenes.errors import ProgramFailedError, SceneError
from msrr_scenes.messages import Action, Belief, Conviction, Exposure, Phase, Twist, WheelOdometry

FAILURE = ProgramFailedError("controller 'mine:Law', mine.py line 3: step returned None; expected a Twist")
EXPOSURE = Exposure("a/onboard", 0, 0)


class Fragile:
    """A robot that closes its lock while it drives, and fails in one respect once it is told to."""

    def __init__(self) -> None:
        self.fails_in = ""
        self.estimate = self.los = self.arena = self.monitor = self.assembly = "something"
        self.belief = Belief(Conviction.DOCKED)

    def _try(self, what: str) -> Any:
        if what == self.fails_in:
            raise FAILURE

    @property
    def path(self) -> Any:
        return self._try("path")

    def uses_camera(self, camera: str) -> bool:
        return True

    def expose(self, exposure: Exposure, fetch: Any) -> Any:
        return self._try("expose")

    def receive(self, message: Any) -> None:
        self._try("receive")

    def step(self, now_ns: int) -> Action:
        self._try("step")
        return Action(now_ns, Phase.LOCK, 2, Twist(0.1, 0.2), lock=True, reason="seated")


@pytest.mark.parametrize("fails_in", ["expose", "receive", "step", "path"])
def test_it_stands_still_from_its_failure_on(fails_in: str) -> None:
    inner: Any = Fragile()
    robot = FailSafeRobot(lambda: inner)
    assert robot.step(1) == inner.step(1)
    assert (robot.failure, robot.estimate, robot.belief) == (None, "something", inner.belief)
    assert robot.uses_camera("a/onboard")

    inner.fails_in = fails_in
    robot.expose(EXPOSURE, lambda window: None)
    robot.receive(WheelOdometry("a", 2, 0.0, 0.0))
    for now_ns in (2, 3):  # the lock stays as it was: whatever hangs on it must not fall
        stop = Action(now_ns, Phase.LOCK, 2, Twist(), lock=True, reason=str(FAILURE))
        assert robot.step(now_ns) == stop
    assert robot.failure is FAILURE
    shown = (robot.estimate, robot.los, robot.arena, robot.monitor, robot.assembly, robot.path)
    assert shown == (None,) * 6
    assert robot.belief == Belief(reason=str(FAILURE))
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
