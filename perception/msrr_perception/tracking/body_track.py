"""The track of a body that stands or drives: a Kalman filter of its pose and twist.

It starts anew when the body was moved in a way that no drive explains.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import Enum
from functools import cached_property

import numpy as np

from msrr_perception.estimation.chi_squared import chi_squared_quantile
from msrr_perception.kernels.track import coast, fuse
from msrr_perception.tracking.seen_pose import SAME_PLACE, SeenPose
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import GlobalPose, seconds
from msrr_scenes.specs.vehicle import LimitsSpec

#: Number of measurements that are known again when a network delivers them once more: two seconds of them.
_REMEMBERED = 20


@dataclass(frozen=True, slots=True, eq=False)
class TrackNoise:
    """The assumed motion of a body, and the gate for its measurements.

    Attributes:
        limits: Limits of the drive of a unit, by data sheet.
        gate_probability: Share of good measurements that pass the gate; others are rejected.
        usual: Usual accelerations as a share of the limits.
        lasts_s: Time for which an acceleration lasts [s].
        sideways: Motion across the wheels [m per square root of a metre driven].
        drift: Random walk of the position of a body that stands [m per square root of a second].
        turn_drift: Random walk of its yaw [rad per square root of a second].
        unseen_after_s: Time without a measurement after which a body may be pushed unseen, and after which
            one that drives is not expected to drive on [s].
        unseen_drift: As ``drift``, for a body that is not seen.
        unseen_turn_drift: As ``turn_drift``, for a body that is not seen.
        restart_after: Number of rejected measurements in a row after which the track starts anew.
        stands_after: Number of measurements in a row at one place after which a body stands.
        creep: Speed at which a body would have left the place before it counts as standing [m/s].
        turn_creep: As ``creep``, yaw rate [rad/s].
        clock_s: Standard deviation of the error of time stamps, the same for all [s].
    """

    limits: LimitsSpec
    gate_probability: float = 0.9999
    usual: float = 0.2
    lasts_s: float = 0.1
    sideways: float = 2e-4
    drift: float = 1e-5
    turn_drift: float = 1e-4
    unseen_after_s: float = 1.0
    unseen_drift: float = 2e-4
    unseen_turn_drift: float = 5e-4
    restart_after: int = 3
    stands_after: int = 4
    creep: float = 0.02
    turn_creep: float = 0.1
    clock_s: float = 0.0


class Motion(Enum):
    """How a body is assumed to move until the next measurement."""

    STANDS = "stands"
    DRIVES = "drives"
    MANOEUVRES = "manoeuvres"  # sets off, brakes or turns as hard as the limits of the drive allow


@dataclass(frozen=True, slots=True, eq=False)
class StandstillDetector:
    """Tells whether a body stands, by how often in a row it was seen at one place.

    Attributes:
        first: First measurement at the place at which it was seen last.
        times: Number of measurements there in a row.
    """

    first: SeenPose
    times: int = 1

    def after(self, seen: SeenPose) -> StandstillDetector:
        """Return the detector after the next measurement: of the same place once more, or of a new one."""
        again = seen.is_at_place_of(self.first)
        return StandstillDetector(self.first, self.times + 1) if again else StandstillDetector(seen)

    def shows_standing(self, last: SeenPose, noise: TrackNoise) -> bool:
        """Return whether a body that was seen at that place, last by ``last``, stands.

        The less is known of where it is, the longer it takes until one that creeps would have left the place.
        """
        waited = seconds(last.pose.stamp_ns - self.first.pose.stamp_ns)
        sigma = np.sqrt(2.0 * chi_squared_quantile(SAME_PLACE, 3) * np.diag(last.pose.covariance))
        left = waited * np.array([noise.creep, noise.creep, noise.turn_creep]) >= sigma
        return self.times >= noise.stands_after and bool(left.all())


@dataclass(frozen=True, eq=False)
class BodyTrack:
    """The state of the filter of one body after its last measurement inside the gate.

    Attributes:
        state: ``(x, y, yaw, v, w)`` in W, shape (5,) [m, rad, m/s, rad/s].
        covariance: Covariance of the state, shape (5, 5); without the lasting error while the body stands.
        seen: Last measurement inside the gate.
        motion: Whether the body stands or drives.
        standstill: Tells whether the body stands; it is given measurements only while the body drives.
        accepted: Number of measurements inside the gate.
        rejected: Number of measurements in a row outside the gate.
        counted_ns: Times of the last measurements, for a network may deliver one again; none are noted before
            the second.
    """

    state: Array
    covariance: Array
    seen: SeenPose
    motion: Motion
    standstill: StandstillDetector
    accepted: int = 1
    rejected: int = 0
    counted_ns: tuple[int, ...] = ()

    @classmethod
    def at_rest(cls, seen: SeenPose) -> BodyTrack:
        """Return the track of a body that stands where it was measured."""
        P = np.zeros((5, 5))
        P[:3, :3] = seen.pose.covariance
        return cls(_state(seen), P, seen, Motion.STANDS, StandstillDetector(seen))

    @classmethod
    def at_any_speed(cls, seen: SeenPose, limits: LimitsSpec) -> BodyTrack:
        """Return the track of a body of which one measurement is known and nothing of its motion."""
        P = np.diag([0.0, 0.0, 0.0, (0.5 * limits.v_max_mps) ** 2, (0.5 * limits.w_max_radps) ** 2])
        P[:3, :3] = seen.pose.covariance
        return cls(_state(seen), P, seen, Motion.DRIVES, StandstillDetector(seen))

    @cached_property
    def X_WB(self) -> SE2:
        """Pose after the last measurement."""
        return SE2(*self.state[:3].tolist())

    @cached_property
    def _at_rest(self) -> tuple[Array, list[float], list[float]]:
        """Covariance of the pose of a body that stands, as it is measured; diagonals of its two parts."""
        own, lasting = self.covariance[:3, :3], self.seen.lasting
        return own + lasting, own.diagonal().tolist(), lasting.diagonal().tolist()

    def pose(self, stamp_ns: int, noise: TrackNoise) -> GlobalPose:
        """Return the pose at an instant; before the last measurement it is that of the measurement."""
        seen_ns = self.seen.pose.stamp_ns
        if self.motion is Motion.STANDS:  # asked for at every control instant of every unit
            at_once, own, lasting = self._at_rest
            way, turn = _drift(seconds(max(stamp_ns - seen_ns, 0)), noise)
            covariance = at_once.copy()
            covariance[0, 0] = own[0] + way + lasting[0]
            covariance[1, 1] = own[1] + way + lasting[1]
            covariance[2, 2] = own[2] + turn + lasting[2]
            return self.seen.estimated(max(stamp_ns, seen_ns), self.X_WB, covariance)
        mean, P = self._predicted(stamp_ns, noise, self.motion)
        x, y, yaw, v, w = mean.tolist()
        slip = noise.clock_s * np.array([v * math.cos(yaw), v * math.sin(yaw), w]) if noise.clock_s else None
        return self.seen.estimated(max(stamp_ns, seen_ns), SE2(x, y, yaw), P[:3, :3], slip)

    def after(self, seen: SeenPose, noise: TrackNoise) -> BodyTrack:
        """Return the track after another measurement.

        One that is older than the last counts only if the body stands where it stood then; one that is
        delivered again does not count.
        """
        counted_ns = self.counted_ns or (self.seen.pose.stamp_ns,)
        if seen.pose.stamp_ns in counted_ns:
            return self
        track = self._after(seen, noise)
        if track is self:
            return self
        return replace(track, counted_ns=(*counted_ns, seen.pose.stamp_ns)[-_REMEMBERED:])

    def _after(self, seen: SeenPose, noise: TrackNoise) -> BodyTrack:
        """Return the track after a measurement that is delivered for the first time."""
        fused = self._fused(seen, noise, self.motion)
        if seen.pose.stamp_ns < self.seen.pose.stamp_ns:
            if fused is None or self.motion is not Motion.STANDS:
                return self
            return replace(fused, seen=self.seen, rejected=self.rejected)
        if fused is None:
            fused = self._fused(seen, noise, Motion.MANOEUVRES)
        if fused is None:
            # The second of two first measurements is as good as the first.
            known = self.accepted >= noise.restart_after
            if self.rejected + 1 >= (noise.restart_after if known else 1):
                return BodyTrack.at_any_speed(seen, noise.limits)
            return replace(self, rejected=self.rejected + 1)
        if fused.motion is Motion.DRIVES and fused.standstill.shows_standing(seen, noise):
            return replace(BodyTrack.at_rest(seen), accepted=fused.accepted)
        return fused

    def _fused(self, seen: SeenPose, noise: TrackNoise, motion: Motion) -> BodyTrack | None:
        """Return the track after a measurement that fits a motion; None if it does not."""
        mean, P = self._predicted(seen.pose.stamp_ns, noise, motion)
        mean, P, distance = fuse(mean, P, seen.pose.X_WB.as_array(), seen.pose.covariance)
        if distance > chi_squared_quantile(noise.gate_probability, 3):
            return None
        stands = motion is Motion.STANDS
        standstill = self.standstill if stands else self.standstill.after(seen)
        kind = Motion.STANDS if stands else Motion.DRIVES
        return BodyTrack(mean, P, seen, kind, standstill, self.accepted + 1)

    def _predicted(self, stamp_ns: int, noise: TrackNoise, motion: Motion) -> tuple[Array, Array]:
        """Return mean and covariance of the state at an instant, if the body moves so until then."""
        dt = max(seconds(stamp_ns - self.seen.pose.stamp_ns), 0.0)
        unseen = max(dt - noise.unseen_after_s, 0.0)
        if motion is Motion.STANDS:
            way, turn = _drift(dt, noise)
            P = self.covariance.copy()
            P[0, 0] += way
            P[1, 1] += way
            P[2, 2] += turn
            return self.state, P
        share = noise.usual if motion is Motion.DRIVES else 1.0
        drive = (
            noise.lasts_s * (share * noise.limits.a_max_mps2) ** 2,
            noise.lasts_s * (share * noise.limits.dw_max_radps2) ** 2,
            noise.sideways**2,
            # A tag that is turned on its roof does not point where the body drives.
            0.0 if self.seen.errors is None else float(self.seen.errors.own[2, 2]),
        )
        P = self.covariance
        if self.motion is Motion.STANDS:  # what stayed the same while it stood is an error as it drives off
            P = P.copy()
            P[:3, :3] += self.seen.lasting
        mean, P = coast(self.state, P, dt - unseen, *drive)
        if unseen > 0.0:  # it may have stopped as well as driven on
            P[3, 3] += mean[3] ** 2
            P[4, 4] += mean[4] ** 2
            mean[3:] = 0.0
            mean, P = coast(mean, P, unseen, *drive)
        if self.seen.errors is not None:  # a tag that is held beside its place goes round as the body turns
            turned = (mean[2] - self.state[2]) ** 2 + max(P[2, 2] - self.covariance[2, 2], 0.0)
            P[:2, :2] += turned * _quarter_turned(self.seen.errors.held)
        return mean, P


def _drift(dt: float, noise: TrackNoise) -> tuple[float, float]:
    """Return what variances of a body that stands gain in ``dt`` [s]: along x and y [m^2], of yaw [rad^2]."""
    unseen = max(dt - noise.unseen_after_s, 0.0)
    way = noise.drift**2 * dt + noise.unseen_drift**2 * unseen
    return way, noise.turn_drift**2 * dt + noise.unseen_turn_drift**2 * unseen


def _quarter_turned(covariance: Array) -> Array:
    """Return the covariance, shape (2, 2), of a place that is turned by 90 degrees, of that of a pose."""
    (xx, xy, _), (_, yy, _), _ = covariance.tolist()
    return np.array([[yy, -xy], [-xy, xx]])


def _state(seen: SeenPose) -> Array:
    return np.append(seen.pose.X_WB.as_array(), [0.0, 0.0])
