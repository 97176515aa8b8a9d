import numpy as np

from msrr_control.path_following.c1 import C1PathFollowingLaw, C1PathFollowingParams
from msrr_control.studies.disturbance import Disturbance
from msrr_control.studies.path_following_study import run_path_following_study
from msrr_scenes.specs.vehicle import LimitsSpec

NORMAL = LimitsSpec.model_validate({})


def test_wheels_that_slip_lead_the_unit_astray() -> None:
    """The odometry does not see it; only the measured pose brings the unit back."""
    law = C1PathFollowingLaw(C1PathFollowingParams(), NORMAL, 0.1)
    firm, slippery = (
        run_path_following_study(
            law, NORMAL, np.random.default_rng(7), 30, disturbance=Disturbance(slip=slip, delay_s=0.1)
        )
        for slip in (0.0, 0.05)
    )
    assert np.nanmedian(slippery.tracking_error()) > 1.2 * np.nanmedian(firm.tracking_error())
