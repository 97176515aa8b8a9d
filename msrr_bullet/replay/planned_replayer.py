"""The replay of units that carry out a plan on their own, one after another."""

from __future__ import annotations

from collections.abc import Callable

from msrr_bullet.log import topics
from msrr_bullet.log.reader import Log, LogRecord
from msrr_bullet.log.records import StepStart
from msrr_bullet.replay.comparison import ReplayError
from msrr_bullet.replay.replayer import ReplayedRobot, Replayer
from msrr_bullet.robot.autonomy import Autonomy
from msrr_bullet.robot.fail_safe import FailSafeRobot
from msrr_bullet.robot.interface import CameraReader, ObservableRobot
from msrr_scenes.messages import SensorMessage
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.scene import Scene

RobotFactory = Callable[[Scene, DockStep], ObservableRobot]


def fail_safe_autonomy(scene: Scene, step: DockStep) -> ObservableRobot:
    """Build the robot of a step of a plan."""
    return FailSafeRobot(lambda: Autonomy(scene, step))


class PlannedReplayer(Replayer):
    """One pass over the log of a plan, each step of which has a robot of its own."""

    def __init__(self, log: Log, scene: Scene, factory: RobotFactory) -> None:
        """Compare ``log``, of a trial of ``scene``, with the robots that ``factory`` builds."""
        super().__init__(log, scene)
        self._factory = factory
        self._under_way: str | None = None  # unit of the newest step

    def _start(self, record: LogRecord) -> None:
        start: StepStart = record.message
        if not 0 <= start.index < len(self._scene.docks):
            raise ReplayError(f"{self._log.path}: step {start.index} is not in the plan of the scene")
        before = self._robots.pop(start.unit, None)
        if before is not None:
            self._report_unlogged_estimates(record, before)
        self._counts["steps"] += 1
        self._robots[start.unit] = ReplayedRobot(self._factory(self._scene, self._scene.docks[start.index]))
        self._under_way = start.unit

    def _reader_of(self, record: LogRecord) -> CameraReader:
        """Return the robot of the camera's unit, or that of the step under way for the overhead camera."""
        unit = topics.unit_of(record.topic)
        return self._robot_of(record, unit if unit in self._scene.units else self._under_way).robot

    def _receive(self, record: LogRecord, message: SensorMessage) -> None:
        self._robot_of(record).robot.receive(message)
