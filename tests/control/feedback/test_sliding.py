import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from msrr_control.feedback.sliding import SlidingGains, sliding_feedback

GAINS = SlidingGains(k_per_s=1.2, reach_mps=0.05, layer_m=0.02)
FINITE = st.floats(-10.0, 10.0)


@given(FINITE, FINITE)
def test_the_sliding_feedback_is_odd_and_falls(a: float, b: float) -> None:
    u = sliding_feedback(np.array([a, b, -a]), GAINS)
    assert u[2] == -u[0]
    assert (u[0] - u[1]) * (a - b) <= 0.0


def test_the_sliding_feedback_is_steep_inside_its_layer_and_bounded_by_its_speed_beyond() -> None:
    inside, edge, beyond = sliding_feedback(np.array([1e-3, 0.02, 1.0]), GAINS)
    assert inside == pytest.approx(-GAINS.slope_per_s * 1e-3)
    assert edge == pytest.approx(-(1.2 * 0.02 + 0.05))
    assert beyond == pytest.approx(-(1.2 + 0.05))
