"""A robot that stops when its program fails, as a class of a user's own may."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Generic, TypeVar

from msrr_bullet.profiler import Profiler
from msrr_bullet.robot.guided_unit import GuidedUnit
from msrr_bullet.robot.interface import Estimates, LedRobot, ObservableRobot
from msrr_perception.tracking.seen_pose import SeenPoses
from msrr_scenes.errors import ProgramFailedError
from msrr_scenes.messages import (
    Action,
    Belief,
    Detections,
    Exposure,
    Fetch,
    Phase,
    SensorMessage,
    Twist,
)
from msrr_scenes.messages.coordination import Authority, UnitMode, UnitReport
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.scene import Scene

R = TypeVar("R", bound=ObservableRobot)


class FailSafeRobot(Generic[R]):
    """Runs a robot until its program fails. From then on it commands a standstill and knows nothing.

    ``estimates`` are those of the last decision, and none once the program has failed; ``failure`` is its
    error, None while it runs.
    """

    def __init__(self, build: Callable[[], R]) -> None:
        """Build the robot; one that cannot be built for a failure of its program stands still."""
        self._action = Action(0, Phase.ASSEMBLE, attempt=1)
        self._robot: R | None = None
        self.failure: ProgramFailedError | None = None
        self.estimates = Estimates()
        try:
            self._robot = build()
        except ProgramFailedError as error:
            self._stop(error)

    def uses_camera(self, camera: str) -> bool:
        """Return whether the robot uses the frames of ``camera`` now."""
        return self._robot is not None and self._robot.uses_camera(camera)

    def expose(self, exposure: Exposure, fetch: Fetch) -> Detections | None:
        """Let the robot read windows of an exposure; None once its program has failed."""
        if self._robot is None:
            return None
        try:
            return self._robot.expose(exposure, fetch)
        except ProgramFailedError as error:
            self._stop(error)
            return None

    def receive(self, message: SensorMessage) -> None:
        """Pass a message on."""
        if self._robot is None:
            return
        try:
            self._robot.receive(message)
        except ProgramFailedError as error:
            self._stop(error)

    def step(self, now_ns: int) -> Action:
        """Return the action of the robot, or once its program has failed, a standstill."""
        if self._robot is not None:
            try:
                return self._decide(self._robot, now_ns)
            except ProgramFailedError as error:
                self._stop(error)
        self._action = replace(self._action, stamp_ns=now_ns, twist=Twist(), reason=str(self.failure))
        return self._action

    def _decide(self, robot: R, now_ns: int) -> Action:
        action = robot.step(now_ns)
        self._action, self.estimates = action, robot.estimates
        return action

    def _stop(self, error: ProgramFailedError) -> None:
        self.failure, self._robot = error, None
        self.estimates = Estimates(belief=Belief(reason=str(error)))


class FailSafeLedRobot(FailSafeRobot[LedRobot]):
    """Runs a robot that a base station leads until its program fails, which it then reports."""

    def __init__(self, unit: str, build: Callable[[], LedRobot], docked_to: str | None = None) -> None:
        """Build the robot of a unit; one that cannot be built for a failure of its program stands still.

        The unit is locked into the port ``docked_to`` at the start, or is free.
        """
        self._unit, self.docked_to = unit, docked_to
        self.route = 0
        self.dock_step: DockStep | None = None
        self.leaving = False
        super().__init__(build)

    @property
    def active(self) -> bool:
        """Whether the robot has something to do; one whose program has failed has to come to rest."""
        return self._robot is None or self._robot.active

    def see(self, seen_poses: SeenPoses) -> None:
        """Pass on what the base station has read from an overhead exposure."""
        if self._robot is not None:
            self._robot.see(seen_poses)

    def authorise(self, authority: Authority) -> None:
        """Pass an authority on."""
        if self._robot is None:
            return
        try:
            self._robot.authorise(authority)
        except ProgramFailedError as error:
            self._stop(error)

    def report(self, now_ns: int) -> UnitReport:
        """Return the report of the robot, or once its program has failed, that it has."""
        if self._robot is not None:
            return self._robot.report(now_ns)
        # The lock stays as it was: whatever the unit hangs in must not be told to drive away.
        port = self.docked_to
        if port is None and self._action.lock and self.dock_step is not None:
            port = self.dock_step.to
        reason = str(self.failure)
        return UnitReport(self._unit, now_ns, 0, self.route, 0.0, UnitMode.FAILED, port, reason=reason)

    def _decide(self, robot: LedRobot, now_ns: int) -> Action:
        action = super()._decide(robot, now_ns)
        self.route, self.dock_step, self.leaving = robot.route, robot.dock_step, robot.leaving
        self.docked_to = robot.docked_to
        return action


def led_robot(scene: Scene, unit: str, profiler: Profiler | None = None) -> FailSafeLedRobot:
    """Build the robot of a unit that a base station leads, as a trial and its replay do."""
    docked_to = scene.holders.get(unit)
    return FailSafeLedRobot(unit, lambda: GuidedUnit(scene, unit, docked_to, profiler), docked_to)
