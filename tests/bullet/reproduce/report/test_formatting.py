"""Values and quantiles in the unit of their measure, and what is added to them."""

import math

import numpy as np
import pytest

from msrr_bullet.reproduce.report.comparisons import format_interval
from msrr_bullet.reproduce.report.formatting import format_quantiles, format_rate, format_value
from msrr_bullet.statistics import wilson
from msrr_bullet.studies.measures import MEASURES, measure
from msrr_bullet.studies.model import Measured, Row, rate_of

ALL = [m for measures in MEASURES.values() for m in measures]


def test_a_rate_has_its_interval() -> None:
    assert format_rate(wilson(97, 100)) == "97.0 % (91.5 .. 99.0)"


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ([1.0] * 18 + [math.inf] * 2, "1 / never (2 never)"),
        ([math.inf] * 20, "never / never (20 never)"),
        ([1.0] * 15 + [math.nan] * 5, "1 / 1 (n = 15)"),
        ([math.nan] * 20, "-"),
    ],
)
def test_trials_without_a_value_are_counted(values: list[float], text: str) -> None:
    row = Row(
        controller="c1",
        label="C1",
        trials=20,
        success=rate_of(np.ones(20, dtype=bool)),
        measures={"settling": Measured.of(values)},
    )
    assert format_quantiles(row, measure("settling")) == text


def test_values_and_intervals_are_never_powers_of_ten() -> None:
    tracking, recovery = measure("tracking"), measure("recovery")
    assert [format_value(v, tracking) for v in (0.02, 0.99949, 1.3)] == ["20", "999", "1300"]
    assert format_interval((-0.3, math.inf), recovery) == "-0.3 .. never"


@pytest.mark.parametrize("what", ALL, ids=lambda m: m.key)
def test_every_measure_is_shown_in_its_unit(what) -> None:
    """One tenth in SI is 100 mm, 0.1 m, 0.1 s and 5.73 deg."""
    row = Row(
        controller="c1",
        label="C1",
        trials=2,
        success=rate_of(np.ones(2, dtype=bool)),
        measures={what.key: Measured.of([0.1, 0.1])},
    )
    text = {"mm": "100", "m": "0.1", "s": "0.1", "deg": "5.73"}[what.unit]
    assert format_quantiles(row, what) == f"{text} / {text}"
