"""What a unit has learned of errors of calibration, which it keeps from one docking to the next."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from msrr_scenes.arrays import Array


@dataclass(frozen=True, slots=True, eq=False)
class CalibrationEstimate:
    """An estimate of everything in the state of a filter but the pose.

    Attributes:
        mean: Means, shape (m,): relative errors of wheel radii and track, then the errors of calibration.
        covariance: Their covariance, shape (m, m).
        shared: Indices of those that do not depend on the target: of the unit's own wheels and camera.
    """

    mean: Array
    covariance: Array
    shared: NDArray[np.int64]

    def of_another_target(self, prior: CalibrationEstimate) -> CalibrationEstimate:
        """Return what is left for a target of which nothing is known but its drawing.

        Args:
            prior: Estimate for that target from the drawing alone.
        """
        mean, covariance = prior.mean.copy(), prior.covariance.copy()
        mean[prior.shared] = self.mean[self.shared]
        covariance[np.ix_(prior.shared, prior.shared)] = self.covariance[np.ix_(self.shared, self.shared)]
        return CalibrationEstimate(mean, covariance, prior.shared)


class CalibrationMemory:
    """Keeps what a unit has learned during a trial, of itself and of each port."""

    def __init__(self) -> None:
        """Begin with the drawing alone."""
        self._ports: dict[str, CalibrationEstimate] = {}
        self._newest: CalibrationEstimate | None = None

    def keep(self, port: str, estimate: CalibrationEstimate) -> None:
        """Keep what was learned at a port ``<unit>.<port>``."""
        self._ports[port] = self._newest = estimate

    def recall(self, port: str, prior: CalibrationEstimate) -> CalibrationEstimate:
        """Return what is known at a port.

        What was learned of the unit itself at another port later on is not combined with what this port
        taught: both rest on the same errors of the camera, and their correlation is not kept.

        Args:
            port: The port, ``<unit>.<port>``.
            prior: Estimate from the drawing alone.
        """
        known = self._ports.get(port)
        if known is not None:
            return known
        return prior if self._newest is None else self._newest.of_another_target(prior)
