"""A Kalman filter for a body that stands still, which starts anew when the body was moved."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import GlobalPose, seconds


@dataclass(frozen=True, slots=True)
class StationaryNoise:
    """The assumed motion of a body that stands still, and the gate for its measurements.

    Attributes:
        drift: Random walk of the position [m per square root of a second].
        turn_drift: Random walk of the yaw [rad per square root of a second].
        gate: Squared Mahalanobis distance (3 degrees of freedom) beyond which a measurement is rejected.
        moved_after: Number of rejected measurements in a row after which the body has been moved.
    """

    drift: float = 0.0005
    turn_drift: float = math.radians(0.1)
    gate: float = 21.1
    moved_after: int = 3


@dataclass(frozen=True, slots=True, eq=False)
class StationaryBody:
    """The filter's state of one body.

    Attributes:
        name: Name of the body.
        stamp_ns: Time of the covariance.
        X_WB: Pose of the body.
        covariance: Covariance of (x, y, yaw) in W, shape (3, 3) [m, rad].
        last_seen_ns: Exposure time of the last measurement inside the gate.
        rejected: Number of measurements in a row outside the gate.
    """

    name: str
    stamp_ns: int
    X_WB: SE2
    covariance: Array
    last_seen_ns: int
    rejected: int = 0

    @classmethod
    def from_measurement(cls, measured: GlobalPose) -> StationaryBody:
        """Return the state after the first measurement."""
        stamp_ns = measured.stamp_ns
        return cls(measured.name, stamp_ns, measured.X_WB, measured.covariance, stamp_ns)

    def propagate(self, stamp_ns: int, noise: StationaryNoise) -> StationaryBody:
        """Return the state at a later instant; an earlier one changes nothing."""
        dt = seconds(stamp_ns - self.stamp_ns)
        if dt <= 0.0:
            return self
        grown = np.diag([noise.drift**2, noise.drift**2, noise.turn_drift**2]) * dt
        return replace(self, stamp_ns=stamp_ns, covariance=self.covariance + grown)

    def update(self, measured: GlobalPose, noise: StationaryNoise) -> StationaryBody:
        """Return the state after another measurement, which may be older than the last one."""
        prior = self.propagate(measured.stamp_ns, noise)
        innovation = measured.X_WB.as_array() - prior.X_WB.as_array()
        innovation[2] = math.remainder(innovation[2], 2.0 * math.pi)
        S = prior.covariance + measured.covariance
        if float(innovation @ np.linalg.solve(S, innovation)) > noise.gate:
            if measured.stamp_ns < self.last_seen_ns:
                return self  # the measurement is from before the body was moved
            lost = replace(prior, rejected=prior.rejected + 1)
            return StationaryBody.from_measurement(measured) if lost.rejected >= noise.moved_after else lost
        gain = np.linalg.solve(S, prior.covariance).T
        left = np.eye(3) - gain
        # Joseph's form keeps the covariance positive definite whatever the gain's rounding.
        covariance = left @ prior.covariance @ left.T + gain @ measured.covariance @ gain.T
        return StationaryBody(
            self.name,
            prior.stamp_ns,
            SE2(*(prior.X_WB.as_array() + gain @ innovation)),
            covariance,
            max(self.last_seen_ns, measured.stamp_ns),
        )
