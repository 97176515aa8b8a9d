"""The estimate of a body that stands still: a Kalman filter that starts anew when the body was moved."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import GlobalPose, seconds


@dataclass(frozen=True, slots=True)
class StandingNoise:
    """How a body that stands still may stray.

    Attributes:
        drift: Of its position [m per square root of a second].
        turn_drift: Of its yaw [rad per square root of a second].
        gate: Squared Mahalanobis distance (3 degrees of freedom) beyond which a sight does not belong to
            where the body was.
        moved_after: Sights in a row beyond the gate after which the body has been moved.
    """

    drift: float = 0.0005
    turn_drift: float = math.radians(0.1)
    gate: float = 21.1
    moved_after: int = 3


@dataclass(frozen=True, slots=True, eq=False)
class StandingBody:
    """Belief about one body.

    Attributes:
        name: The body.
        stamp_ns: The instant that the covariance speaks of.
        X_WB: Its pose.
        covariance: Of (x, y, yaw) in W, shape (3, 3) [m, rad].
        last_seen_ns: Exposure time of the last sight inside the gate.
        rejected: Sights in a row outside the gate.
    """

    name: str
    stamp_ns: int
    X_WB: SE2
    covariance: Array
    last_seen_ns: int
    rejected: int = 0

    @classmethod
    def first(cls, sight: GlobalPose) -> StandingBody:
        """Return the belief after the first sight."""
        return cls(sight.name, sight.stamp_ns, sight.X_WB, sight.covariance, sight.stamp_ns)

    def at(self, stamp_ns: int, noise: StandingNoise) -> StandingBody:
        """Return the belief at a later instant; an earlier one changes nothing."""
        dt = seconds(stamp_ns - self.stamp_ns)
        if dt <= 0.0:
            return self
        grown = np.diag([noise.drift**2, noise.drift**2, noise.turn_drift**2]) * dt
        return replace(self, stamp_ns=stamp_ns, covariance=self.covariance + grown)

    def seen(self, sight: GlobalPose, noise: StandingNoise) -> StandingBody:
        """Return the belief after another sight, which may be older than the last one."""
        prior = self.at(sight.stamp_ns, noise)
        innovation = sight.X_WB.as_array() - prior.X_WB.as_array()
        innovation[2] = math.remainder(innovation[2], 2.0 * math.pi)
        S = prior.covariance + sight.covariance
        if float(innovation @ np.linalg.solve(S, innovation)) > noise.gate:
            if sight.stamp_ns < self.last_seen_ns:
                return self  # from before the body was moved
            lost = replace(prior, rejected=prior.rejected + 1)
            return StandingBody.first(sight) if lost.rejected >= noise.moved_after else lost
        gain = np.linalg.solve(S, prior.covariance).T
        left = np.eye(3) - gain
        # Joseph's form keeps the covariance positive definite whatever the gain's rounding.
        covariance = left @ prior.covariance @ left.T + gain @ sight.covariance @ gain.T
        return StandingBody(
            self.name,
            prior.stamp_ns,
            SE2(*(prior.X_WB.as_array() + gain @ innovation)),
            covariance,
            max(self.last_seen_ns, sight.stamp_ns),
        )
