"""Compares a robot with what a log says it did, message by message."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from pathlib import Path

from pydantic import BaseModel, ConfigDict

from msrr_bullet.log.codec import to_bytes
from msrr_bullet.log.formats import format_of
from msrr_bullet.log.reader import Log, LogRecord
from msrr_bullet.log.records import CameraWindow, StepStart
from msrr_bullet.robot.interface import Robot
from msrr_scenes.errors import MsrrError
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.messages import (
    Action,
    ArenaEstimate,
    AssemblyPath,
    AssemblyProgress,
    Belief,
    Detections,
    Exposure,
    GlobalPose,
    Localisation,
    LockFeedback,
    LosObservation,
    Pixels,
    PoseEstimate,
    PoseMeasurement,
    SeatSwitches,
    WheelOdometry,
)
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.scene import Scene

#: Where a report stops listing differences.
_LISTED = 20

_SENSORS = (WheelOdometry, SeatSwitches, LockFeedback, PoseMeasurement, GlobalPose, Localisation)

#: What the robot holds true when it decides, and what a difference in it is called.
_BELIEFS: dict[type, str] = {
    PoseEstimate: "estimate",
    LosObservation: "los",
    ArenaEstimate: "situation",
    AssemblyProgress: "assembly",
    AssemblyPath: "path",
    Belief: "belief",
}

RobotFactory = Callable[[Scene, DockStep], Robot]


class ReplayError(MsrrError):
    """A replay that cannot be made."""


class Mismatch(BaseModel):
    """One difference between the trial and its replay.

    Attributes:
        what: ``command``, ``estimate``, ``los``, ``belief``, ``detections``, ``window`` or ``log``.
        sequence: Message of the log at which it showed.
        time_s: Simulated time.
        logged: What the trial did; None when it did nothing.
        replayed: What the replay did; None when it did nothing.
    """

    model_config = ConfigDict(frozen=True)

    what: str
    sequence: int
    time_s: float
    logged: str | None
    replayed: str | None


class ReplayReport(BaseModel):
    """What a replay found.

    Attributes:
        log: The file.
        complete: The log was finished; a trial that was killed is compared as far as it was written.
        steps: Steps of the plan.
        sensor_messages: Messages given to the robot, detections aside.
        commands: Decisions compared.
        estimates: Pose estimates, lines of sight and verdicts compared.
        windows: Window requests compared.
        detections: Sets of detections compared.
        mismatches: The first differences.
    """

    model_config = ConfigDict(frozen=True)

    log: Path
    complete: bool
    steps: int
    sensor_messages: int
    commands: int
    estimates: int
    windows: int
    detections: int
    mismatches: tuple[Mismatch, ...]

    @property
    def identical(self) -> bool:
        """The robot did the same, bit for bit, and there was something to compare."""
        return not self.mismatches and self.commands > 0


class _Diverged(Exception):
    """The robot asked for pixels that the log does not have; nothing after that can be compared."""


class Comparison:
    """One pass over a log."""

    def __init__(self, log: Log, scene: Scene, factory: RobotFactory) -> None:
        """Compare ``log``, of a trial of ``scene``, with the robots that ``factory`` builds."""
        self._log = log
        self._scene = scene
        self._factory = factory
        self._robot: Robot | None = None
        self._exposure: LogRecord | None = None
        self._windows: list[LogRecord] = []
        self._seen: dict[tuple[str, int], Detections] = {}
        self._believed: dict[type, bytes] = {}
        self._path: AssemblyPath | None = None
        self._counts = dict.fromkeys(("steps", "sensor_messages", "commands", "estimates", "windows"), 0)
        self._counts["detections"] = 0
        self._mismatches: list[Mismatch] = []

    def run(self) -> ReplayReport:
        """Read the log once, from its beginning to its end or to where the robot leaves it."""
        last: LogRecord | None = None
        try:
            for record in self._log.records():
                expected = 0 if last is None else last.sequence + 1
                if record.sequence != expected:
                    self._differ("log", record, f"message {expected}", None)
                    raise _Diverged
                last = record
                self._take(record)
            if last is not None and self._log.complete:  # else windows or beliefs may be what was cut off
                self._look()
                self._settle_beliefs(last)
        except _Diverged:
            pass  # it is in the list
        if not self._counts["steps"]:
            raise ReplayError(f"{self._log.path}: nothing to replay, the log holds no step of a plan")
        return ReplayReport(
            log=self._log.path,
            complete=self._log.complete,
            mismatches=tuple(self._mismatches),
            **self._counts,
        )

    def _take(self, record: LogRecord) -> None:
        kind = record.kind
        if kind is CameraWindow:
            self._windows.append(record)
            return
        self._look()
        if kind in _BELIEFS:
            self._compare_belief(record)
        elif kind is Exposure:
            self._exposure = record
        elif kind is StepStart:
            self._start(record)
        elif kind is Detections:
            self._deliver(record)
        elif kind in _SENSORS:
            self._counts["sensor_messages"] += 1
            self._at(record).receive(record.message)
        elif kind is Action:
            self._decide(record)

    def _at(self, record: LogRecord) -> Robot:
        if self._robot is None:
            raise ReplayError(
                f"{self._log.path}: message {record.sequence} on {record.topic} comes before the first step"
            )
        return self._robot

    def _start(self, record: LogRecord) -> None:
        start: StepStart = record.message
        if not 0 <= start.index < len(self._scene.plan):
            raise ReplayError(f"{self._log.path}: step {start.index} is not in the scene's plan")
        self._settle_beliefs(record)
        self._counts["steps"] += 1
        self._robot = self._factory(self._scene, self._scene.plan[start.index])

    def _look(self) -> None:
        """Show the robot the exposure whose windows have all been read from the log by now."""
        record, self._exposure = self._exposure, None
        if record is None:
            return
        exposure: Exposure = record.message
        logged, self._windows = deque(self._windows), []

        def fetch(window: Window) -> Pixels:
            self._counts["windows"] += 1
            there: CameraWindow | None = logged.popleft().message if logged else None
            if there is None or there.window != window or there.exposure != exposure:
                self._differ("window", record, None if there is None else str(there.window), str(window))
                raise _Diverged
            return there.pixels

        detections = self._at(record).expose(exposure, fetch)
        for extra in logged:
            self._differ("window", extra, str(extra.message.window), None)
        if detections is not None:
            self._seen[exposure.camera, exposure.frame] = detections

    def _deliver(self, record: LogRecord) -> None:
        logged: Detections = record.message
        seen = self._seen.pop((logged.exposure.camera, logged.exposure.frame), None)
        self._counts["detections"] += 1
        if self._compare("detections", record, seen) and seen is not None:
            self._at(record).receive(seen)
        else:
            raise _Diverged

    def _decide(self, record: LogRecord) -> None:
        self._settle_beliefs(record)
        robot = self._at(record)
        self._counts["commands"] += 1
        self._compare("command", record, robot.step(record.stamp_ns))
        path, self._path = (None if robot.path is self._path else robot.path), robot.path
        for belief in (robot.estimate, robot.los, robot.situation, robot.assembly, path, robot.belief):
            if belief is not None:
                self._believed[type(belief)] = _text(belief, record.topic)

    def _compare_belief(self, record: LogRecord) -> None:
        self._counts["estimates"] += 1
        mine = self._believed.pop(record.kind, None)
        if mine != record.data:
            logged = record.data.decode()
            self._differ(_BELIEFS[record.kind], record, logged, None if mine is None else mine.decode())

    def _settle_beliefs(self, record: LogRecord) -> None:
        """Beliefs of the last decision that were not met in the log are differences too."""
        for kind, text in self._believed.items():
            self._differ(_BELIEFS[kind], record, None, text.decode())
        self._believed = {}

    def _compare(self, what: str, record: LogRecord, replayed: object | None) -> bool:
        text = None if replayed is None else _text(replayed, record.topic)
        if text == record.data:
            return True
        self._differ(what, record, record.data.decode(), None if text is None else text.decode())
        return False

    def _differ(self, what: str, record: LogRecord, logged: str | None, replayed: str | None) -> None:
        self._mismatches.append(
            Mismatch(
                what=what,
                sequence=record.sequence,
                time_s=record.stamp_ns * 1e-9,
                logged=logged,
                replayed=replayed,
            )
        )
        if len(self._mismatches) >= _LISTED:
            raise _Diverged


def _text(message: object, topic: str) -> bytes:
    """Return the bytes that the recorder writes; equal bytes mean equal bits."""
    return to_bytes(format_of(message).encode(message, topic))
