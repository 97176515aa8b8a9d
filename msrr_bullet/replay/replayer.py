"""One pass over a log: the robots run again, and all that they put out is compared, bit for bit.

A robot gets the inputs of the log in their order: exposures with the pixels of the windows that it fetched,
sensor messages at their arrival, and the time. It gets nothing else of the log. If its outputs are equal in a
process that cannot import the simulator, the robot had no other inputs in the trial either. The recording of
a real robot would be replayed in the same way.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeGuard

from msrr_bullet.log import topics
from msrr_bullet.log.reader import Log, LogRecord
from msrr_bullet.log.records import CameraWindow, Event, Level, StepStart
from msrr_bullet.replay.comparison import (
    COUNTS,
    Diverged,
    ReplayComparison,
    ReplayError,
    ReplayReport,
    encoded,
)
from msrr_bullet.robot.autonomy import Autonomy
from msrr_bullet.robot.fail_safe import FailSafeRobot
from msrr_bullet.robot.interface import CameraReader, Estimates, ObservableRobot
from msrr_scenes.errors import ProgramFailedError
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.messages import (
    Action,
    CollisionMonitorState,
    Detections,
    Exposure,
    GlobalPose,
    Localisation,
    LockFeedback,
    Pixels,
    PoseMeasurement,
    SeatSwitches,
    SensorMessage,
    WheelOdometry,
    seconds,
)
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.scene import Scene

_SENSOR_MESSAGES = (WheelOdometry, SeatSwitches, LockFeedback, PoseMeasurement, GlobalPose, Localisation)


@dataclass
class ReplayedRobot:
    """A robot that runs again, its last estimates, and those of them that the log has not confirmed yet."""

    robot: ObservableRobot
    estimates: Estimates = field(default_factory=Estimates)
    unlogged: dict[type, object] = field(default_factory=dict)


class Replayer(ABC):
    """One pass over a log."""

    def __init__(self, log: Log, scene: Scene) -> None:
        """Prepare to compare ``log``, of a trial of ``scene``."""
        self._log = log
        self._scene = scene
        self._robots: dict[str, ReplayedRobot] = {}  # by unit
        self._exposure: LogRecord | None = None
        self._windows: list[LogRecord] = []
        self._camera_failure: str | None = None
        self._detections: dict[tuple[str, int], Detections] = {}
        self._monitor_is_logged = log.header.versions.get("msrr-bullet") != "0.1.0"  # not yet in that version
        self._comparison = ReplayComparison()
        self._counts = dict.fromkeys(COUNTS, 0)

    def run(self) -> ReplayReport:
        """Read the log to its end, or to where the robot leaves it."""
        last: LogRecord | None = None
        left = False
        try:
            for record in self._log.records():
                expected = 0 if last is None else last.sequence + 1
                if record.sequence != expected:
                    self._comparison.add("log", record, _gap(expected, record.sequence), None)
                    raise Diverged
                last = record
                self._process(record)
            if _is_verdict(last):  # else a trial was interrupted in the middle of anything
                self._expose()
                self._end(last)
        except Diverged:
            left = True  # the difference is in the list
        report = ReplayReport(
            log=self._log.path,
            complete=self._log.complete,
            judged=_is_verdict(last),
            left=left,
            end_s=0.0 if last is None else seconds(last.stamp_ns),
            mismatches=tuple(self._comparison.mismatches),
            written_with=self._log.header.versions,
            **self._counts,
        )
        if not report.mismatches and not report.identical:
            raise ReplayError(
                f"{self._log.path}: nothing to replay, the log holds no decision of a robot or a base station"
            )
        return report

    def _process(self, record: LogRecord) -> None:
        kind = record.kind
        if kind is CameraWindow:
            self._windows.append(record)
            return
        if kind is Event:
            self._note_camera_failure(record.message)
        self._expose()
        if kind in topics.ESTIMATES:
            self._compare_estimate(record)
        elif kind is Exposure:
            self._exposure = record
        elif kind is StepStart:
            self._start(record)
        elif kind is Detections:
            self._deliver(record)
        elif kind in _SENSOR_MESSAGES:
            self._counts["sensor_messages"] += 1
            self._receive(record, record.message)
        elif kind is Action:
            self._decide(record)

    @abstractmethod
    def _start(self, record: LogRecord) -> None:
        """Process the start of a step."""

    @abstractmethod
    def _reader_of(self, record: LogRecord) -> CameraReader:
        """Return the program that read an exposure."""

    @abstractmethod
    def _receive(self, record: LogRecord, message: SensorMessage) -> None:
        """Give a message to all that got it in the trial."""

    def _end(self, last: LogRecord) -> None:
        """Report what is still missing at the end of a trial that was not ended early."""
        for robot in self._robots.values():
            self._report_unlogged_estimates(last, robot)

    def _robot_of(self, record: LogRecord, unit: str | None = None) -> ReplayedRobot:
        """Return the robot of a unit, by default of that in the topic of a message."""
        robot = self._robots.get(unit or topics.unit_of(record.topic))
        if robot is None:
            raise ReplayError(
                f"{self._log.path}: message {record.sequence} on {record.topic} comes before the first step"
            )
        return robot

    def _note_camera_failure(self, event: Event) -> None:
        """Note that the trial's renderer failed at the next window, which the robot will ask for again."""
        if self._exposure is not None and event.level is Level.ERROR:
            exposure: Exposure = self._exposure.message
            if event.source == exposure.camera:
                self._camera_failure = event.text

    def _expose(self) -> None:
        """Give the robot the last exposure, whose windows have all been read from the log by now."""
        record, self._exposure = self._exposure, None
        if record is None:
            return
        exposure: Exposure = record.message
        logged, self._windows = deque(self._windows), []

        failure, self._camera_failure = self._camera_failure, None

        def fetch(window: Window) -> Pixels:
            if not logged and failure is not None:
                raise ProgramFailedError(failure)
            self._counts["windows"] += 1
            expected: CameraWindow | None = logged.popleft().message if logged else None
            if expected is None or expected.window != window or expected.exposure != exposure:
                name = None if expected is None else str(expected.window)
                self._comparison.add("window", record, name, str(window))
                raise Diverged
            return expected.pixels

        detections = self._reader_of(record).expose(exposure, fetch)
        for unused in logged:
            self._comparison.add("window", unused, str(unused.message.window), None)
        if detections is not None:
            self._detections[exposure.camera, exposure.frame] = detections

    def _deliver(self, record: LogRecord) -> None:
        logged: Detections = record.message
        detections = self._detections.pop((logged.exposure.camera, logged.exposure.frame), None)
        self._counts["detections"] += 1
        if not self._comparison.compare("detections", record, detections) or detections is None:
            raise Diverged
        self._receive(record, detections)

    def _decide(self, record: LogRecord) -> None:
        replayed = self._robot_of(record)
        self._report_unlogged_estimates(record, replayed)
        self._counts["commands"] += 1
        action = replayed.robot.step(record.stamp_ns)
        self._comparison.compare("command", record, action)
        last, replayed.estimates = replayed.estimates, replayed.robot.estimates
        replayed.unlogged = {type(message): message for message in replayed.estimates.messages(last)}
        if not self._monitor_is_logged:
            replayed.unlogged.pop(CollisionMonitorState, None)

    def _compare_estimate(self, record: LogRecord) -> None:
        self._counts["estimates"] += 1
        estimate = self._robot_of(record).unlogged.pop(record.kind, None)
        self._comparison.compare(_name(record.kind), record, estimate)

    def _report_unlogged_estimates(self, record: LogRecord, robot: ReplayedRobot) -> None:
        """Report the estimates of the last decision of a robot that the log does not hold."""
        for kind, estimate in robot.unlogged.items():
            self._comparison.add(_name(kind), record, None, encoded(estimate).decode())
        robot.unlogged.clear()


RobotFactory = Callable[[Scene, DockStep], ObservableRobot]


def fail_safe_autonomy(scene: Scene, step: DockStep) -> ObservableRobot:
    """Build the robot of a step of a plan."""
    return FailSafeRobot(lambda: Autonomy(scene, step))


class PlannedReplayer(Replayer):
    """One pass over the log of units that carry out a plan on their own: each step has a robot of its own."""

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


def _name(kind: type) -> str:
    """Return the name of a kind of estimate in the report: the last part of its topic."""
    return topics.ESTIMATES[kind]("").rpartition("/")[2]


def _gap(expected: int, found: int) -> str:
    """Say what is wrong with a log in which another message than the expected one comes next."""
    if found < expected:
        return f"message {found} stands where message {expected} belongs"
    if found == expected + 1:
        return f"message {expected} is missing from the log"
    return f"messages {expected} to {found - 1} are missing from the log"


def _is_verdict(record: LogRecord | None) -> TypeGuard[LogRecord]:
    """Return whether a message is the verdict on the trial, which is the last one of a log."""
    return record is not None and record.kind is Event and record.message.is_verdict
