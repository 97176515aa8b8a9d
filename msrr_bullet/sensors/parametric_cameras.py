"""Cameras without pixels: models of a camera and its detector together, the true pose with stated errors."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np

from msrr_bullet.robot.interface import Robot
from msrr_bullet.sensors import parametric_pose
from msrr_bullet.sensors.frame_dropout import FrameDropout
from msrr_bullet.simulation.camera_mount import camera_pose
from msrr_perception.pose.overhead_model import OVERHEAD
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import Exposure, GlobalPose, SensorMessage
from msrr_scenes.specs.faults import MarkerHidden
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.sensors import CameraSpec


class ParametricOnboardCamera:
    """A model of the onboard camera of the docking unit and its detector."""

    def __init__(
        self,
        scene: Scene,
        step: DockStep,
        X_DU: Callable[[], SE2],
        rng: np.random.Generator,
        dropout: FrameDropout,
    ) -> None:
        """Measure the unit of ``step`` in the dock frame of its target.

        Args:
            scene: The scene; ``scene.parametric`` states the errors.
            step: The step of the plan.
            X_DU: Returns the true pose of the unit in the dock frame.
            rng: Generator of the measurement errors, used by nobody else.
            dropout: The lost frames of this camera.
        """
        self.name = f"{step.unit}/onboard"
        self.spec: CameraSpec = scene.cameras.onboard
        self._scene = scene
        self._X_DU = X_DU
        self._X_UC = camera_pose(scene, step.unit).to_se2()
        self._rng = rng
        self._dropout = dropout
        self._hidden = any(isinstance(f, MarkerHidden) and f.unit == step.target_unit for f in scene.faults)

    def capture(self, now_ns: int, robot: Robot) -> tuple[SensorMessage, ...]:
        """Draw one measurement; nothing when the frame was lost or shows no marker."""
        frame, lost = self._dropout.next_frame(now_ns)
        measured = parametric_pose.measure(
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
    """A model of the overhead camera and its detector."""

    def __init__(
        self,
        scene: Scene,
        spec: CameraSpec,
        poses: Callable[[], Mapping[str, SE2]],
        rng: np.random.Generator,
        dropout: FrameDropout,
    ) -> None:
        """Measure every body that stands in the world.

        Args:
            scene: The scene; ``scene.parametric`` states the errors.
            spec: Data sheet of the camera.
            poses: Returns the true ``X_WB`` of every body that stands in the world now.
            rng: Generator of the measurement errors, used by nobody else.
            dropout: The lost frames of this camera.
        """
        self.name = OVERHEAD
        self.spec = spec
        self._bodies = (*scene.units, *scene.obstacles)
        self._poses = poses
        self._rng = rng
        self._dropout = dropout
        xy, yaw = scene.parametric.sigma_xy_m, math.radians(scene.parametric.sigma_yaw_deg)
        self._sigma = np.array([xy, xy, yaw])
        self._covariance = np.diag(np.maximum(self._sigma, parametric_pose.LEAST_SIGMA) ** 2)

    def capture(self, now_ns: int, robot: Robot) -> tuple[SensorMessage, ...]:
        """Draw one measurement of every body; nothing when the frame was lost."""
        _, lost = self._dropout.next_frame(now_ns)
        # Errors are drawn for all bodies of the scene, so that one that appears late changes no other's.
        errors = {name: self._sigma * self._rng.standard_normal(3) for name in self._bodies}
        if lost:
            return ()
        return tuple(
            GlobalPose(
                name,
                now_ns,
                SE2(X.x + errors[name][0], X.y + errors[name][1], X.yaw + errors[name][2]),
                self._covariance,
            )
            for name, X in self._poses().items()
        )
