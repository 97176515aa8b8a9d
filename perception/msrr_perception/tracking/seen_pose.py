"""Measured poses of bodies: what one exposure of the overhead camera, or another localisation, shows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from msrr_perception.estimation.chi_squared import chi_squared_quantile
from msrr_perception.pose.corner_fit import deviation
from msrr_perception.pose.overhead_errors import PoseErrors
from msrr_scenes.arrays import Array, frozen
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import GlobalPose

#: Share of pairs of measurements of a body that stands which are seen to be of one place.
SAME_PLACE = 0.99

#: Keeps the covariance of measurements that claim to be exact invertible, shape (3, 3).
_TINY = 1e-18 * np.eye(3)


@dataclass(frozen=True, slots=True, eq=False)
class SeenPose:
    """A measured pose.

    Attributes:
        pose: Measured pose with the covariance of its error, without the errors of calibration.
        lasting: Part of the covariance, shape (3, 3), of the error that stays the same from measurement to
            measurement while the body stands.
        errors: Covariances of the errors of calibration, which stay nearly the same wherever the body drives;
            None if all is as designed.
    """

    pose: GlobalPose
    lasting: Array
    errors: PoseErrors | None = None

    def estimated(
        self,
        stamp_ns: int,
        X_WB: SE2,
        covariance: Array,
        slip: Array | None = None,
        *,
        learns_roof: bool = False,
    ) -> GlobalPose:
        """Return an estimate that follows from measurements of which this is the last.

        Args:
            stamp_ns: Time of the estimate.
            X_WB: Estimated pose.
            covariance: Covariance of its error, without the errors of calibration.
            slip: Standard deviation of the way, shape (3,) [m, rad], that the body goes in the time by which
                stamps are wrong; None while it stands.
            learns_roof: Whether ``covariance`` has what is not known of where the tag is held on the roof.
        """
        errors, name = self.errors, self.pose.name
        if slip is not None:
            covariance = covariance + slip[:, None] * slip
        if errors is None:
            return GlobalPose(name, stamp_ns, X_WB, frozen(covariance))
        covariance = covariance + (errors.own - errors.held if learns_roof else errors.own) + errors.shared
        return GlobalPose(name, stamp_ns, X_WB, frozen(covariance), errors.shared)

    def is_at_place_of(self, other: SeenPose) -> bool:
        """Return whether both measurements are of one place, as far as their errors tell."""
        apart = deviation(self.pose.X_WB.as_array(), other.pose.X_WB.as_array())
        S = self.pose.covariance + other.pose.covariance + _TINY
        return float(apart @ np.linalg.solve(S, apart)) <= chi_squared_quantile(SAME_PLACE, 3)


@dataclass(frozen=True, slots=True, eq=False)
class SeenPoses:
    """What one overhead exposure shows, read once for all who want to know."""

    stamp_ns: int
    poses: tuple[SeenPose, ...]
