"""Records everything that passes between a trial and a robot, in the order in which a replay needs it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, TypeVar

from msrr_bullet.log import topics
from msrr_bullet.log.recorder import Recorder
from msrr_bullet.log.records import Event, Level, RadioReceipt
from msrr_bullet.robot.interface import CameraReader, Estimates, LedRobot, ObservableRobot
from msrr_scenes.errors import ProgramFailedError
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.messages import (
    Action,
    Detections,
    Exposure,
    Fetch,
    Pixels,
    SensorMessage,
)
from msrr_scenes.messages.coordination import Authority, UnitReport

Reader = TypeVar("Reader", bound=CameraReader)
R = TypeVar("R", bound=ObservableRobot)


class RecordedReader(Generic[Reader]):
    """A program that reads cameras, whose exposures and windows are recorded."""

    def __init__(self, program: Reader, recorder: Recorder, now_ns: Callable[[], int]) -> None:
        """Bind a program to a recorder; ``now_ns`` returns the simulated time [ns]."""
        self.program, self._recorder, self._now_ns = program, recorder, now_ns

    def uses_camera(self, camera: str) -> bool:
        """Return whether the program uses the frames of ``camera`` now."""
        return self.program.uses_camera(camera)

    def expose(self, exposure: Exposure, fetch: Fetch) -> Detections | None:
        """Record an exposure and the windows that the program fetches from it."""
        self._recorder.write(topics.exposure(exposure.camera), self._now_ns(), exposure)

        def fetch_and_record(window: Window) -> Pixels:
            try:
                pixels = fetch(window)
            except ProgramFailedError as error:  # the renderer's; a replay has none, and takes it from here
                failed = Event(self._now_ns(), exposure.camera, str(error), Level.ERROR)
                self._recorder.write(topics.EVENTS, failed.stamp_ns, failed)
                raise
            self._recorder.window(exposure, window, pixels)
            return pixels

        return self.program.expose(exposure, fetch_and_record)


class RecordedRobot(RecordedReader[R]):
    """A robot whose inputs, actions and estimates are recorded."""

    def __init__(self, robot: R, unit: str, recorder: Recorder, now_ns: Callable[[], int]) -> None:
        """Bind the robot of a unit to a recorder."""
        super().__init__(robot, recorder, now_ns)
        self._unit = unit
        self._estimates = Estimates()

    def receive(self, message: SensorMessage) -> None:
        """Record a message as it arrives."""
        self._recorder.write(topics.sensor(self._unit, message), self._now_ns(), message)
        self.program.receive(message)

    def step(self, now_ns: int) -> Action:
        """Record the action of one control instant, and the estimates on which it is based."""
        action = self.program.step(now_ns)
        self._recorder.write(topics.action(self._unit), now_ns, action)
        last, self._estimates = self._estimates, self.program.estimates
        for message in self._estimates.messages(last):
            self._recorder.write(topics.ESTIMATES[type(message)](self._unit), now_ns, message)
        return action


class RecordedLedRobot(RecordedRobot[LedRobot]):
    """A robot that a base station leads, with what it hears and reports."""

    def authorise(self, authority: Authority) -> None:
        """Record that an authority has arrived."""
        now_ns = self._now_ns()
        receipt = RadioReceipt(now_ns, self._unit, authority.seq)
        self._recorder.write(topics.authority_received(self._unit), now_ns, receipt)
        self.program.authorise(authority)

    def report(self, now_ns: int) -> UnitReport:
        """Record what the robot reports."""
        report = self.program.report(now_ns)
        self._recorder.write(topics.report(self._unit), now_ns, report)
        return report
