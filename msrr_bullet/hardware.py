"""The robot's hardware as simulated: its sensors with their rates, latencies and faults.

This is the one place where truth is turned into what a robot may know.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Protocol

from msrr_bullet import parametric
from msrr_bullet.camera import Camera
from msrr_bullet.odometry import WheelEncoders
from msrr_bullet.plant import Plant
from msrr_bullet.render.renderer import Renderer
from msrr_bullet.schedule import Delayed, Periodic, duration_ns
from msrr_bullet.stage_clock import Clock
from msrr_bullet.streams import stream
from msrr_scenes.faults import CameraBlackout, CameraMisaligned, MarkerHidden, SeatSwitchStuck
from msrr_scenes.messages import (
    Detections,
    Exposure,
    Fetch,
    LockFeedback,
    LockPosition,
    Pixels,
    PoseMeasurement,
    SeatSwitches,
    SensorMessage,
    seconds,
)
from msrr_scenes.pinhole import Window, optical_pose
from msrr_scenes.plan import DockStep
from msrr_scenes.scene import Scene
from msrr_scenes.se2 import SE2
from msrr_scenes.se3 import SE3


class Observer(Protocol):
    """The robot, as far as its sensors are concerned."""

    def expose(self, exposure: Exposure, fetch: Fetch) -> Detections | None:
        """Look at an exposure through ``fetch``."""
        ...

    def receive(self, now_ns: int, message: SensorMessage) -> None:
        """Take in a message that has arrived."""
        ...


class Eye(Protocol):
    """Measures the target at one instant: a camera with a robot behind it, or a model of both."""

    def look(self, now_ns: int, robot: Observer) -> Detections | PoseMeasurement | None:
        """Take one exposure; None when it was lost or showed nothing."""
        ...


def camera_pose(scene: Scene, unit: str) -> SE3:
    """Return where a unit's camera really is: ``X_UB``, x along its axis; calibration errors included."""
    X_UB = scene.geometry(unit).frame("camera")
    for fault in scene.faults:
        if isinstance(fault, CameraMisaligned) and fault.unit == unit:
            X_UB = X_UB @ SE3.from_se2(SE2(0.0, 0.0, math.radians(fault.yaw_deg)))
    return X_UB


class ImageEye:
    """An onboard camera whose pixels the robot reads."""

    def __init__(
        self, scene: Scene, unit: str, plant: Plant, renderer: Renderer, seed: int, clock: Clock
    ) -> None:
        """Mount the camera of ``unit``."""
        self._clock = clock
        X_UC = optical_pose(camera_pose(scene, unit))
        self.camera = Camera(
            f"{unit}/onboard",
            scene.cameras.onboard,
            renderer,
            lambda: plant.pose3(unit) @ X_UC,
            seed,
            scene.faults,
        )

    def look(self, now_ns: int, robot: Observer) -> Detections | None:
        """Expose, and let the robot read what it wants of the frame."""
        exposure = self.camera.expose(now_ns)
        if exposure is None:
            return None
        with self._clock("perception"):
            return robot.expose(exposure, self._fetch)

    def _fetch(self, window: Window) -> Pixels:
        with self._clock("render"):
            return self.camera.fetch(window)


class ParametricEye:
    """A model of camera and detector together: the true pose with stated errors."""

    def __init__(self, scene: Scene, step: DockStep, X_DU: Callable[[], SE2], seed: int) -> None:
        """Measure ``X_DU`` (truth) as ``scene.parametric`` says."""
        self._scene = scene
        self._X_DU = X_DU
        self._X_UC = camera_pose(scene, step.unit).to_se2()
        self._name = f"{step.unit}/onboard"
        self._rng = stream(seed, f"camera/{self._name}/parametric")
        self._dropout = stream(seed, f"camera/{self._name}/dropout")
        self._hidden = any(isinstance(f, MarkerHidden) and f.unit == step.target_unit for f in scene.faults)
        self._blackouts = [
            f for f in scene.faults if isinstance(f, CameraBlackout) and f.camera == self._name
        ]
        self._frame = -1

    def look(self, now_ns: int, robot: Observer) -> PoseMeasurement | None:
        """Draw one measurement; None when the frame was lost or shows no marker."""
        self._frame += 1
        # Drawn for every frame, so that a fault leaves the luck of later frames as it was.
        lost = self._dropout.random() < self._scene.cameras.onboard.dropout
        dark = any(f.from_s <= seconds(now_ns) < f.to_s for f in self._blackouts)
        measured = parametric.measure(
            Exposure(self._name, self._frame, now_ns),
            self._X_DU(),
            self._X_UC,
            self._scene.cameras.onboard.pinhole,
            self._scene.los,
            self._scene.parametric,
            self._rng,
        )
        return None if lost or dark or self._hidden else measured


class Hardware:
    """All sensors of one docking unit."""

    def __init__(
        self, scene: Scene, step: DockStep, plant: Plant, eye: Eye, encoders: WheelEncoders, clock: Clock
    ) -> None:
        """Wire up the sensors of ``step.unit``; all of them start now."""
        now_ns = plant.now_ns()
        self._unit = step.unit
        self._plant = plant
        self._eye = eye
        self._encoders = encoders
        self._clock = clock
        self._stuck = {
            f.value == "closed"
            for f in scene.faults
            if isinstance(f, SeatSwitchStuck) and f.unit == step.target_unit
        }
        onboard = scene.cameras.onboard
        self._frames = Periodic(onboard.rate_hz, now_ns)
        self._latency_ns = duration_ns(onboard.latency_ms * 1e-3)
        self._readings = Periodic(scene.odometry.rate_hz, now_ns)
        self._under_way: Delayed[Detections | PoseMeasurement] = Delayed()
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
        if self._frames.due(now_ns):
            found = self._eye.look(now_ns, robot)
            if found is not None:
                self.ever_detected |= isinstance(found, PoseMeasurement) or bool(found.tags)
                self._under_way.send(now_ns + self._latency_ns, found)
        for message in self._under_way.arrived(now_ns):
            robot.receive(now_ns, message)

    def _report_mechanism(self, now_ns: int, robot: Observer) -> None:
        seat = self._plant.switches(self._unit)
        if self._stuck:
            value = True in self._stuck
            seat = (value, value)
        if seat != self._seat:
            self._seat = seat
            robot.receive(now_ns, SeatSwitches(self._unit, now_ns, *seat))
        cam = self._plant.lock_position(self._unit)
        if cam is not self._cam:
            self._cam = cam
            robot.receive(now_ns, LockFeedback(self._unit, now_ns, cam))
