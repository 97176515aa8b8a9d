"""Sliding-mode feedback with a boundary layer, by which C2 tracks, our reading of the comparison."""

from __future__ import annotations

import numpy as np

from msrr_scenes.arrays import Array
from msrr_scenes.specs.spec import Gain, Length, NonNegative, Spec


class SlidingGains(Spec):
    """Gains of the sliding feedback.

    Attributes:
        k_per_s: Linear gain k.
        reach_mps: Reaching speed rho, the magnitude of the switching term outside the boundary layer.
        layer_m: Thickness delta of the boundary layer, within which the switching term is linear.
    """

    k_per_s: Gain = 0.8
    reach_mps: NonNegative = 0.04
    layer_m: Length = 0.02

    @property
    def slope_per_s(self) -> float:
        """Gain inside the boundary layer [1/s]; together with the loop's delay it decides on stability."""
        return self.k_per_s + self.reach_mps / self.layer_m


def sliding_feedback(error: Array, gains: SlidingGains) -> Array:
    r"""Return the feedback velocity of the controlled point.

    .. math:: u = -k e - \rho\,\mathrm{sat}(-1, e/\delta, 1)

    on each axis. It is continuous, odd and strictly falling in e.

    Source: our reading of the comparison of Zheng et al. (their reference [22]), whose equations they do not
    print; the boundary layer is that of J.-J. Slotine and W. Li, "Applied Nonlinear Control", 1991, section
    7.2.

    Args:
        error: Position error of the controlled point [m], any shape.
        gains: k [1/s], rho [m/s] and delta [m].

    Returns:
        Velocity [m/s], same shape.
    """
    switching = np.minimum(np.maximum(error / gains.layer_m, -1.0), 1.0)
    feedback: Array = -gains.k_per_s * error - gains.reach_mps * switching
    return feedback
