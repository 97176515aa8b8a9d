"""Settings: captions that say what is drawn, overridden parameters, and what belongs to the shipped unit."""

import math
import re

import numpy as np
import pytest

from msrr_bullet.studies import settings
from msrr_bullet.studies.docking_studies import run_docking
from msrr_bullet.studies.path_following_studies import run_path_following
from msrr_bullet.studies.settings import HARD, NO_LAG, STANDARD, Setting, merge_params
from msrr_scenes.specs.spec import Choice

ALL = [value for value in vars(settings).values() if isinstance(value, Setting)]


@pytest.mark.parametrize(
    "setting",
    [*ALL[:2], *(pytest.param(setting, marks=pytest.mark.nightly) for setting in ALL[2:])],
    ids=lambda s: s.name,
)
def test_captions_say_what_is_drawn(setting: Setting) -> None:
    """The starts of 100 trials of each phase fill what the caption of that phase says, and no more."""
    seeds = range(100)
    ((cm, deg),) = re.findall(r"starts within ([\d.]+) cm and ([\d.]+) deg", setting.description("long"))
    start = run_path_following(Choice(name="c1"), setting, seeds).pose[0]
    farthest = 100.0 * np.abs(start[:, :2] + [0.10, 0.0]).max(), np.degrees(np.abs(start[:, 2])).max()
    assert farthest == pytest.approx((float(cm), float(deg)), rel=0.1)
    assert (farthest[0] <= float(cm)) & (farthest[1] <= float(deg))
    pattern = r"starts within ([\d.]+) cm along and ([\d.]+) cm across the axis and ([\d.]+) deg"
    ((along, across, deg),) = re.findall(pattern, setting.description("close"))
    result = run_docking(Choice(name="c1"), setting, seeds, duration_s=0.1)
    tip, yaw = np.abs(result.tip[0] - [-0.70, 0.0]).max(axis=0), np.abs(result.pose[0, :, 2]).max()
    farthest = (*(100.0 * tip), np.degrees(yaw))
    said = [float(value) for value in (along, across, deg)]
    assert all(0.8 * bound <= value <= bound for value, bound in zip(farthest, said, strict=True))


@pytest.mark.parametrize("setting", ALL, ids=lambda s: s.name)
def test_noise_is_that_of_every_measurement(setting: Setting) -> None:
    wrong, caption = setting.disturbance, setting.description("close")
    noisy = {wrong.sigma_xy_m > 0.0, wrong.sigma_yaw_deg > 0.0, wrong.sigma_bearing_deg > 0.0}
    assert len(noisy) == 1
    assert (f"{wrong.sigma_bearing_deg:g} deg of each edge angle" in caption) is noisy.pop()
    assert ("does not compensate" in caption) is (wrong.delay_s > 0.0 and not wrong.compensated)
    assert ("TIGHT" in caption) is (setting.limits == "tight")


def test_overrides_apply_at_every_level_and_leave_their_arguments_as_they_are() -> None:
    base = {"a": 1, "b": {"c": 2, "d": {"e": 3}}}
    overrides = {"b": {"d": {"e": 4}, "f": 5}, "g": {"h": 6}}
    merged = merge_params(base, overrides)
    assert merged == {"a": 1, "b": {"c": 2, "d": {"e": 4}, "f": 5}, "g": {"h": 6}}
    assert base == {"a": 1, "b": {"c": 2, "d": {"e": 3}}}
    assert merge_params({"a": {"b": 1}}, {"a": False}) == {"a": False}


def test_tight_limits_are_stricter() -> None:
    assert HARD.scene.limits.w_max_radps < STANDARD.scene.limits.w_max_radps
    assert HARD.dock_setup().limits.w_max_radps == HARD.scene.limits.w_max_radps
    assert NO_LAG.scene.limits.kappa_per_s == NO_LAG.dock_setup().limits.kappa_per_s == 1000.0
    assert STANDARD.scene.cameras.onboard.lens.half_fov == pytest.approx(math.radians(37.5))
