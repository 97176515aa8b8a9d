"""The replay of a mission that a base station led: all robots and the base station run again."""

from __future__ import annotations

from collections import deque

from msrr_bullet.base_station.base_station import BASE_STATION, BaseStation
from msrr_bullet.log import topics
from msrr_bullet.log.reader import Log, LogRecord
from msrr_bullet.log.records import Event, Level, RadioReceipt
from msrr_bullet.replay.comparison import Diverged, encoded
from msrr_bullet.replay.replayer import ReplayedRobot, Replayer
from msrr_bullet.robot.fail_safe import led_robot
from msrr_bullet.robot.interface import CameraReader
from msrr_scenes.errors import ProgramFailedError
from msrr_scenes.messages import OVERHEAD, Detections, Exposure, GlobalPose, SensorMessage
from msrr_scenes.messages.coordination import Authority, MissionStatus, UnitReport
from msrr_scenes.specs.scene import Scene


class CoordinatedReplayer(Replayer):
    """One pass over the log of a mission.

    All robots and the base station exist from the start. A message over the radio is given to its receiver as
    the log holds it, after it was compared with what the sender puts out now. The start of a step is only a
    record of the judge's.
    """

    def __init__(self, log: Log, scene: Scene) -> None:
        """Compare ``log``, of a trial of ``scene``, with robots and a base station that are built anew."""
        super().__init__(log, scene)
        self._led = {unit: led_robot(scene, unit) for unit in scene.units}
        self._robots = {unit: ReplayedRobot(robot) for unit, robot in self._led.items()}
        self._base = BaseStation(scene)
        self._failure: str | None = None  # of the base station, until the log confirms it
        self._unlogged: deque[Authority] = deque()
        self._authorities: dict[tuple[str, int], Authority] = {}  # under way, by unit and number
        self._reports: dict[tuple[str, int], UnitReport] = {}  # under way, by unit and time

    def _process(self, record: LogRecord) -> None:
        if record.kind is not Authority:
            self._report_unlogged_authorities(record)
        failure = self._failure
        try:
            super()._process(record)
            self._process_mission(record)
        except ProgramFailedError as error:  # of the base station: a robot's own becomes its report
            self._failure = str(error)
        if record.kind is Event:
            self._compare_failure(record)
        elif failure is not None:
            self._comparison.add("event", record, None, failure)
            raise Diverged

    def _process_mission(self, record: LogRecord) -> None:
        """Process a message of the base station or of the radio."""
        kind = record.kind
        if kind is MissionStatus:
            self._lead(record)
        elif kind is Authority:
            self._compare_authority(record)
        elif kind is UnitReport:
            self._compare_report(record)
        elif kind is RadioReceipt:
            self._deliver_by_radio(record)

    def _start(self, record: LogRecord) -> None:
        if not record.message.in_the_open:
            self._counts["steps"] += 1

    def _reader_of(self, record: LogRecord) -> CameraReader:
        """Return the base station for the overhead camera, else the robot of the camera's unit."""
        exposure: Exposure = record.message
        return self._base if exposure.camera == OVERHEAD else self._robot_of(record).robot

    def _receive(self, record: LogRecord, message: SensorMessage) -> None:
        """Give a message of the overhead camera to the base station, which all units hear."""
        by_overhead = isinstance(message, Detections) and message.exposure.camera == OVERHEAD
        if not (by_overhead or isinstance(message, GlobalPose)):
            self._robot_of(record).robot.receive(message)
            return
        assert isinstance(message, Detections | GlobalPose)
        seen_poses = self._base.see(message)
        for robot in self._led.values():
            robot.see(seen_poses)

    def _end(self, last: LogRecord) -> None:
        super()._end(last)
        self._report_unlogged_authorities(last)
        if self._failure is not None:
            self._comparison.add("event", last, None, self._failure)

    # The base station.

    def _lead(self, record: LogRecord) -> None:
        """Let the base station decide."""
        self._counts["statuses"] += 1
        self._unlogged.extend(self._base.step(record.stamp_ns))
        self._comparison.compare("status", record, self._base.status)

    def _compare_authority(self, record: LogRecord) -> None:
        self._counts["authorities"] += 1
        authority: Authority = record.message
        self._comparison.compare("authority", record, self._unlogged.popleft() if self._unlogged else None)
        self._authorities[authority.unit, authority.seq] = authority

    def _report_unlogged_authorities(self, record: LogRecord) -> None:
        """Report the authorities of the last decision of the base station that the log does not hold."""
        while self._unlogged:
            authority = self._unlogged.popleft()
            logged = encoded(authority).decode()
            self._comparison.add("authority", record, None, logged)

    def _compare_failure(self, record: LogRecord) -> None:
        """Compare an event that says that the program of the base station failed."""
        event: Event = record.message
        if event.source != BASE_STATION or event.level is not Level.ERROR:
            return
        if self._failure is None:
            try:
                self._base.step(record.stamp_ns)  # a decision that failed left nothing else in the log
            except ProgramFailedError as error:
                self._failure = str(error)
        failure, self._failure = self._failure, None
        if failure != event.text:
            self._comparison.add("event", record, event.text, failure)

    # The radio.

    def _compare_report(self, record: LogRecord) -> None:
        self._counts["reports"] += 1
        report: UnitReport = record.message
        self._comparison.compare("report", record, self._led[report.unit].report(record.stamp_ns))
        self._reports[report.unit, report.stamp_ns] = report

    def _deliver_by_radio(self, record: LogRecord) -> None:
        """Give a message that arrived by radio to its receiver."""
        receipt: RadioReceipt = record.message
        key = receipt.unit, receipt.number
        if record.topic == topics.report_received(receipt.unit):
            report = self._reports.pop(key, None)
            if report is not None:
                self._base.hear(report, record.stamp_ns)
                return
        else:
            authority = self._authorities.pop(key, None)
            if authority is not None:
                self._led[receipt.unit].authorise(authority)
                return
        self._comparison.add("log", record, f"message {receipt.number} came, which nobody had sent", None)
        raise Diverged
