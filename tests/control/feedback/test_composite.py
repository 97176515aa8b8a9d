import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from msrr_control.feedback.composite import CompositeGains, composite_feedback

GAINS = st.builds(
    CompositeGains,
    k_n_per_s=st.floats(0.1, 10.0),
    alpha=st.floats(0.05, 0.95),
    predefined_s=st.floats(1.0, 50.0),
)
ERRORS = st.floats(-10.0, 10.0)


@settings(max_examples=200, deadline=None)
@given(GAINS, ERRORS)
def test_finite_and_odd(gains: CompositeGains, error: float) -> None:
    plus = composite_feedback(np.array(error), gains)
    assert np.isfinite(plus)
    assert composite_feedback(np.array(-error), gains) == -plus


@settings(max_examples=100, deadline=None)
@given(GAINS, ERRORS, ERRORS)
def test_falls_strictly(gains: CompositeGains, a: float, b: float) -> None:
    low, high = sorted((a, b))
    if high - low > 1e-9 * max(abs(low), abs(high), 1e-6):
        assert composite_feedback(np.array(low), gains) > composite_feedback(np.array(high), gains)


@settings(max_examples=50, deadline=None)
@given(GAINS)
def test_continuous_at_zero(gains: CompositeGains) -> None:
    """As printed the term commands metres per second at 1 mm and diverges at 0; corrected it vanishes."""
    assert composite_feedback(np.array(0.0), gains) == 0.0
    sizes = 10.0 ** -np.arange(2.0, 300.0)
    values = np.abs(composite_feedback(sizes, gains))
    assert np.all(np.diff(values) < 0.0)
    bound = 0.1 * 1e-2 ** (1.0 - gains.alpha) / (gains.alpha * gains.predefined_s)
    assert values[-1] < bound


def test_its_value_at_a_known_point() -> None:
    gains = CompositeGains(k_n_per_s=0.8, alpha=0.3, predefined_s=20.0)
    by_hand = -0.8 * 0.05 - np.exp(0.05**0.3) * 0.05**0.7 / (0.3 * 20.0)
    assert composite_feedback(np.array(0.05), gains) == pytest.approx(by_hand)
    linear = gains.model_copy(update={"nonlinear": False})
    assert composite_feedback(np.array(0.05), linear) == pytest.approx(-0.04)
