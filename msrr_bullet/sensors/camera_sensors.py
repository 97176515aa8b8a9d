"""The cameras of a trial and what stands behind them: a robot that reads pixels, or a model of both."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Protocol

import numpy as np

from msrr_bullet.profiler import Profiler
from msrr_bullet.sensors import parametric_pose as parametric
from msrr_bullet.sensors.camera import Camera
from msrr_bullet.sensors.localisation_error import LocalisationError
from msrr_bullet.trial.environment import Stage
from msrr_perception.pose.global_pose import overhead_pose
from msrr_perception.pose.overhead_model import OVERHEAD, OverheadModel
from msrr_scenes.geometry.pinhole import Window, optical_pose
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.messages import (
    Detections,
    Exposure,
    Fetch,
    GlobalPose,
    Localisation,
    Pixels,
    SensorMessage,
    seconds,
)
from msrr_scenes.specs.faults import CameraBlackout, CameraMisaligned, MarkerHidden
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.sensors import CameraSpec


class Reader(Protocol):
    """Reads pixels at the instant of an exposure."""

    def expose(self, exposure: Exposure, fetch: Fetch) -> Detections | None:
        """Look at an exposure through ``fetch``."""
        ...


class CameraSensor(Protocol):
    """Measures at one instant what one camera shows."""

    @property
    def name(self) -> str:
        """Name of the camera."""
        ...

    @property
    def spec(self) -> CameraSpec:
        """Its rate and latency."""
        ...

    def look(self, now_ns: int, robot: Reader) -> tuple[SensorMessage, ...]:
        """Take one exposure; nothing when it was lost or showed nothing."""
        ...


def camera_pose(scene: Scene, unit: str) -> SE3:
    """Return where a unit's camera really is: ``X_UB``, x along its axis; calibration errors included."""
    X_UB = scene.geometry(unit).frame("camera")
    for fault in scene.faults:
        if isinstance(fault, CameraMisaligned) and fault.unit == unit:
            X_UB = X_UB @ SE3.from_se2(SE2(0.0, 0.0, math.radians(fault.yaw_deg)))
    return X_UB


class RenderedCameraSensor:
    """A rendered camera whose pixels the robot reads."""

    def __init__(
        self,
        camera: Camera,
        clock: Profiler,
        spoil: Callable[[Detections], Detections] | None = None,
    ) -> None:
        """Put a camera before the robot; ``spoil`` puts errors on what is made of its frames."""
        self.camera = camera
        self._clock = clock
        self._spoil = spoil

    @classmethod
    def onboard(cls, stage: Stage, step: DockStep, clock: Profiler) -> RenderedCameraSensor:
        """Return the camera of the docking unit."""
        scene, plant, unit = stage.scene, stage.plant, step.unit
        X_UC = optical_pose(camera_pose(scene, unit))
        camera = stage.camera(f"{unit}/onboard", scene.cameras.onboard, lambda: plant.pose3(unit) @ X_UC)
        return cls(camera, clock)

    @classmethod
    def overhead(cls, stage: Stage, step: DockStep, clock: Profiler) -> RenderedCameraSensor:
        """Return the camera above the arena. Its place is calibrated, so truth and belief are one."""
        scene = stage.scene
        spec = scene.cameras.overhead
        assert spec is not None, "asked for only when the scene has one"
        X_WC = overhead_pose(spec)
        camera = stage.camera(OVERHEAD, spec, lambda: X_WC)
        if spec.localisation == type(spec.localisation)():
            return cls(camera, clock)
        error = stage.localisation
        if error is None:
            error = stage.localisation = LocalisationError(spec.localisation, stage.seed)
        model = OverheadModel.from_scene(scene, step)
        return cls(camera, clock, lambda found: error.apply(found, model))

    @property
    def name(self) -> str:
        """Name of the camera."""
        return self.camera.name

    @property
    def spec(self) -> CameraSpec:
        """Its rate and latency."""
        return self.camera.spec

    def look(self, now_ns: int, robot: Reader) -> tuple[SensorMessage, ...]:
        """Expose, and let the robot read what it wants of the frame."""
        exposure = self.camera.expose(now_ns)
        if exposure is None:
            return ()
        with self._clock("perception"):
            found = robot.expose(exposure, self._fetch)
        if found is None:
            return ()
        return (found,) if self._spoil is None else (Localisation(self._spoil(found)),)

    def _fetch(self, window: Window) -> Pixels:
        with self._clock("render"):
            return self.camera.fetch(window)


class FrameDropout:
    """Which frames of a camera are lost; drawn for every frame, whatever else becomes of it."""

    def __init__(self, camera: str, spec: CameraSpec, stage: Stage) -> None:
        self._dropout = spec.dropout
        self._rng = stage.stream(f"camera/{camera}/dropout")
        self._blackouts = [
            f for f in stage.scene.faults if isinstance(f, CameraBlackout) and f.camera == camera
        ]

    def lost(self, now_ns: int) -> bool:
        """Draw for the next frame, exposed at ``now_ns``; return whether it is lost."""
        dropped = self._rng.random() < self._dropout
        return dropped or any(f.from_s <= seconds(now_ns) < f.to_s for f in self._blackouts)


class ParametricOnboardCamera:
    """A model of the onboard camera and its detector together: the true pose with stated errors."""

    def __init__(self, stage: Stage, step: DockStep, X_DU: Callable[[], SE2]) -> None:
        """Measure ``X_DU`` (truth) as ``scene.parametric`` says."""
        self._scene = scene = stage.scene
        self._X_DU = X_DU
        self._X_UC = camera_pose(scene, step.unit).to_se2()
        self.name = f"{step.unit}/onboard"
        self.spec: CameraSpec = scene.cameras.onboard
        self._rng = stage.stream(f"camera/{self.name}/parametric")
        self._luck = FrameDropout(self.name, self.spec, stage)
        self._hidden = any(isinstance(f, MarkerHidden) and f.unit == step.target_unit for f in scene.faults)
        self._frames = stage.frames(self.name)

    def look(self, now_ns: int, robot: Reader) -> tuple[SensorMessage, ...]:
        """Draw one measurement; nothing when the frame was lost or shows no marker."""
        frame = next(self._frames)
        lost = self._luck.lost(now_ns)
        measured = parametric.measure(
            Exposure(self.name, frame, now_ns),
            self._X_DU(),
            self._X_UC,
            self.spec.pinhole,
            self._scene.los,
            self._scene.parametric,
            self._rng,
        )
        return () if lost or self._hidden or measured is None else (measured,)


class ParametricOverheadCamera:
    """A model of the overhead camera and its detector together: true poses with stated errors."""

    def __init__(self, stage: Stage) -> None:
        """Measure every body on ``stage`` as ``scene.parametric`` says."""
        spec = stage.scene.cameras.overhead
        assert spec is not None, "asked for only when the scene has one"
        self._stage = stage
        self.name = OVERHEAD
        self.spec: CameraSpec = spec
        self._rng = stage.stream(f"camera/{OVERHEAD}/parametric")
        self._luck = FrameDropout(OVERHEAD, spec, stage)

    def look(self, now_ns: int, robot: Reader) -> tuple[SensorMessage, ...]:
        """Draw one measurement of every body that is there."""
        scene = self._stage.scene
        lost = self._luck.lost(now_ns)
        poses: Mapping[str, SE2] = self._stage.poses()
        sigma = np.array(
            [
                scene.parametric.sigma_xy_m,
                scene.parametric.sigma_xy_m,
                math.radians(scene.parametric.sigma_yaw_deg),
            ]
        )
        # Drawn for every body of the scene, there or not: a late one leaves the others' luck alone.
        noise = {name: sigma * self._rng.standard_normal(3) for name in (*scene.units, *scene.obstacles)}
        covariance = np.diag(np.maximum(sigma, parametric.LEAST_SIGMA) ** 2)
        if lost:
            return ()
        return tuple(
            GlobalPose(
                name,
                now_ns,
                SE2(X.x + noise[name][0], X.y + noise[name][1], X.yaw + noise[name][2]),
                covariance,
            )
            for name, X in poses.items()
        )
