"""Poses of all bodies in the world, from overhead detections and the docking unit's own wheels.

The docking unit is tracked by the filter that also tracks it at close range, with the world in the place of
the dock frame, because its wheels tell how it moves; every other body has a track of its own. Errors of
calibration of the camera are common to all of them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from msrr_perception.estimation.corner_filter import CornerEkf
from msrr_perception.motion.motion_noise import MotionNoise
from msrr_perception.pose.overhead_model import OverheadModel, moved_along
from msrr_perception.pose.target import TargetModel
from msrr_perception.tracking.arena_tracker import ArenaTracker
from msrr_perception.tracking.body_track import StandstillDetector
from msrr_perception.tracking.seen_pose import SeenPose, SeenPoses
from msrr_scenes.arrays import frozen
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import (
    OVERHEAD,
    ArenaEstimate,
    Detections,
    Exposure,
    GlobalPose,
    PoseEstimate,
    PoseMeasurement,
    WheelOdometry,
)
from msrr_scenes.specs.sensors import OdometrySpec

#: Motion of the docking unit that its encoders do not measure, far from any port. The world takes the place
#: of frame D: there is no face at x = 0 and so no contact zone.
_OWN_MOTION = MotionNoise(slip=3e-4, sideways=2e-4, contact_zone=-math.inf, drift=1e-5, turn_drift=1e-4)


class GlobalEstimator:
    """Estimates the poses of a unit that drives, its target, other units and obstacles in W.

    A measurement of the unit takes effect at the time of its exposure, however late it arrives; of another
    body that drives, only measurements count that are newer than the last. Between exposures the wheels move
    the unit, and its covariance grows with the distance driven.

    Attributes:
        unit: Name of the unit whose wheels are known.
        target: Name of the unit that it docks to; None without a target.
    """

    def __init__(
        self,
        model: OverheadModel,
        unit: str,
        drive: TargetModel,
        odometry: OdometrySpec,
        *,
        delay_compensation: bool = True,
        standing_period_s: float = 0.0,
    ) -> None:
        """Create an estimator that knows nothing yet.

        With ``delay_compensation`` the pose of the unit is moved from the last exposure up to now.
        ``standing_period_s`` is that of :class:`~msrr_perception.tracking.arena_tracker.ArenaTracker`.
        """
        self.unit, self._model = unit, model
        self.aim(None, None)
        self._units = model.units
        self._own = CornerEkf(
            drive.seen_from_above(model.roof(unit)),
            odometry,
            delay_compensation=delay_compensation,
            motion=replace(_OWN_MOTION, strain=model.errors.strain),
        )
        self._others = ArenaTracker(model, standing_period_s)
        self._clock_s, self._strain = model.errors.clock_s, model.errors.strain
        self.reset()

    def aim(self, target: str | None, X_TD: SE2 | None) -> None:
        """Take another target; nothing is forgotten.

        ``X_TD`` is the dock frame of its port in the frame of that unit. Both are None without a target.
        """
        self.target, self._X_TD = target, X_TD

    def reset(self) -> None:
        """Forget every pose, but not the encoder readings."""
        self._own.reset()
        self._others.reset()
        self._own_standstill: StandstillDetector | None = None
        self._own_seen: SeenPose | None = None
        self._located = False  # whether the unit has been seen, so that its pose is known

    def add_odometry(self, reading: WheelOdometry) -> None:
        """Add an encoder reading; those of other units change nothing."""
        if reading.unit == self.unit:
            self._own.add_odometry(reading)

    def add_detections(self, detections: Detections) -> None:
        """Add the tags of one overhead exposure; those of other cameras change nothing."""
        self.add_seen_poses(self._others.locate(detections))

    def add_pose(self, pose: GlobalPose) -> None:
        """Add a measured pose whose errors are drawn anew each time, as those of parametric perception."""
        self.add_seen_poses(self._others.locate(pose))

    def add_seen_poses(self, seen_poses: SeenPoses) -> None:
        """Add what an overhead exposure shows."""
        for seen in seen_poses.poses:
            self._add(seen)

    def _add(self, seen: SeenPose) -> None:
        pose = seen.pose
        if pose.name != self.unit:
            self._others.add(seen)
            return
        exposure = Exposure(OVERHEAD, 0, pose.stamp_ns)
        covariance = pose.covariance
        if self._clock_s:  # the stamp is off by a time of which only the deviation is known
            way = self._clock_s * self._own.velocity(pose.stamp_ns)
            covariance = covariance + way[:, None] * way
        self._own.add_pose(PoseMeasurement(exposure, pose.X_WB, covariance, (None, None)))
        if self._own_seen is not None and pose.stamp_ns <= self._own_seen.pose.stamp_ns:
            return  # late or delivered again, it does not tell whether the unit stands
        standstill = self._own_standstill
        self._own_standstill = standstill.after(seen) if standstill else StandstillDetector(seen)
        self._own_seen = seen

    def predict(self, stamp_ns: int) -> Mapping[str, GlobalPose]:
        """Return the pose of every known body at an instant, for planning windows."""
        own = self._own.predict(stamp_ns)
        found = {} if own is None else {self.unit: self._own_pose(own)}
        return found | self._others.poses(stamp_ns)

    def moving(self) -> set[str]:
        """Return the other bodies that drive, or were pushed and have not been seen to stand since."""
        return self._others.moving()

    def seen_at(self, name: str) -> SE2 | None:
        """Return where another body was seen last, as measured; None if it never was."""
        return self._others.seen_at(name) if self._others.knows(name) else None

    def estimate(self, now_ns: int, by_sight: PoseEstimate | None = None) -> ArenaEstimate | None:
        """Return the estimate for control; None until the unit and its target, if any, have been seen.

        ``by_sight`` is the pose of the unit in the dock frame by its own camera, which then replaces its pose
        by the overhead camera.
        """
        if self.target is not None and not self._others.knows(self.target):
            return None
        # The filter is not evaluated when its estimate is not used; it continues from its last state.
        above = None if by_sight is not None and self._located else self._own.estimate(now_ns)
        self._located = self._located or above is not None
        if not self._located:
            return None
        poses = self._others.poses(now_ns)
        target = None if self.target is None else poses[self.target]
        if by_sight is not None and target is not None and self._X_TD is not None:
            own = composed_pose(self.unit, target, self._X_TD, by_sight)
            last_seen_ns = by_sight.last_seen_ns
        elif above is not None:
            own, last_seen_ns = self._own_pose(above), above.last_seen_ns
        else:
            return None
        return ArenaEstimate(
            stamp_ns=own.stamp_ns,
            own=own,
            target=target,
            others=tuple(poses[name] for name in self._units if name in poses and name != self.target),
            obstacles=self._others.obstacles(poses),
            last_seen_ns=last_seen_ns,
            strain=self._strain,
            exposures=self._own.exposures,
        )

    def in_dock_frame(self, stamp_ns: int) -> PoseEstimate | None:
        """Return the pose of the unit in the dock frame of its target as the overhead camera measures it.

        It is None until unit and target have been seen. Of its errors most are by where the tags are held on
        the two roofs.
        """
        above = self._own.predict(stamp_ns)
        if above is None or self.target is None or self._X_TD is None or not self._others.knows(self.target):
            return None
        own, target = self._own_pose(above), self._others.poses(stamp_ns)[self.target]
        X_WD = target.X_WB @ self._X_TD
        X_DW = X_WD.inverse()
        P = frozen(X_DW.rotate_covariance(self._model.covariance_between(own, target)))
        return PoseEstimate(stamp_ns, X_DW @ own.X_WB, P, above.last_seen_ns)

    def _own_pose(self, own: PoseEstimate) -> GlobalPose:
        standstill, covariance = self._own_standstill, own.covariance
        if standstill is not None and standstill.times >= self._others.noise.stands_after:
            covariance = covariance + standstill.first.lasting
        assert self._own_seen is not None, "it has been seen"
        slip = self._clock_s * self._own.velocity(own.stamp_ns) if self._clock_s else None
        return self._own_seen.estimated(own.stamp_ns, own.X_DU, covariance, slip, learns_roof=True)


def composed_pose(name: str, target: GlobalPose, X_TD: SE2, by_sight: PoseEstimate) -> GlobalPose:
    """Return the pose in W of a unit that is known in the dock frame D of another unit.

    X_WU = X_WT X_TD X_DU, with the covariance to first order: the rotation of the other unit, the target,
    moves the unit about the target's middle, and the error in D rotates with D. The two errors come from
    different cameras, so that they are independent. What the target shares with other bodies, the unit shares
    then.
    """
    X_WD = target.X_WB @ X_TD
    X_WU = X_WD @ by_sight.X_DU
    by_target = moved_along(target, X_WU)
    covariance = by_target @ target.covariance @ by_target.T + X_WD.rotate_covariance(by_sight.covariance)
    shared = None if target.shared is None else frozen(by_target @ target.shared @ by_target.T)
    return GlobalPose(name, by_sight.stamp_ns, X_WU, frozen(covariance), shared)


def pose_in_dock_frame(arena: ArenaEstimate, X_TD: SE2) -> SE2 | None:
    """Return the pose X_DU of the docking unit in the dock frame D of its target; None without a target."""
    return None if arena.target is None else (arena.target.X_WB @ X_TD).inverse() @ arena.own.X_WB
