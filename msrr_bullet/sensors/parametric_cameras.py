"""Cameras without pixels: models of camera and detector together that add stated errors to the true pose.

They belong to the simulation and not to perception, because they read the truth. A trial that uses them says
so in the result. They serve to study controllers in thousands of trials and to attribute failures.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np

from msrr_bullet.robot.interface import CameraReader
from msrr_bullet.sensors.calibrated_sight import Bearings, OnboardSight, OverheadSight
from msrr_bullet.sensors.frame_sequence import FrameSequence
from msrr_scenes.arrays import frozen
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import (
    OVERHEAD,
    GlobalPose,
    PoseMeasurement,
    SensorMessage,
    onboard_camera,
)
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.sensors import CameraSpec

#: Smallest standard deviation that a measurement states [m, rad]: with 0 a filter would ignore everything
#: else.
MIN_SIGMA = 1e-4


class ParametricOnboardCamera:
    """A model of the onboard camera of the docking unit and its detector."""

    def __init__(
        self,
        scene: Scene,
        step: DockStep,
        X_DU: Callable[[], SE2],
        rng: np.random.Generator,
        frames: FrameSequence,
        sight: OnboardSight | None = None,
    ) -> None:
        """Measure the docking unit of ``step`` in the dock frame of the target.

        ``scene.parametric`` states the errors; no other object uses ``rng``, of which they are drawn.
        ``X_DU`` returns the true pose. ``sight`` is what the robot makes of what was built; None if all is as
        designed.
        """
        self.name = onboard_camera(step.unit)
        self.spec: CameraSpec = scene.cameras.onboard
        self._los = scene.los
        self._X_DU = X_DU
        self._X_UC = scene.geometry(step.unit).frame("camera").to_se2()
        self.frames = frames
        self._sight = sight
        self._rng = rng
        self._hidden = step.target_unit in scene.covered_units
        errors = scene.parametric
        self._sigma_bearing = math.radians(errors.sigma_bearing_deg)
        self._sigma_pose = (errors.sigma_xy_m, errors.sigma_xy_m, math.radians(errors.sigma_yaw_deg))
        self._covariance = frozen(np.diag([max(sigma, MIN_SIGMA) ** 2 for sigma in self._sigma_pose]))

    def capture(self, now_ns: int, reader: CameraReader) -> tuple[SensorMessage, ...]:
        """Draw one measurement; none when the frame was lost or nothing of the target is in view."""
        exposure = self.frames.expose(now_ns)
        noise = self._rng.standard_normal(5).tolist()  # as many for every frame, whatever is seen
        X_DU, bearings = self._see(self._X_DU())
        if exposure is None or self._hidden or X_DU is None:
            return ()
        left, right = (
            None if bearing is None else bearing + self._sigma_bearing * n
            for bearing, n in zip(bearings, noise[3:], strict=True)
        )
        dx, dy, dyaw = (sigma * n for sigma, n in zip(self._sigma_pose, noise[:3], strict=True))
        X_measured = SE2(X_DU.x + dx, X_DU.y + dy, X_DU.yaw + dyaw)
        return (PoseMeasurement(exposure, X_measured, self._covariance, (left, right)),)

    def _see(self, X_DU: SE2) -> tuple[SE2 | None, Bearings]:
        """Return pose and bearings without their random errors; None where there are none.

        As designed, the pose is measured wherever an edge is in view. As built it takes a whole tag, which
        may be one between the edges.
        """
        if self._sight is not None:
            return self._sight.see(X_DU)
        to_left, to_right = self.spec.lens.field_of_view
        left, right = (
            bearing if -to_right <= bearing <= to_left else None
            for bearing in self._los.edge_bearings(X_DU @ self._X_UC)
        )
        return (None if left is None and right is None else X_DU), (left, right)


class ParametricOverheadCamera:
    """A model of the overhead camera and its detector."""

    def __init__(
        self,
        scene: Scene,
        spec: CameraSpec,
        poses: Callable[[], Mapping[str, SE2]],
        errors: Callable[[str], np.random.Generator],
        frames: FrameSequence,
        sight: OverheadSight | None = None,
    ) -> None:
        """Measure every body that stands in the world and has a tag, as the detector of the camera does.

        ``poses`` returns the true ``X_WB`` of these bodies, and ``errors`` the generator of the errors of a
        body, so that these do not depend on other bodies. All else is as for
        :class:`ParametricOnboardCamera`.
        """
        self.name = OVERHEAD
        self.spec = spec
        self._errors = {name: errors(name) for name in (*scene.units, *scene.obstacles)}
        self._untagged = {name for name, obstacle in scene.obstacles.items() if obstacle.tag_id is None}
        self._untagged |= {unit for unit in scene.units if "tag_top" not in scene.tag_ids(unit)}
        self._untagged |= scene.covered_units
        self._poses = poses
        self.frames, self._sight = frames, sight
        xy, yaw = scene.parametric.sigma_xy_m, math.radians(scene.parametric.sigma_yaw_deg)
        self._sigma = np.array([xy, xy, yaw])
        self._covariance = frozen(np.diag(np.maximum(self._sigma, MIN_SIGMA) ** 2))

    def capture(self, now_ns: int, reader: CameraReader) -> tuple[SensorMessage, ...]:
        """Draw one measurement of every body; none when the frame was lost."""
        exposure = self.frames.expose(now_ns)
        # Errors are drawn for all bodies of the scene, so that the errors do not depend on who has appeared.
        errors = {name: self._sigma * rng.standard_normal(3) for name, rng in self._errors.items()}
        if exposure is None:
            return ()
        seen = {name: self._see(name, X_WB) for name, X_WB in self._poses().items()}
        return tuple(
            GlobalPose(
                name,
                exposure.stamp_ns,
                SE2(X.x + errors[name][0], X.y + errors[name][1], X.yaw + errors[name][2]),
                self._covariance,
            )
            for name, X in seen.items()
            if X is not None
        )

    def _see(self, name: str, X_WB: SE2) -> SE2 | None:
        """Return the pose of a body without its random error; None if it is not seen."""
        if name in self._untagged:
            return None
        return X_WB if self._sight is None else self._sight.see(name, X_WB)
