"""What a filter has learned of each error of calibration, by name, and whether its tolerance allows that."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from msrr_perception.motion.filter_state import CalibrationEstimate
from msrr_perception.pose.calibration import Quantity, StateLayout

#: Number of standard deviations from which a tolerance does not allow an error. One of the 39 errors of a
#: pair that was built within its tolerances is farther out in one of 4,000 pairs, or fewer.
_CONTRADICTION = 4.5


@dataclass(frozen=True, slots=True)
class EstimatedCalibrationError:
    """What is known of an error of calibration: of the true value minus the told one.

    Attributes:
        quantity: Its name.
        tolerance: Standard deviation by the drawing, in the unit of the name, as all that follow.
        error: What is known of it.
        sigma: Standard deviation of that.
    """

    quantity: Quantity
    tolerance: float
    error: float
    sigma: float

    @property
    def deviation(self) -> float:
        """The error in standard deviations by the drawing. Of an error of which nothing was seen it is 0."""
        return self.error / self.tolerance

    @property
    def contradicts(self) -> bool:
        """Whether the tolerance does not allow what was learned."""
        return abs(self.deviation) > _CONTRADICTION


def calibration_errors(
    layout: StateLayout, prior: CalibrationEstimate, learned: CalibrationEstimate
) -> tuple[EstimatedCalibrationError, ...]:
    """Return what is known of every error of calibration that has a name: by the drawing, and as learned."""
    by_drawing, seen = (layout.errors(known.mean, known.covariance) for known in (prior, learned))
    tolerances, sigmas = (np.sqrt(np.diag(covariance)).tolist() for _, covariance in (by_drawing, seen))
    rows = zip(layout.quantities, tolerances, seen[0].tolist(), sigmas, strict=True)
    return tuple(
        EstimatedCalibrationError(what, what.scale * tolerance, what.scale * error, what.scale * sigma)
        for what, tolerance, error, sigma in rows
        if what is not None
    )
