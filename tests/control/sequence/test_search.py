import math

import numpy as np
import pytest

from msrr_control.sequence.search import SearchSpec, scan_angle, turn_rate

SPEC = SearchSpec()


def test_both_sides_are_looked_at_in_time_and_the_scan_has_no_jump() -> None:
    times = np.linspace(0.0, 4.0, 4001)
    angles = np.array([scan_angle(t, 4.0, SPEC) for t in times])
    assert np.all(angles[times < SPEC.wait_s] == 0.0)
    assert angles.max() == pytest.approx(math.radians(SPEC.sweep_deg), abs=0.01)
    assert angles.min() == pytest.approx(-math.radians(SPEC.sweep_deg), abs=0.01)
    assert np.abs(np.diff(angles)).max() < 0.01


@pytest.mark.parametrize("elapsed", [0.0, 1e-9, 1e6, 4.0])
def test_the_scan_is_bounded_for_any_time(elapsed: float) -> None:
    assert abs(scan_angle(elapsed, 0.2, SPEC)) <= math.radians(SPEC.sweep_deg) + 1e-12


def test_the_turn_is_towards_the_target_and_limited() -> None:
    assert turn_rate(0.1, SPEC, 1.5) == pytest.approx(0.1 * SPEC.k_per_s)
    assert turn_rate(-3.0, SPEC, 1.5) == -0.75
