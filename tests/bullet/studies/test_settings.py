"""Settings: overridden parameters, and what belongs to the shipped unit."""

import math

import pytest

from msrr_bullet.studies.settings import HARD, STANDARD, merge_params


def test_overrides_apply_at_every_level_and_leave_their_arguments_as_they_are() -> None:
    base = {"a": 1, "b": {"c": 2, "d": {"e": 3}}}
    overrides = {"b": {"d": {"e": 4}, "f": 5}, "g": {"h": 6}}
    merged = merge_params(base, overrides)
    assert merged == {"a": 1, "b": {"c": 2, "d": {"e": 4}, "f": 5}, "g": {"h": 6}}
    assert base == {"a": 1, "b": {"c": 2, "d": {"e": 3}}}
    assert merge_params({"a": {"b": 1}}, {"a": False}) == {"a": False}


def test_tight_limits_are_stricter() -> None:
    assert HARD.limits_spec.w_max_radps < STANDARD.limits_spec.w_max_radps
    assert HARD.dock_setup().limits.w_max_radps == HARD.limits_spec.w_max_radps
    assert STANDARD.half_fov == pytest.approx(math.radians(37.5))
