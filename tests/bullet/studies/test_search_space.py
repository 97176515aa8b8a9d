"""The search spaces: every controller has one, of parameters whose ranges hold their defaults."""

import numpy as np
import pytest

from msrr_bullet.studies.search_space import SEARCH_SPACE, params_at, shipped_values
from msrr_control.docking.controller import CONTROLLERS

EVERY = [(part, name) for part, names in SEARCH_SPACE.items() for name in names]


def test_every_docking_controller_can_be_tuned() -> None:
    assert set(SEARCH_SPACE["docking"]) == set(CONTROLLERS)


@pytest.mark.parametrize(("part", "name"), EVERY)
def test_the_ranges_hold_the_defaults(part, name: str) -> None:
    for parameter, value in zip(SEARCH_SPACE[part][name], shipped_values(part, name), strict=True):
        assert parameter.low <= value <= parameter.high, parameter


@pytest.mark.parametrize(("part", "name"), EVERY)
def test_a_point_becomes_parameters_of_four_digits(part, name: str) -> None:
    point = np.log([1.000049 * value for value in shipped_values(part, name)])
    params = params_at(part, name, point)
    for parameter, value in zip(SEARCH_SPACE[part][name], shipped_values(part, name), strict=True):
        found = params
        for key in parameter.name.split("."):
            found = found[key]
        assert found == float(f"{1.000049 * value:.4g}")
