"""Records everything that passes between a trial and a robot, in the order in which a replay needs it."""

from __future__ import annotations

from collections.abc import Callable

from msrr_bullet.log import topics
from msrr_bullet.log.recorder import Recorder
from msrr_bullet.log.records import Event, Level, StepStart
from msrr_bullet.robot.interface import ObservableRobot
from msrr_scenes.errors import ProgramFailedError
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.messages import Action, AssemblyPath, Detections, Exposure, Fetch, Pixels, SensorMessage


class RecordedRobot:
    """A robot whose inputs, actions and estimates are recorded."""

    def __init__(
        self, robot: ObservableRobot, unit: str, recorder: Recorder, index: int, now_ns: Callable[[], int]
    ) -> None:
        """Record the start of a step of the plan.

        Args:
            robot: The robot of the step.
            unit: Name of the docking unit.
            recorder: Gets the messages.
            index: Index of the step in the plan.
            now_ns: Returns the simulated time [ns].
        """
        self._robot = robot
        self._unit = unit
        self._recorder = recorder
        self._now_ns = now_ns
        self._path: AssemblyPath | None = None
        recorder.write(topics.STEPS, now_ns(), StepStart(now_ns(), index, unit))

    def uses_camera(self, camera: str) -> bool:
        """Return whether the robot uses the frames of ``camera`` now."""
        return self._robot.uses_camera(camera)

    def expose(self, exposure: Exposure, fetch: Fetch) -> Detections | None:
        """Record an exposure and the windows that the robot fetches from it."""
        self._recorder.write(topics.exposure(exposure.camera), exposure.stamp_ns, exposure)

        def fetch_and_record(window: Window) -> Pixels:
            try:
                pixels = fetch(window)
            except ProgramFailedError as error:  # the renderer's; a replay has none, and takes it from here
                failed = Event(self._now_ns(), exposure.camera, str(error), Level.ERROR)
                self._recorder.write(topics.EVENTS, failed.stamp_ns, failed)
                raise
            self._recorder.window(exposure, window, pixels)
            return pixels

        return self._robot.expose(exposure, fetch_and_record)

    def receive(self, message: SensorMessage) -> None:
        """Record a message as it arrives."""
        self._recorder.write(topics.sensor(self._unit, message), self._now_ns(), message)
        self._robot.receive(message)

    def step(self, now_ns: int) -> Action:
        """Record the action of one control instant, and the estimates on which it is based."""
        action = self._robot.step(now_ns)
        self._recorder.write(topics.action(self._unit), now_ns, action)
        if (estimate := self._robot.estimate) is not None:
            self._recorder.write(topics.estimate(self._unit), now_ns, estimate)
        if (los := self._robot.los) is not None:
            self._recorder.write(topics.los(self._unit), now_ns, los)
        if (arena := self._robot.arena) is not None:
            self._recorder.write(topics.situation(self._unit), now_ns, arena)
        if (monitor := self._robot.monitor) is not None:
            self._recorder.write(topics.monitor(self._unit), now_ns, monitor)
        if (assembly := self._robot.assembly) is not None:
            self._recorder.write(topics.assembly(self._unit), now_ns, assembly)
        if (path := self._robot.path) is not None and path is not self._path:
            self._recorder.write(topics.path(self._unit), now_ns, path)
            self._path = path
        self._recorder.write(topics.belief(self._unit), now_ns, self._robot.belief)
        return action
