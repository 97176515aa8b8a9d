"""The correction of the pose that a unit's own camera gives by what the overhead camera measures of it."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from msrr_perception.estimation.chi_squared import chi_squared_quantile
from msrr_perception.kernels.drive import is_at_port
from msrr_perception.motion.motion_noise import DEFAULT_NOISE
from msrr_perception.pose.corner_fit import deviation
from msrr_perception.pose.target import TargetModel
from msrr_scenes.arrays import Array, frozen
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import PoseEstimate

#: Share of pairs of good estimates that pass the gate.
_GATE_PROBABILITY = 0.9999

#: Time for which a correction is good [ns]: within 0.1 s a unit comes 1 cm nearer, on which a bracket that is
#: turned by 0.3 degrees moves it aside by 0.05 mm.
_PERIOD_NS = 100_000_000


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
        """Begin without a correction, before the port of a target with its mechanism."""
        pins = target.mechanism.pin_length if target.mechanism is not None else 0.0
        self._tips = target.front + pins
        self.reset()

    def reset(self) -> None:
        """Forget the correction, before another approach."""
        self._last: _Correction | None = None
        self._agrees, self._due_ns = True, 0

    def is_due(self, by_sight: PoseEstimate) -> bool:
        """Return whether a new correction is to be computed: not at the port, nor after a contradiction."""
        return self._agrees and by_sight.stamp_ns >= self._due_ns and not self._is_at_port(by_sight)

    def update(self, by_sight: PoseEstimate, from_above: PoseEstimate) -> None:
        """Compute the correction that leads to the weighted mean of two poses of the same instant."""
        apart = deviation(from_above.X_DU.as_array(), by_sight.X_DU.as_array())
        P, R = by_sight.covariance, from_above.covariance
        of_both = np.linalg.inv(P + R)
        self._agrees = float(apart @ of_both @ apart) <= chi_squared_quantile(_GATE_PROBABILITY, 3)
        self._due_ns = by_sight.stamp_ns + _PERIOD_NS
        gain = P @ of_both
        self._last = _Correction(gain @ apart, gain, R) if self._agrees else None

    def apply(self, by_sight: PoseEstimate) -> PoseEstimate:
        """Return a pose by the onboard camera with the last correction.

        At the port it is as uncertain as without one.
        """
        if self._last is None:
            return by_sight
        shift, gain, R = self._last
        X_DU, P = SE2(*(by_sight.X_DU.as_array() + shift).tolist()), by_sight.covariance
        if not self._is_at_port(by_sight):
            left = np.eye(3) - gain
            P = frozen(left @ P @ left.T + gain @ R @ gain.T)
        return replace(by_sight, X_DU=X_DU, covariance=P)

    def _is_at_port(self, by_sight: PoseEstimate) -> bool:
        X_DU = by_sight.X_DU
        return is_at_port(X_DU.x, X_DU.y, self._tips, DEFAULT_NOISE.contact_zone)


class _Correction(NamedTuple):
    """The last correction.

    Attributes:
        shift: What is added to the pose by the onboard camera, shape (3,) [m, m, rad].
        gain: Weight of the overhead camera in the mean, shape (3, 3).
        from_above: Covariance of the pose by the overhead camera, shape (3, 3).
    """

    shift: Array
    gain: Array
    from_above: Array
