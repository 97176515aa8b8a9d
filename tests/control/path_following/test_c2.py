import numpy as np

from msrr_control.path_following.c1 import C1PathFollowingLaw, C1PathFollowingParams
from msrr_control.path_following.c2 import C2PathFollowingLaw, C2PathFollowingParams
from msrr_control.path_following.path import PaceSpec
from msrr_control.studies.path_following_study import run_path_following_study
from msrr_scenes.specs.vehicle import LimitsSpec

NORMAL = LimitsSpec.model_validate({})


def test_c2_is_pushed_back_where_c1_is_led_around() -> None:
    c1 = C1PathFollowingLaw(C1PathFollowingParams(pace=PaceSpec(lag_m=10.0)), NORMAL, 0.1)
    c2 = C2PathFollowingLaw(C2PathFollowingParams(), NORMAL, 0.1)
    a, b = (run_path_following_study(law, NORMAL, np.random.default_rng(5), 60) for law in (c1, c2))
    assert np.median(b.figures()["amplitude"]) > 1.4 * np.median(a.figures()["amplitude"])
    assert np.nanmedian(b.figures()["tracking"]) < 0.01
    assert a.body_distance().min() > 0.08
    assert b.body_distance().min() > 0.08
