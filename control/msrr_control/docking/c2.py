"""The close-range law C2: our reading of the law with which the paper compares C1.

The paper prints no equations of it; it describes it in words and names a source.
"""

from __future__ import annotations

from pydantic import model_validator

from msrr_control.docking.corrected_law import CorrectedLaw, CorrectedLawParams
from msrr_control.feedback.sliding import SlidingGains, sliding_feedback
from msrr_scenes.arrays import Array


class C2DockingParams(CorrectedLawParams):
    """Parameters of :class:`C2DockingLaw`.

    Attributes:
        feedback: Sliding feedback with a boundary layer.
        anti_windup: Whether the anti-windup system of C1 is used all the same, to show how much of the
            contrast is due to it.
    """

    feedback: SlidingGains = SlidingGains()
    anti_windup: bool = False

    @model_validator(mode="after")
    def _windup_below_loop(self) -> C2DockingParams:
        if self.anti_windup:
            self.windup.check_below(self.feedback.k_per_s, "feedback.k_per_s")
        return self


class C2DockingLaw(CorrectedLaw[C2DockingParams]):
    r"""Tracks the reference of C1 by sliding feedback, without anti-windup.

    .. math:: e = p_l - (p_r + \lambda_1),\quad u = u_s(e) + \dot p_r + \dot\lambda_1

    Source: our reading of the comparison of Zheng et al. (their reference [22]), whose equations they do not
    print; it takes no account of the drive's limits.
    """

    def feedback(self, error: Array) -> Array:
        """Return the sliding feedback, shape (..., 2) [m/s]."""
        return sliding_feedback(error, self.params.feedback)
