"""Slopes of errors at contact: exact on exact data, with an interval that holds the truth."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from msrr_bullet.tolerance.model import ContactError, StudyTrial
from msrr_bullet.tolerance.slopes import contact_slope, fit_slope


@given(st.floats(-10.0, 10.0), st.lists(st.sampled_from([-2.0, -1.0, 1.0, 2.0]), min_size=2, max_size=12))
def test_a_push_to_one_side_has_the_same_slope_by_both_figures(slope: float, errors: list[float]) -> None:
    error = np.array(errors)
    found = fit_slope(error, slope * error, drawn=False)
    assert found.systematic == pytest.approx(slope)
    assert found.rms == pytest.approx(abs(slope))
    assert found.low == pytest.approx(found.rms)
    assert found.high == pytest.approx(found.rms)


@given(st.integers(0, 1000))
def test_what_is_the_same_in_every_trial_is_at_most_the_whole(seed: int) -> None:
    rng = np.random.default_rng(seed)
    error, change = rng.choice([-1.0, 1.0], 12), rng.standard_normal(12)
    found = fit_slope(error, change, drawn=False)
    assert found.systematic is not None
    assert abs(found.systematic) <= found.rms
    assert found.low <= found.rms <= found.high


def test_a_push_to_either_side_is_no_slope_but_an_error() -> None:
    error, change = np.array([1.0, -1.0, 1.0, -1.0]), np.array([0.5, 0.5, -0.5, -0.5])
    found = fit_slope(error, change, drawn=False)
    assert (found.rms, found.systematic) == (0.5, 0.0)
    assert fit_slope(np.abs(error), change, drawn=True).systematic is None


def test_intervals_hold_the_truth_as_often_as_they_say() -> None:
    """Of 200 intervals of 95 % from 20 normal changes at least 160 hold the truth.

    A percentile bootstrap of 20 values covers about 90 %; 159 of 200 or fewer then have odds below 1e-4.
    """
    rng = np.random.default_rng(1)
    held = 0
    for _ in range(200):
        found = fit_slope(np.full(20, 2.0), 2.0 * 0.7 * rng.standard_normal(20), drawn=True)
        held += found.low <= 0.7 <= found.high
    assert held >= 160


def trial(seed: int, error: float | None, **lateral_mm: float) -> StudyTrial:
    contacts = {dock: ContactError(lateral_mm=mm, yaw_deg=0.0) for dock, mm in lateral_mm.items()}
    return StudyTrial(seed=seed, error=error, outcome="docked", succeeded=True, contacts=contacts)


def test_only_docks_with_a_contact_on_both_sides_are_pairs() -> None:
    without = [trial(0, None, first=0.1, second=-0.3), trial(1, None)]
    with_effect = [trial(0, 2.0, first=1.1), trial(1, -2.0, first=5.0), trial(2, 2.0, first=5.0)]
    found = contact_slope(with_effect, without, "lateral_mm", drawn=False)
    assert found is not None
    assert found.pairs == 1
    assert found.systematic == pytest.approx(0.5)
    assert contact_slope([trial(0, 2.0)], without, "lateral_mm", drawn=False) is None
