"""The sensors of a docking unit with rates, latencies and faults.

Only sensors, encoders and switches turn the truth into messages for a robot.
"""

from __future__ import annotations

from collections.abc import Sequence

from msrr_bullet.plant.plant import Plant
from msrr_bullet.profiler import Profiler
from msrr_bullet.robot.interface import CameraReader, Robot
from msrr_bullet.sensors.camera_sensors import RenderedCameraSensor
from msrr_bullet.sensors.parametric_cameras import ParametricOnboardCamera, ParametricOverheadCamera
from msrr_bullet.sensors.schedule import Delayed, Periodic
from msrr_bullet.sensors.wheel_encoders import WheelEncoders
from msrr_scenes.messages import (
    Detections,
    LockFeedback,
    LockPosition,
    PoseMeasurement,
    SeatSwitches,
    SensorMessage,
    onboard_camera,
)
from msrr_scenes.specs.faults import SeatSwitchStuck
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.scene import Scene

#: A source of the measurements of one camera: rendered pixels, or a model of camera and detector.
CameraSensor = RenderedCameraSensor | ParametricOnboardCamera | ParametricOverheadCamera


class MountedCamera:
    """A camera, its frame timer and its latency queue; ``next_ns`` is when one of the two is due."""

    def __init__(self, sensor: CameraSensor, now_ns: int) -> None:
        """Start now; the first frame is due at once."""
        self.sensor = sensor
        self._frames = Periodic(sensor.spec.rate_hz, now_ns)
        self._arrival_ns = 0
        self._queue: Delayed[SensorMessage] = Delayed()
        self.next_ns: float = now_ns

    def tick(self, now_ns: int, reader: CameraReader) -> list[SensorMessage]:
        """Capture a frame if one is due and the reader uses it; return the messages that have arrived."""
        if now_ns < self.next_ns:
            return []
        if self._frames.due(now_ns) and reader.uses_camera(self.sensor.name):
            messages = self.sensor.capture(now_ns, reader)
            latency_ns = self.sensor.frames.next_latency_ns()
            if messages:  # a frame that is lost holds none up
                # Frames are read one after the other: none overtakes the one before.
                self._arrival_ns = max(now_ns + latency_ns, self._arrival_ns)
            for message in messages:
                self._queue.send(self._arrival_ns, message)
        arrived = self._queue.arrived(now_ns)
        self.next_ns = min(self._frames.next_ns, self._queue.next_ns)
        return arrived


class SensorSuite:
    """All sensors of one unit.

    ``ever_detected`` is whether any measurement of the target has arrived; at ``next_ns`` the next
    measurement is due or the next message arrives.
    """

    def __init__(
        self,
        scene: Scene,
        unit: str,
        step: DockStep | None,
        plant: Plant,
        encoders: WheelEncoders,
        cameras: Sequence[CameraSensor],
        profiler: Profiler,
    ) -> None:
        """Start all sensors of a unit now.

        The scene has rates, faults and the tags of the target; the step is None without one. True motor
        angles, switches and lock positions are those of the plant, and the cameras are those that the unit
        can read.
        """
        now_ns = plant.now_ns()
        self._unit = unit
        self._plant = plant
        self._encoders = encoders
        self._encoder_timer = Periodic(scene.odometry.rate_hz, now_ns)
        self._cameras = [MountedCamera(camera, now_ns) for camera in cameras]
        self._onboard = onboard_camera(unit)
        target = None if step is None else step.target_unit
        self._target_tags = frozenset(() if target is None else scene.tag_ids(target).values())
        self._profiler = profiler
        self._stuck_at: bool | None = None
        for fault in scene.faults:
            if isinstance(fault, SeatSwitchStuck) and fault.unit == target:
                self._stuck_at = fault.value == "closed"
        self._last_switches: tuple[bool, bool] | None = None
        self._last_lock_position: LockPosition | None = None
        self.ever_detected = False
        self.next_ns: float = now_ns

    def tick(self, now_ns: int, robot: Robot) -> None:
        """Make the measurements that are due at this tick and deliver the messages that have arrived."""
        if now_ns < self.next_ns:
            return
        if self._encoder_timer.due(now_ns):
            with self._profiler("odometry"):
                robot.receive(self._encoders.read(self._plant.motor_angles(self._unit), now_ns))
            # Switches and lock are polled at the rate of the encoders and report changes only.
            self._report_mechanism(now_ns, robot)
        next_ns: float = self._encoder_timer.next_ns
        for camera in self._cameras:
            for message in camera.tick(now_ns, robot):
                self.ever_detected |= self._shows_target(message)
                with self._profiler("perception"):
                    robot.receive(message)
            next_ns = min(next_ns, camera.next_ns)
        self.next_ns = next_ns

    def _shows_target(self, message: SensorMessage) -> bool:
        if isinstance(message, Detections):
            detected = {tag.tag_id for tag in message.tags}
            return message.exposure.camera == self._onboard and not self._target_tags.isdisjoint(detected)
        return isinstance(message, PoseMeasurement)

    def _report_mechanism(self, now_ns: int, robot: Robot) -> None:
        switches = self._plant.switches(self._unit)
        if self._stuck_at is not None:
            switches = (self._stuck_at, self._stuck_at)
        if switches != self._last_switches:
            self._last_switches = switches
            robot.receive(SeatSwitches(self._unit, now_ns, *switches))
        position = self._plant.lock_position(self._unit)
        if position is not self._last_lock_position:
            self._last_lock_position = position
            robot.receive(LockFeedback(self._unit, now_ns, position))
