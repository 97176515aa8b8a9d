"""Where everybody stands in the world, from overhead sights and the docking unit's own wheels.

The docking unit moves and is followed by the filter that also follows it at close range, with the world in
the place of the dock frame; all others stand still until they are seen elsewhere. The camera's pose is known,
so that no two bodies' errors are correlated and each has a filter of its own.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy.stats import chi2

from msrr_perception.estimation.body_filter import StandingBody, StandingNoise
from msrr_perception.estimation.corner_filter import CornerEkf
from msrr_perception.pose.overhead_model import OVERHEAD, OverheadModel
from msrr_scenes.arrays import Array
from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import (
    NS_PER_S,
    ArenaEstimate,
    Detections,
    Exposure,
    GlobalPose,
    ObstacleEstimate,
    PoseEstimate,
    PoseMeasurement,
    WheelOdometry,
    seconds,
)
from msrr_scenes.specs.sensors import OdometrySpec


class GlobalEstimator:
    """Estimates the poses of the docking unit, its target, other units and obstacles in W.

    A sight takes effect at the time of its exposure, however late it comes. Between sights the wheels move
    the docking unit, and its covariance grows with the way.

    Attributes:
        model: The overhead camera and the catalogue of tags.
        delay_compensation: Whether :meth:`situation` speaks of now or of the last exposure.
    """

    def __init__(
        self,
        model: OverheadModel,
        odometry: OdometrySpec,
        delay_compensation: bool = True,
        corner_sigma_px: float = 0.08,
        tilt_sigma_deg: float = 0.05,
        gate_probability: float = 0.9999,
        reset_after: int = 5,
        moved_after: int = 3,
        horizon_s: float = 1.0,
    ) -> None:
        """Set up an estimator that knows nothing yet.

        Args:
            model: The overhead camera and the catalogue of tags.
            odometry: Design values of the docking unit's encoders.
            delay_compensation: Whether the docking unit's pose is moved from the last exposure up to now.
            corner_sigma_px: Of each corner coordinate, from frame to frame.
            tilt_sigma_deg: Of every unit's pitch and roll, which shift the tag on its top.
            gate_probability: Share of good sights that pass the gate.
            reset_after: Sights of the docking unit in a row beyond the gate after which it starts anew.
            moved_after: The same of another body, which has then been moved.
            horizon_s: How late a sight may be.

        Raises:
            SceneError: A parameter out of its range.
        """
        if tilt_sigma_deg < 0.0 or moved_after < 1:
            raise SceneError("global estimator: tilt_sigma_deg must not be negative, moved_after at least 1")
        self.model = model
        self.delay_compensation = delay_compensation
        self._localizer = model.localizer(corner_sigma_px)
        self._tilt = math.radians(tilt_sigma_deg)
        # Its frame D is the world here, where no wall is near at x = 0.
        self._own = CornerEkf(
            model.pair,
            odometry,
            delay_compensation=delay_compensation,
            corner_sigma_px=corner_sigma_px,
            gate_probability=gate_probability,
            reset_after=reset_after,
            horizon_s=horizon_s,
            contact_zone_m=-math.inf,
        )
        self._standing_noise = StandingNoise(
            gate=float(chi2.ppf(gate_probability, 3)), moved_after=moved_after
        )
        # What a second adds to the covariance of a body that stands, asked once instead of at every instant.
        nowhere = StandingBody("", 0, SE2(), np.zeros((3, 3)), 0)
        self._drift = nowhere.at(NS_PER_S, self._standing_noise).covariance
        self._bodies: dict[str, StandingBody] = {}
        self._located = False  # the docking unit has been seen, and a pose of it is known from then on
        self._lean: dict[str, Array] = {}

    def reset(self) -> None:
        """Forget every pose; what the encoders said stays."""
        self._own.reset()
        self._bodies = {}
        self._located = False

    def add_odometry(self, reading: WheelOdometry) -> None:
        """Take in an encoder reading; those of other units change nothing."""
        if reading.unit == self.model.own:
            self._own.add_odometry(reading)

    def add_detections(self, detections: Detections) -> None:
        """Take in the tags of one overhead exposure; those of other cameras change nothing."""
        if detections.exposure.camera == OVERHEAD:
            for sight in self._localizer.locate(detections):
                self.add_global(replace(sight, covariance=sight.covariance + self.model.noise))

    def add_global(self, sight: GlobalPose) -> None:
        """Take in a ready-made pose, as parametric perception gives it."""
        if sight.name == self.model.own:
            exposure = Exposure(OVERHEAD, 0, sight.stamp_ns)
            covariance = sight.covariance + self._systematic(sight.name)
            self._own.add_pose(PoseMeasurement(exposure, sight.X_WB, covariance, (None, None)))
            return
        known = self._bodies.get(sight.name)
        self._bodies[sight.name] = (
            known.seen(sight, self._standing_noise) if known else StandingBody.first(sight)
        )

    def predict(self, stamp_ns: int) -> Mapping[str, GlobalPose]:
        """Return the pose of every body known at an instant, for planning where to look."""
        own = self._own.predict(stamp_ns)
        found = {} if own is None else {self.model.own: self._own_pose(own)}
        return found | {name: self._pose(body, stamp_ns) for name, body in self._bodies.items()}

    def situation(self, now_ns: int, by_sight: PoseEstimate | None = None) -> ArenaEstimate | None:
        """Return what control gets; None until the docking unit and its target have been seen.

        Args:
            now_ns: The time.
            by_sight: The unit in the dock frame as its own camera sees it, when that is to be believed
                rather than the view from above; None for the latter.
        """
        if self.model.target not in self._bodies:
            return None
        # A question that nobody asked costs the filter nothing: it goes on from where it was.
        above = None if by_sight is not None and self._located else self._own.estimate(now_ns)
        self._located = self._located or above is not None
        if not self._located:
            return None
        poses = {name: self._pose(body, now_ns) for name, body in self._bodies.items()}
        target = poses[self.model.target]
        if by_sight is not None:
            own = composed_pose(self.model.own, target, self.model.X_TD, by_sight)
            last_seen_ns = by_sight.last_seen_ns
        elif above is not None:
            own, last_seen_ns = self._own_pose(above), above.last_seen_ns
        else:
            return None
        return ArenaEstimate(
            stamp_ns=own.stamp_ns,
            own=own,
            target=target,
            others=tuple(
                poses[unit] for unit in self.model.units if unit in poses and unit != self.model.target
            ),
            obstacles=tuple(
                ObstacleEstimate(
                    name, self._bodies[name].last_seen_ns, poses[name].X_WB, poses[name].covariance, radius
                )
                for name, radius in self.model.radii.items()
                if name in poses
            ),
            last_seen_ns=last_seen_ns,
        )

    def _own_pose(self, own: PoseEstimate) -> GlobalPose:
        covariance = own.covariance + self._systematic(self.model.own)
        return GlobalPose(self.model.own, own.stamp_ns, own.X_DU, covariance)

    def _pose(self, body: StandingBody, stamp_ns: int) -> GlobalPose:
        waited = seconds(max(stamp_ns - body.stamp_ns, 0))
        covariance = body.covariance + self._drift * waited + self._systematic(body.name)
        return GlobalPose(body.name, max(stamp_ns, body.stamp_ns), body.X_WB, covariance)

    def _systematic(self, name: str) -> Array:
        """Return the covariance (3, 3) of what is the same in picture after picture: how the body leans."""
        known = self._lean.get(name)
        if known is None:
            lean = 0.0
            if name in self.model.units and name in self.model.tag_of:
                lean = self._tilt * self.model.tags[self.model.tag_of[name]].height
            known = self._lean[name] = np.diag([lean**2, lean**2, 0.0])
        return known


def composed_pose(name: str, target: GlobalPose, X_TD: SE2, by_sight: PoseEstimate) -> GlobalPose:
    """Return a unit in W that is known in the dock frame D of another one.

    X_WU = X_WT X_TD X_DU, and its covariance is what both errors make of it, to first order: the target's
    turn swings the unit about the target's middle, and the error in D turns with D. The two come from
    different cameras, so that they are independent.

    Args:
        name: The unit.
        target: The other unit in W.
        X_TD: D in the frame of the other unit.
        by_sight: The unit in D.
    """
    X_WD = target.X_WB @ X_TD
    X_WU = X_WD @ by_sight.X_DU
    by_target = _swing(X_WU, target.X_WB)
    c, s = math.cos(X_WD.yaw), math.sin(X_WD.yaw)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    covariance = by_target @ target.covariance @ by_target.T + turn @ by_sight.covariance @ turn.T
    return GlobalPose(name, by_sight.stamp_ns, X_WU, covariance)


def X_DU(situation: ArenaEstimate, X_TD: SE2) -> SE2:
    """Return the docking unit in the dock frame D of the target port.

    Args:
        situation: What is known.
        X_TD: D in the frame of the target unit, as in :attr:`OverheadModel.X_TD`.
    """
    return (situation.target.X_WB @ X_TD).inverse() @ situation.own.X_WB


def relative_pose(situation: ArenaEstimate, X_TD: SE2) -> PoseEstimate:
    """Return :func:`X_DU` with the covariance that both bodies' errors give it."""
    own, target = situation.own, situation.target
    X_WD = target.X_WB @ X_TD
    c, s = math.cos(X_WD.yaw), math.sin(X_WD.yaw)
    by_own = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    # The target's turn swings its port and the axes of D: together, a turn about the target's own middle.
    by_target = -by_own @ _swing(own.X_WB, target.X_WB)
    covariance = by_own @ own.covariance @ by_own.T + by_target @ target.covariance @ by_target.T
    return PoseEstimate(situation.stamp_ns, X_DU(situation, X_TD), covariance, situation.last_seen_ns)


def _swing(X_WA: SE2, X_WB: SE2) -> Array:
    """Return how a body at ``X_WA`` moves with one at ``X_WB`` that it is tied to, shape (3, 3)."""
    x, y = X_WA.x - X_WB.x, X_WA.y - X_WB.y
    return np.array([[1.0, 0.0, -y], [0.0, 1.0, x], [0.0, 0.0, 1.0]])
