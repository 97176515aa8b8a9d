"""The docking unit's hardware as simulated: its sensors with their rates, latencies and faults.

Together with the eyes this is the one place where truth is turned into what a robot may know.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from msrr_bullet.profiler import Profiler
from msrr_bullet.sensors.camera_sensors import CameraSensor, Reader
from msrr_bullet.sensors.schedule import Delayed, Periodic, duration_ns
from msrr_bullet.trial.environment import Stage
from msrr_scenes.messages import (
    Detections,
    LockFeedback,
    LockPosition,
    PoseMeasurement,
    SeatSwitches,
    SensorMessage,
)
from msrr_scenes.specs.faults import SeatSwitchStuck
from msrr_scenes.specs.plan import DockStep


class Observer(Reader, Protocol):
    """The robot, as far as its sensors are concerned."""

    def wants(self, camera: str) -> bool:
        """Say whether the robot has a use for the frames of ``camera`` now."""
        ...

    def receive(self, now_ns: int, message: SensorMessage) -> None:
        """Take in a message that has arrived."""
        ...


class _MountedCamera:
    """An eye with its clockwork: when it looks, and how long what it saw is under way."""

    def __init__(self, eye: CameraSensor, now_ns: int) -> None:
        self.eye = eye
        self._frames = Periodic(eye.spec.rate_hz, now_ns)
        self._latency_ns = duration_ns(eye.spec.latency_ms * 1e-3)
        self._under_way: Delayed[SensorMessage] = Delayed()

    def tick(self, now_ns: int, robot: Observer) -> list[SensorMessage]:
        """Look if a frame is due that somebody wants; return what has arrived."""
        if self._frames.due(now_ns) and robot.wants(self.eye.name):
            for message in self.eye.look(now_ns, robot):
                self._under_way.send(now_ns + self._latency_ns, message)
        return self._under_way.arrived(now_ns)


class SensorSuite:
    """All sensors of one docking unit."""

    def __init__(self, stage: Stage, step: DockStep, eyes: Sequence[CameraSensor], clock: Profiler) -> None:
        """Wire up the sensors of ``step.unit``; all of them start now."""
        now_ns = stage.plant.now_ns()
        self._unit = step.unit
        self._plant = stage.plant
        self._eyes = [_MountedCamera(eye, now_ns) for eye in eyes]
        self._onboard = f"{step.unit}/onboard"
        self._targets_tags = frozenset(stage.scene.tag_ids(step.target_unit).values())
        self._encoders = stage.encoders[step.unit]
        self._clock = clock
        self._stuck: bool | None = None
        for fault in stage.scene.faults:
            if isinstance(fault, SeatSwitchStuck) and fault.unit == step.target_unit:
                self._stuck = fault.value == "closed"
        self._readings = Periodic(stage.scene.odometry.rate_hz, now_ns)
        self._seat: tuple[bool, bool] | None = None
        self._cam: LockPosition | None = None
        self.ever_detected = False

    def tick(self, now_ns: int, robot: Observer) -> None:
        """Take what is due at this tick and hand over what has arrived."""
        if self._readings.due(now_ns):
            with self._clock("odometry"):
                reading = self._encoders.read(self._plant.wheel_angles(self._unit), now_ns)
                robot.receive(now_ns, reading)
            # Switches and cam speak when they change; asked as often as the encoders.
            self._report_mechanism(now_ns, robot)
        for mounted in self._eyes:
            for message in mounted.tick(now_ns, robot):
                self.ever_detected |= self._shows_target(message)
                with self._clock("perception"):
                    robot.receive(now_ns, message)

    def _shows_target(self, message: SensorMessage) -> bool:
        if isinstance(message, Detections):
            seen = {tag.tag_id for tag in message.tags}
            return message.exposure.camera == self._onboard and not self._targets_tags.isdisjoint(seen)
        return isinstance(message, PoseMeasurement)

    def _report_mechanism(self, now_ns: int, robot: Observer) -> None:
        seat = self._plant.switches(self._unit)
        if self._stuck is not None:
            seat = (self._stuck, self._stuck)
        if seat != self._seat:
            self._seat = seat
            robot.receive(now_ns, SeatSwitches(self._unit, now_ns, *seat))
        cam = self._plant.lock_position(self._unit)
        if cam is not self._cam:
            self._cam = cam
            robot.receive(now_ns, LockFeedback(self._unit, now_ns, cam))
