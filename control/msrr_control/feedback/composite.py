"""The composite feedback of the close-range phase: a linear and a nonlinear term."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from msrr_scenes.arrays import Array
from msrr_scenes.specs.spec import Duration, Gain, Spec


class CompositeGains(Spec):
    """Gains of the composite feedback.

    Attributes:
        k_n_per_s: Linear gain k_n.
        alpha: Exponent of the nonlinear term, in (0, 1).
        predefined_s: T, the predefined time of the nonlinear term. At 20 s the term is 0.7 times the linear
            one at an error of 0.1 m, as large at 0.01 m and twice as large at 1 mm; at 5 s it is four times
            that, which costs about 5 mm and 3 deg under noise.
        nonlinear: Whether the nonlinear term is used (False is an ablation).
    """

    k_n_per_s: Gain = 0.8
    alpha: float = Field(default=0.3, gt=0.0, lt=1.0)
    predefined_s: Duration = 20.0
    nonlinear: bool = True


def composite_feedback(error: Array, gains: CompositeGains) -> Array:
    r"""Return the feedback velocity of the controlled point.

    .. math:: u = -k_n e - \frac{e^{|e|^\alpha}\,\mathrm{sig}(e)^{1-\alpha}}{\alpha T},\quad
        \mathrm{sig}(e)^a = |e|^a\,\mathrm{sgn}(e)

    on each axis. It is finite, continuous at 0, odd and strictly falling in e, and not bounded.

    Source: Zheng et al., eqs. 26 and 27; exponent sign corrected (printed -alpha, unbounded at e = 0).

    Args:
        error: Position error of the controlled point in the dock frame [m], any shape. The exponential
            overflows beyond (700)**(1 / alpha) m, far outside of what ``position_error`` lets through.
        gains: ``k_n`` [1/s], ``alpha`` and ``T`` [s].

    Returns:
        Velocity [m/s], same shape.
    """
    linear: Array = -gains.k_n_per_s * error
    if not gains.nonlinear:
        return linear
    magnitude = np.abs(error)
    nonlinear = np.exp(magnitude**gains.alpha) * magnitude ** (1.0 - gains.alpha)
    return linear - np.copysign(nonlinear, error) / (gains.alpha * gains.predefined_s)
