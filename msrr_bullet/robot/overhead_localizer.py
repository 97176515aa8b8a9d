"""What the robot makes of the overhead camera: where everything stands in the arena."""

from __future__ import annotations

from msrr_perception.detection.detector import Detector
from msrr_perception.detection.overhead_vision import OverheadVision
from msrr_perception.estimation.global_estimator import GlobalEstimator
from msrr_perception.pose.overhead_model import OVERHEAD, OverheadModel
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import (
    ArenaEstimate,
    Detections,
    Exposure,
    Fetch,
    GlobalPose,
    Localisation,
    PoseEstimate,
    SensorMessage,
    WheelOdometry,
)
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.scene import Scene

#: Half the edge of the square that a glance looks at [m].
GLANCE_HALF_M = 0.5


class OverheadLocalizer:
    """Vision and estimator of the overhead camera, for one step of the plan."""

    def __init__(self, scene: Scene, step: DockStep, detector: Detector) -> None:
        """Set up for a scene that has an overhead camera.

        Raises:
            SceneError: The scene has none, or it cannot find a unit of the step.
        """
        self._model = OverheadModel.from_scene(scene, step)
        self._vision = OverheadVision(self._model, detector)
        self._estimator = GlobalEstimator(
            self._model, scene.odometry, delay_compensation=scene.control.delay_compensation
        )
        self._newest_ns: int | None = None

    @property
    def newest_ns(self) -> int | None:
        """Exposure time of the newest picture that has arrived; None before the first."""
        return self._newest_ns

    @classmethod
    def of(cls, scene: Scene, step: DockStep, detector: Detector) -> OverheadLocalizer | None:
        """Return the global sight of a scene; None when it has no overhead camera."""
        return cls(scene, step, detector) if scene.cameras.overhead is not None else None

    def look(self, exposure: Exposure, fetch: Fetch) -> Detections:
        """Look at an overhead exposure."""
        return self._vision.detect(exposure, self._estimator.predict(exposure.stamp_ns), fetch)

    def glance(self, exposure: Exposure, place: SE2, fetch: Fetch) -> Detections:
        """Look only at what stands around a place."""
        return self._vision.detect_near(exposure, place.translation, GLANCE_HALF_M, fetch)

    def receive(self, message: SensorMessage) -> None:
        """Take in a message; those that say nothing of the arena change nothing."""
        match message:
            case WheelOdometry():
                self._estimator.add_odometry(message)
            case Detections() if message.exposure.camera == OVERHEAD:
                self._estimator.add_detections(message)
                self._arrived(message.exposure.stamp_ns)
            case Localisation():
                self._estimator.add_detections(message.detections)
                self._arrived(message.detections.exposure.stamp_ns)
            case GlobalPose():
                self._estimator.add_pose(message)
                self._arrived(message.stamp_ns)

    def _arrived(self, stamp_ns: int) -> None:
        self._newest_ns = stamp_ns if self._newest_ns is None else max(self._newest_ns, stamp_ns)

    def search_next(self) -> None:
        """Search the next exposure for what is new, however short ago the last one was searched."""
        self._vision.restart_search()

    def situation(self, now_ns: int, by_sight: PoseEstimate | None) -> ArenaEstimate | None:
        """Return where everything is.

        Args:
            now_ns: The time.
            by_sight: The unit in the dock frame as its own camera sees it, when that is to be believed
                rather than the view from above; None for the latter.
        """
        return self._estimator.estimate(now_ns, by_sight)
