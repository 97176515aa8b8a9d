"""A replay runs the robot again from a log and compares all outputs, bit for bit.

The robot gets the inputs of the log in their order: exposures with the pixels of the windows that it fetched,
sensor messages at their arrival, and the time. It gets nothing else of the log. If its outputs are equal in a
process that cannot import the simulator, the robot had no other inputs in the trial either. The recording of
a real robot would be replayed in the same way.
"""

from __future__ import annotations

import tempfile
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from msrr_bullet.log import topics
from msrr_bullet.log.reader import Log, LogRecord, read_log
from msrr_bullet.log.records import CameraWindow, Event, Level, StepStart
from msrr_bullet.replay.comparison import Comparison, Diverged, ReplayError, ReplayReport, encoded
from msrr_bullet.robot.autonomy import Autonomy
from msrr_bullet.robot.fail_safe import FailSafeRobot
from msrr_bullet.robot.interface import ObservableRobot
from msrr_scenes.errors import ProgramFailedError
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.loading.load import check_scene
from msrr_scenes.messages import (
    Action,
    ArenaEstimate,
    AssemblyPath,
    AssemblyProgress,
    Belief,
    CollisionMonitorState,
    Detections,
    Exposure,
    GlobalPose,
    Localisation,
    LockFeedback,
    LosObservation,
    Phase,
    Pixels,
    PoseEstimate,
    PoseMeasurement,
    SeatSwitches,
    WheelOdometry,
)
from msrr_scenes.registry import choices, is_import_path
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.scene import Scene

_SENSOR_MESSAGES = (WheelOdometry, SeatSwitches, LockFeedback, PoseMeasurement, GlobalPose, Localisation)

#: The estimates that a robot shows after a decision, and their names in the report.
_ESTIMATES: dict[type, str] = {
    PoseEstimate: "estimate",
    LosObservation: "los",
    ArenaEstimate: "situation",
    CollisionMonitorState: "collision_monitor",
    AssemblyProgress: "assembly",
    AssemblyPath: "path",
    Belief: "belief",
}

RobotFactory = Callable[[Scene, DockStep], ObservableRobot]


def fail_safe_autonomy(scene: Scene, step: DockStep) -> ObservableRobot:
    """Build the robot of a trial."""
    return FailSafeRobot(lambda: Autonomy(scene, step))


def replay(run: Path, robot: RobotFactory = fail_safe_autonomy, *, trust: bool = False) -> ReplayReport:
    """Replay a run in this process.

    Args:
        run: Run folder or log file.
        robot: Builds the robot of a step of the plan.
        trust: Whether classes that the log names by their import paths may be built. That runs their code.

    Raises:
        LogError: The log cannot be read.
        ReplayError: The log is not that of a trial, or names a class by import path and is not trusted.
        SceneError: The scene of the log contradicts itself.
    """
    log = read_log(run)
    named = [choice.name for choice in choices(log.header.scene.control) if is_import_path(choice)]
    if named and not trust:
        raise ReplayError(
            f"{log.path}: the log names {', '.join(named)} by import path, and a replay would run that code; "
            "give --trust if you trust the log and the code"
        )
    with tempfile.TemporaryDirectory(prefix="msrr-replay-") as folder:
        scene = log.header.unpacked(Path(folder)).scene
        check_scene(scene)  # a trial was run of it, but the log may have been changed since
        return Replayer(log, scene, robot).run()


@dataclass
class _ReplayedRobot:
    """A robot that runs again, its estimates that the log has not confirmed yet, and its last path."""

    robot: ObservableRobot
    estimates: dict[type, bytes] = field(default_factory=dict)
    path: AssemblyPath | None = None
    finished: bool = False


class Replayer:
    """One pass over a log."""

    def __init__(self, log: Log, scene: Scene, factory: RobotFactory) -> None:
        """Compare ``log``, of a trial of ``scene``, with the robots that ``factory`` builds."""
        self._log = log
        self._scene = scene
        self._factory = factory
        self._robots: dict[str, _ReplayedRobot] = {}  # by unit
        self._exposure: LogRecord | None = None
        self._windows: list[LogRecord] = []
        self._camera_failure: str | None = None
        self._detections: dict[tuple[str, int], Detections] = {}
        self._monitor_is_logged = log.header.versions.get("msrr-bullet") != "0.1.0"  # not yet in that version
        self._comparison = Comparison()
        self._counts = dict.fromkeys(
            ("steps", "sensor_messages", "commands", "estimates", "windows", "detections"), 0
        )

    def run(self) -> ReplayReport:
        """Read the log to its end, or to where the robot leaves it."""
        last: LogRecord | None = None
        try:
            for record in self._log.records():
                expected = 0 if last is None else last.sequence + 1
                if record.sequence != expected:
                    self._comparison.add("log", record, f"message {expected}", None)
                    raise Diverged
                last = record
                self._process(record)
            if last is not None and self._log.complete:  # else windows or estimates may be missing at the end
                self._expose()
                for robot in self._robots.values():
                    self._report_unlogged_estimates(last, robot)
        except Diverged:
            pass  # the difference is in the list
        if not self._counts["steps"]:
            raise ReplayError(f"{self._log.path}: nothing to replay, the log holds no step of a plan")
        return ReplayReport(
            log=self._log.path,
            complete=self._log.complete,
            mismatches=tuple(self._comparison.mismatches),
            written_by=self._log.header.versions.get("msrr-bullet"),
            **self._counts,
        )

    def _process(self, record: LogRecord) -> None:
        kind = record.kind
        if kind is CameraWindow:
            self._windows.append(record)
            return
        if kind is Event:
            self._note_camera_failure(record.message)
        self._expose()
        if kind in _ESTIMATES:
            self._compare_estimate(record)
        elif kind is Exposure:
            self._exposure = record
        elif kind is StepStart:
            self._start(record)
        elif kind is Detections:
            self._deliver(record)
        elif kind in _SENSOR_MESSAGES:
            self._counts["sensor_messages"] += 1
            self._robot_of(record).robot.receive(record.message)
        elif kind is Action:
            self._decide(record)

    def _robot_of(self, record: LogRecord) -> _ReplayedRobot:
        """Return the robot of the unit in the topic of a message."""
        robot = self._robots.get(topics.unit_of(record.topic))
        if robot is None:
            raise ReplayError(
                f"{self._log.path}: message {record.sequence} on {record.topic} comes before the first step"
            )
        return robot

    def _reader_of(self, record: LogRecord) -> _ReplayedRobot:
        """Return the robot that read an exposure: that of the camera's unit, or the only one under way."""
        if topics.unit_of(record.topic) in self._scene.units:
            return self._robot_of(record)
        active = [robot for robot in self._robots.values() if not robot.finished]
        if len(active) != 1:
            raise ReplayError(
                f"{self._log.path}: {len(active)} robots may have read message {record.sequence} on"
                f" {record.topic}; a log in which several units use the overhead camera cannot be replayed"
            )
        return active[0]

    def _start(self, record: LogRecord) -> None:
        start: StepStart = record.message
        if not 0 <= start.index < len(self._scene.docks):
            raise ReplayError(f"{self._log.path}: step {start.index} is not in the plan of the scene")
        before = self._robots.pop(start.unit, None)
        if before is not None:
            self._report_unlogged_estimates(record, before)
        self._counts["steps"] += 1
        self._robots[start.unit] = _ReplayedRobot(self._factory(self._scene, start.step(self._scene)))

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

        detections = self._reader_of(record).robot.expose(exposure, fetch)
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
        self._robot_of(record).robot.receive(detections)

    def _decide(self, record: LogRecord) -> None:
        replayed = self._robot_of(record)
        self._report_unlogged_estimates(record, replayed)
        robot = replayed.robot
        self._counts["commands"] += 1
        action = robot.step(record.stamp_ns)
        replayed.finished = action.phase in (Phase.DONE, Phase.FAILED)
        self._comparison.compare("command", record, action)
        monitor = robot.monitor if self._monitor_is_logged else None
        path, replayed.path = (None if robot.path is replayed.path else robot.path), robot.path
        for estimate in (robot.estimate, robot.los, robot.arena, monitor, robot.assembly, path, robot.belief):
            if estimate is not None:
                replayed.estimates[type(estimate)] = encoded(estimate, record.topic)

    def _compare_estimate(self, record: LogRecord) -> None:
        self._counts["estimates"] += 1
        data = self._robot_of(record).estimates.pop(record.kind, None)
        if data != record.data:
            logged, replayed = record.data.decode(), None if data is None else data.decode()
            self._comparison.add(_ESTIMATES[record.kind], record, logged, replayed)

    def _report_unlogged_estimates(self, record: LogRecord, robot: _ReplayedRobot) -> None:
        """Report the estimates of the last decision of a robot that the log does not hold."""
        for kind, data in robot.estimates.items():
            self._comparison.add(_ESTIMATES[kind], record, None, data.decode())
        robot.estimates.clear()
