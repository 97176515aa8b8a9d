import math

import numpy as np
import pytest

from msrr_control.sequence.search import SearchSpec, scan, turn_rate
from msrr_scenes.specs.control import DockingSpec
from msrr_scenes.specs.vehicle import LimitsSpec

SPEC = SearchSpec()
TIME_S = DockingSpec().search_time_s
LIMITS = {setting: LimitsSpec(setting=setting) for setting in ("normal", "tight")}


def _headings(limits: LimitsSpec, duration: float, dt: float = 0.01) -> np.ndarray:
    """Return the headings of a unit that follows the scan with the lag and limits of its drive [rad]."""
    heading, w, headings = 0.0, 0.0, []
    for elapsed in np.arange(0.0, duration, dt):
        wanted, rate = scan(elapsed, duration, SPEC, limits.w_max_radps)
        command = turn_rate(wanted - heading, SPEC, limits.w_max_radps, rate)
        most = limits.dw_max_radps2 * dt
        w += min(max((1.0 - math.exp(-limits.kappa_per_s * dt)) * (command - w), -most), most)
        heading += w * dt
        headings.append(heading)
    return np.array(headings)


@pytest.mark.parametrize("setting", ["normal", "tight"])
def test_a_unit_looks_to_both_sides_in_time(setting: str) -> None:
    headings = _headings(LIMITS[setting], TIME_S)
    sweep = math.radians(SPEC.sweep_deg)
    assert 0.97 * sweep < headings.max() < 1.06 * sweep
    assert 0.97 * sweep < -headings.min() < 1.06 * sweep


@pytest.mark.parametrize("setting", ["normal", "tight"])
@pytest.mark.parametrize("duration", [3.0, 4.0])
def test_a_short_search_is_narrower_on_both_sides_alike(setting: str, duration: float) -> None:
    headings = _headings(LIMITS[setting], duration)
    assert 0.3 < headings.max() < math.radians(SPEC.sweep_deg)
    assert -headings.min() == pytest.approx(headings.max(), rel=0.25)


def test_the_scan_is_continuous_and_its_rate_is_its_slope() -> None:
    times = np.linspace(0.0, 3.0 * TIME_S, 30_001)
    angles, rates = np.array([scan(t, TIME_S, SPEC, 1.5) for t in times]).T
    assert np.all(angles[times < SPEC.wait_s] == 0.0)
    slopes = np.diff(angles) / np.diff(times)
    assert np.abs(slopes).max() < 0.6
    turns = np.diff(rates) != 0.0
    assert 3 < turns.sum() < 10
    np.testing.assert_allclose(slopes[~turns], rates[:-1][~turns], atol=1e-6)


@pytest.mark.parametrize("elapsed", [0.0, 1e-9, 1e6, 4.0])
@pytest.mark.parametrize("duration", [0.2, SPEC.wait_s, 4.0])
def test_the_scan_is_bounded_for_any_time(elapsed: float, duration: float) -> None:
    angle, rate = scan(elapsed, duration, SPEC, 1.5)
    assert abs(angle) <= math.radians(SPEC.sweep_deg) + 1e-12
    assert abs(rate) <= 0.6 + 1e-12


def test_a_unit_that_must_not_turn_does_not_scan() -> None:
    assert scan(2.0, TIME_S, SPEC, 0.0) == (0.0, 0.0)


def test_the_turn_is_towards_the_target_and_limited() -> None:
    assert turn_rate(0.1, SPEC, 1.5) == pytest.approx(0.1 * SPEC.k_per_s)
    assert turn_rate(0.1, SPEC, 1.5, rate=-0.2) == pytest.approx(0.1 * SPEC.k_per_s - 0.2)
    assert turn_rate(-3.0, SPEC, 1.5) == -0.75
