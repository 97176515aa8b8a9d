"""The paper's comparison C2: its parts, and the contrast with C1 that makes it worth having."""

import numpy as np
import pytest
from pydantic import ValidationError

from msrr_control.docking.c1 import C1DockingLaw, C1DockingParams
from msrr_control.docking.c2 import C2DockingLaw, C2DockingParams
from msrr_control.docking.guidance import GuidanceSpec
from msrr_control.docking.law import DockSetup, LawInputs
from msrr_control.feedback.composite import CompositeGains
from msrr_control.feedback.sliding import SlidingGains
from msrr_control.studies.disturbance import Disturbance
from msrr_control.studies.docking_study import run_docking_study

PAPER = GuidanceSpec(contact_mps=0.11, overrun_m=0.08, lag_m=10.0, corridor_m=10.0)


def test_the_cone_correction_is_that_of_c1(facts: DockSetup) -> None:
    """Both turn to the same side where an edge is about to leave; without the correction neither does."""
    wide = LawInputs(np.array([-0.5, 0.0, 0.0]), np.array([0.5, 0.3]), np.array(1.0), np.zeros(2))
    with_it, without = (C2DockingLaw(C2DockingParams(los_correction=on), facts) for on in (True, False))
    assert with_it.step(with_it.start(wide), wide, 0.02)[0][1] > 0.0
    assert without.step(without.start(wide), wide, 0.02)[0][1] == 0.0
    lost = wide._replace(visibility=np.array(0.0))
    assert with_it.step(with_it.start(lost), lost, 0.02)[0][1] == 0.0


def test_high_gain_and_delay_separate_c1_from_c2_and_gentle_gains_do_not(facts: DockSetup) -> None:
    """k_n = 6 1/s and 100 ms + 1/kappa: (6 + 2) 0.167 > 1. 60 noisy trials at a fixed seed.

    It is C1's anti-windup that C2 lacks: with it, C2 docks as well.
    """
    wrong = Disturbance(sigma_xy_m=0.005, sigma_yaw_deg=1.0, delay_s=0.1, slip=0.02, compensated=False)

    def lateral(law: C1DockingLaw | C2DockingLaw) -> float:
        result = run_docking_study(law, facts, np.random.default_rng(3), 60, disturbance=wrong, duration=8.5)
        assert result.at_face.all()
        return float(np.median(np.abs(result.at_contact()[0])))

    def c1(k: float) -> C1DockingLaw:
        feedback = CompositeGains(k_n_per_s=k)
        return C1DockingLaw(C1DockingParams(feedback=feedback, guidance=PAPER), facts)

    def c2(k: float, *, anti_windup: bool = False) -> C2DockingLaw:
        feedback = SlidingGains(k_per_s=k)
        params = C2DockingParams(feedback=feedback, guidance=PAPER, anti_windup=anti_windup)
        return C2DockingLaw(params, facts)

    assert lateral(c1(6.0)) < 0.006
    assert lateral(c2(6.0)) > 0.013
    assert lateral(c2(6.0, anti_windup=True)) < 0.006
    assert lateral(c1(0.8)) < 0.003
    assert lateral(c2(0.8)) < 0.003


def test_anti_windup_needs_a_gain_at_which_it_ends() -> None:
    with pytest.raises(ValidationError, match="limit cycle"):
        C2DockingParams(feedback=SlidingGains(k_per_s=0.4), anti_windup=True)
