"""The correction of the pose that a unit's own camera gives by what the overhead camera measures of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from msrr_perception.estimation.chi_squared import chi_squared_quantile
from msrr_perception.motion.motion_noise import DEFAULT_NOISE
from msrr_perception.pose.corner_fit import deviation
from msrr_perception.pose.target import TargetModel
from msrr_scenes.arrays import frozen
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import PoseEstimate

#: Share of pairs of good estimates that pass the gate.
_GATE_PROBABILITY = 0.9999


class OverheadCorrection:
    """Corrects the pose in the dock frame by the onboard camera with that by the overhead camera.

    Each of them has errors that no number of frames averages out, and these have different causes: the
    bracket and the tags of the port there, the tags on the two roofs here. So the weighted mean of both, by
    their covariances, is better than either. It is not fed back into the filter, which would count the same
    error again with every frame.

    Where both contradict each other, as a localisation with a bias that nobody knows of or a camera that was
    knocked askew does, nobody knows which of them is wrong. The unit then docks by its own camera alone.
    Where its wheels may spin at the port, the last correction holds on: the overhead camera is too slow there
    to tell how the unit moves.
    """

    def __init__(self, target: TargetModel) -> None:
        """Begin without a correction.

        Args:
            target: Port that the unit docks to, and its mechanism.
        """
        pins = target.mechanism.pin_length if target.mechanism is not None else 0.0
        self._free_m = target.front + pins + DEFAULT_NOISE.contact_zone
        self.reset()

    def reset(self) -> None:
        """Forget the correction, before another approach."""
        self._shift = np.zeros(3)
        self._agrees = True

    def holds_at(self, by_sight: PoseEstimate) -> bool:
        """Return whether the last correction holds on, as the wheels may spin or nothing was agreed upon."""
        return not self._agrees or -by_sight.X_DU.x < self._free_m

    def update(self, by_sight: PoseEstimate, from_above: PoseEstimate) -> PoseEstimate:
        """Return the weighted mean of two poses of the same instant, and keep how far it is from the first.

        Args:
            by_sight: Pose by the onboard camera.
            from_above: Pose by the overhead camera.
        """
        apart = deviation(from_above.X_DU.as_array(), by_sight.X_DU.as_array())
        P, R = by_sight.covariance, from_above.covariance
        S = P + R
        gain = np.linalg.solve(S, P).T
        if float(apart @ np.linalg.solve(S, apart)) > chi_squared_quantile(_GATE_PROBABILITY, 3):
            self._shift, self._agrees = np.zeros(3), False
            return by_sight
        self._shift = gain @ apart
        left = np.eye(3) - gain
        fused = frozen(left @ P @ left.T + gain @ R @ gain.T)
        return replace(self.apply(by_sight), covariance=fused)

    def apply(self, by_sight: PoseEstimate) -> PoseEstimate:
        """Return a pose by the onboard camera with the last correction, and as uncertain as without it."""
        if not self._shift.any():
            return by_sight
        return replace(by_sight, X_DU=SE2(*(by_sight.X_DU.as_array() + self._shift).tolist()))
