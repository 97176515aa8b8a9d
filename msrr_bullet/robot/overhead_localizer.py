"""Localisation of all bodies in the arena with the overhead camera, on board of a unit."""

from __future__ import annotations

import math

from msrr_control.planning.free_space import Bounds
from msrr_perception.detection.detector import Detector
from msrr_perception.detection.overhead_vision import OverheadVision
from msrr_perception.pose.overhead_model import OverheadModel
from msrr_perception.pose.target import TargetModel
from msrr_perception.tracking.global_estimator import GlobalEstimator
from msrr_perception.tracking.seen_pose import SeenPoses
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import (
    NS_PER_S,
    OVERHEAD,
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

#: Period with which the overhead camera checks the surroundings of a unit that drives to the port [ns].
_CHECK_PERIOD_NS = NS_PER_S

#: Half the edge of the square on the floor that a check reads [m].
NEAR_HALF_M = 0.5

#: Middle of that square in frame U: at 0.25 m/s, twice the speed of the laws in front of a port, a post of
#: 8 cm is completely in the square while the unit can still stop.
_CHECK_CENTRE = SE2(0.2, 0.0, 0.0)

#: Period with which a unit of a mission reckons anew where bodies stand [s], of which there are many.
STANDING_PERIOD_S = 0.1


class OverheadLocalizer:
    """Estimator of what the overhead camera sees, for one unit.

    ``newest_ns`` is the exposure time of the newest measurement that has arrived; None before the first.
    """

    def __init__(
        self,
        scene: Scene,
        unit: str,
        drive: TargetModel,
        step: DockStep | None = None,
        standing_period_s: float = STANDING_PERIOD_S,
    ) -> None:
        """Set up for a scene that has an overhead camera.

        The step is the one in which the unit docks; None for a unit that drives without a target. The pose of
        a body that stands is given anew with the period ``standing_period_s``, or whenever it is asked for if
        that is 0.

        Raises:
            SceneError: The scene has no overhead camera, or a unit of the step has no tag for it.
        """
        needed = (unit,) if step is None else (unit, step.target_unit)
        self._model = model = OverheadModel.from_scene(scene, needed)
        self._estimator = GlobalEstimator(
            model,
            unit,
            drive,
            scene.odometry,
            delay_compensation=scene.control.delay_compensation,
            standing_period_s=standing_period_s,
        )
        self._scene, self._unit = scene, unit
        self._reach = {name: scene.geometry(name).circumradius for name in scene.units}
        self.aim(step)
        self.newest_ns: int | None = None

    def place_sigma(self, box: Bounds) -> tuple[float, float]:
        """Return :meth:`~msrr_perception.pose.overhead_model.OverheadModel.place_sigma` of the unit."""
        return self._model.place_sigma(self._unit, box)

    def aim(self, step: DockStep | None) -> None:
        """Take the target of another step, or none; nothing that has been seen is forgotten."""
        if step is None:
            self._estimator.aim(None, None)
        else:
            self._estimator.aim(step.target_unit, self._scene.dock_frame(step))

    def receive(self, message: SensorMessage) -> None:
        """Process a sensor message; one that says nothing about the arena changes nothing."""
        match message:
            case WheelOdometry():
                self._estimator.add_odometry(message)
                return
            case Detections() if message.exposure.camera == OVERHEAD:
                self._estimator.add_detections(message)
                stamp_ns = message.exposure.stamp_ns
            case Localisation():
                self._estimator.add_detections(message.detections)
                stamp_ns = message.detections.exposure.stamp_ns
            case GlobalPose():
                self._estimator.add_pose(message)
                stamp_ns = message.stamp_ns
            case _:
                return
        self.newest_ns = stamp_ns if self.newest_ns is None else max(self.newest_ns, stamp_ns)

    def see(self, seen_poses: SeenPoses) -> None:
        """Take in what a base station has read from an overhead exposure."""
        self._estimator.add_seen_poses(seen_poses)
        newest_ns = seen_poses.stamp_ns if self.newest_ns is None else self.newest_ns
        self.newest_ns = max(newest_ns, seen_poses.stamp_ns)

    def estimate(self, now_ns: int, own: PoseEstimate | None) -> ArenaEstimate | None:
        """Return the estimated poses of all bodies; None before the unit and its target are known.

        ``own`` is the estimate of the unit in the dock frame by the onboard camera, which replaces that by
        the overhead camera; None to use the latter.
        """
        return self._estimator.estimate(now_ns, own)

    def target_may_be_pushed(self) -> bool:
        """Return whether another unit that moves is so near the target that the two may touch."""
        target = self._estimator.target
        at = None if target is None else self._estimator.seen_at(target)
        if target is None or at is None:
            return False
        for name in self._estimator.moving() & self._reach.keys() - {target}:
            other = self._estimator.seen_at(name)
            assert other is not None, "it moves, so that it has been seen"
            if math.hypot(other.x - at.x, other.y - at.y) < self._reach[name] + self._reach[target]:
                return True
        return False

    def in_dock_frame(self, stamp_ns: int) -> PoseEstimate | None:
        """Return the pose of the unit in the dock frame of its target by the overhead camera alone."""
        return self._estimator.in_dock_frame(stamp_ns)


class OverheadReader(OverheadLocalizer):
    """A localizer that reads the pictures of the overhead camera itself, for a unit on its own."""

    def __init__(self, scene: Scene, step: DockStep, drive: TargetModel, detector: Detector) -> None:
        """Set up for one step of the plan.

        Raises:
            SceneError: The scene has no overhead camera, or a unit of the step has no tag for it.
        """
        super().__init__(scene, step.unit, drive, step, standing_period_s=0.0)
        pair = (step.unit, step.target_unit)
        self._vision = OverheadVision(self._model, pair, detector)
        self._read_in_checks = pair if scene.control.overhead_correction else ()
        self._checked_ns = 0

    def receive(self, message: SensorMessage) -> None:
        """Process a sensor message; one that says nothing about the arena changes nothing."""
        super().receive(message)
        if isinstance(message, GlobalPose):  # parametric perception measures every body at once
            self._checked_ns = max(self._checked_ns, message.stamp_ns)

    def detect(self, exposure: Exposure, fetch: Fetch) -> Detections:
        """Detect all known bodies in an exposure, and new ones when a search is due."""
        self._checked_ns = exposure.stamp_ns
        predictions = self._estimator.predict(exposure.stamp_ns)
        return self._vision.detect(exposure, predictions, fetch)

    def check_is_due(self, now_ns: int) -> bool:
        """Return whether it is time to look for what the onboard camera does not see.

        It always is while a body moves: unseen, it could soon be anywhere.
        """
        return now_ns - self._checked_ns >= _CHECK_PERIOD_NS or bool(self._estimator.moving())

    def check(self, exposure: Exposure, X_WU: SE2, fetch: Fetch) -> Detections:
        """Detect bodies that move, those in a square of the floor before the unit at ``X_WU``, and the pair.

        The pair is left out where nothing corrects what the unit's own camera tells of it.
        """
        self._checked_ns = exposure.stamp_ns
        wanted, poses = self._estimator.moving(), self._estimator.predict(exposure.stamp_ns)
        wanted = wanted.union(self._read_in_checks)
        predictions = {name: pose for name, pose in poses.items() if name in wanted}
        middle_W = (X_WU @ _CHECK_CENTRE).translation
        return self._vision.detect_near(exposure, middle_W, NEAR_HALF_M, fetch, predictions)

    def restart_search(self) -> None:
        """Search the next exposure for new bodies, however recent the last search was."""
        self._vision.restart_search()
