"""The paper's close-range law C1: composite feedback, line-of-sight correction and anti-windup."""

from __future__ import annotations

from pydantic import model_validator

from msrr_control.docking.corrected_law import CorrectedLaw, CorrectedLawParams
from msrr_control.docking.guidance import GuidanceSpec
from msrr_control.feedback.composite import CompositeGains, composite_feedback
from msrr_scenes.arrays import Array
from msrr_scenes.specs.spec import Gain, Spec


class C1DockingParams(CorrectedLawParams):
    """Parameters of :class:`C1DockingLaw`; the two switches and ``feedback.nonlinear`` are ablations.

    Attributes:
        feedback: Composite feedback (eqs. 26, 27).
    """

    feedback: CompositeGains = CompositeGains()

    @model_validator(mode="after")
    def _windup_below_loop(self) -> C1DockingParams:
        if self.anti_windup:
            self.windup.check_below(self.feedback.k_n_per_s, "feedback.k_n_per_s")
        return self


class C1DockingLaw(CorrectedLaw[C1DockingParams]):
    """The close-range law C1 (Zheng et al., eqs. 21 to 29) in its corrected form."""

    def feedback(self, error: Array) -> Array:
        """Return the composite feedback (eqs. 26, 27), shape (..., 2) [m/s]."""
        return composite_feedback(error, self.params.feedback)


class LinearParams(Spec):
    """Parameters of the plain linear law: the guidance and one gain.

    Attributes:
        k_n_per_s: Gain of the linear tracking.
        guidance: Guidance trajectory.
    """

    k_n_per_s: Gain = 0.8
    guidance: GuidanceSpec = GuidanceSpec()

    def as_c1(self) -> C1DockingParams:
        """Return the parameters of C1 with everything but the linear term switched off."""
        return C1DockingParams(
            feedback=CompositeGains(k_n_per_s=self.k_n_per_s, nonlinear=False),
            guidance=self.guidance,
            los_correction=False,
            anti_windup=False,
        )
