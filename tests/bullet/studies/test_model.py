"""The results of a reproduction: values of many trials, series, and the way to JSON and back."""

import math

import numpy as np
import pytest
from pydantic import ValidationError

from msrr_bullet.studies.model import Measured, Reproduction, Table, count_within_paper, rate_of
from msrr_bullet.studies.series import Series

#: One second at 2 Hz, standing still.
SERIES = {
    "time": np.array([0.0, 0.5, 1.0]),
    "tip": np.zeros((3, 2)),
    "reference": np.zeros((3, 2)),
    "error": np.zeros((3, 3)),
    "command": np.zeros((3, 2)),
    "twist": np.zeros((3, 2)),
    "limits": (0.3, 1.0),
}


def test_a_measure_that_no_trial_has_is_no_number() -> None:
    none = Measured.of([math.nan, math.nan])
    assert none.count == 0
    assert none.quantiles.p50 is None


def test_infinite_values_are_kept_and_counted() -> None:
    measured = Measured.of([*[1.0] * 19, math.inf, math.nan])
    assert (measured.count, measured.never) == (20, 1)
    assert (measured.quantiles.p50, measured.quantiles.p95) == (1.0, math.inf)
    assert Measured.model_validate_json(measured.model_dump_json()) == measured


def test_a_trial_that_never_settles_does_not_meet_the_papers_time() -> None:
    """The paper reports 4 s for it, and 3 s for the recovery, which not every path has."""
    values = [1.0, 4.1, math.inf, math.nan]
    count = count_within_paper({"settling": values, "recovery": values})
    assert (count["settling"].n, count["settling"].of) == (1, 4)
    assert (count["recovery"].n, count["recovery"].of) == (1, 3)
    assert count_within_paper({"lateral": [0.0]}) == {}  # the paper gives no value


def test_series_are_rounded_to_the_micrometre() -> None:
    series = Series(**{**SERIES, "tip": np.full((3, 2), 1.23456789e-2)})
    assert series.tip == ((0.012346, 0.012346),) * 3
    assert series.time == (0.0, 0.5, 1.0)
    assert Series.model_validate_json(series.model_dump_json()) == series
    with pytest.raises(ValidationError):
        Series(**{**SERIES, "tip": np.zeros((3, 3))})


def test_a_table_is_found_by_phase_plant_and_setting() -> None:
    table = Table(phase="long", plant="unicycle", setting="standard", description="", rows=())
    results = Reproduction(versions={}, seeds={}, tables=(table,))
    assert results.table("long", "unicycle", "standard") is table
    assert results.table("close", "unicycle", "standard") is None


def test_a_rate_counts_true_flags() -> None:
    assert rate_of(np.array([True, False, True, True])).rate == 0.75
