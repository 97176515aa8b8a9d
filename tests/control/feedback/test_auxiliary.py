import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from msrr_control.feedback.auxiliary import AuxiliaryGains, auxiliary_step

GAINS = AuxiliaryGains(k_mps=0.05, gamma_m=0.10)
ANY = st.floats(-1e6, 1e6)
STATES = st.floats(-1.5, 1.5)
STEPS = st.floats(0.0, 1e3)


@settings(max_examples=200, deadline=None)
@given(STATES, ANY, STEPS)
def test_any_step_stays_within_the_clamp(state: float, excess: float, dt: float) -> None:
    after = auxiliary_step(np.array(state), np.array(excess), GAINS, dt)
    assert np.isfinite(after)
    assert abs(after) <= GAINS.clamp


@settings(max_examples=200, deadline=None)
@given(STATES, st.floats(-2.0, 2.0), st.floats(1e-4, 1.0))
def test_the_step_solves_the_implicit_equation_wherever_the_clamp_is_idle(
    state: float, excess: float, dt: float
) -> None:
    after = auxiliary_step(np.array(state), np.array(excess), GAINS, dt)
    left = GAINS.gamma_m * np.tanh(after) + dt * GAINS.k_mps * after
    right = GAINS.gamma_m * np.tanh(state) + dt * excess
    if abs(after) < GAINS.clamp - 1e-9:
        assert left == pytest.approx(right, abs=1e-9)
    else:
        assert abs(right) >= abs(left) - 1e-9


@settings(max_examples=100, deadline=None)
@given(STATES, ANY, STEPS)
def test_the_step_is_odd(state: float, excess: float, dt: float) -> None:
    plus = auxiliary_step(np.array(state), np.array(excess), GAINS, dt)
    minus = auxiliary_step(np.array(-state), np.array(-excess), GAINS, dt)
    assert plus == -minus


@settings(max_examples=100, deadline=None)
@given(STATES, STEPS)
def test_without_excess_the_state_decays_and_keeps_its_sign(state: float, dt: float) -> None:
    after = float(auxiliary_step(np.array(state), np.array(0.0), GAINS, dt))
    assert abs(after) <= abs(state) + 1e-12
    assert after * state >= 0.0


def test_it_converges_where_explicit_euler_escapes() -> None:
    """At Delta = 0.2 and 20 ms explicit Euler diverges; this settles at k L = Delta or at the clamp."""
    state = np.zeros(2)
    for _ in range(2000):
        state = auxiliary_step(state, np.array([0.02, 0.2]), GAINS, 0.02)
    assert state[0] == pytest.approx(0.02 / GAINS.k_mps, abs=1e-6)
    assert state[1] == GAINS.clamp


def test_small_steps_agree_with_the_differential_equation() -> None:
    """One second in 1e-4 s steps against an independent explicit integration that is stable at that step."""
    excess, dt, state, explicit = 0.03, 1e-4, np.array(0.2), 0.2
    for _ in range(10_000):
        state = auxiliary_step(state, np.array(excess), GAINS, dt)
        explicit += dt * np.cosh(explicit) ** 2 * (-GAINS.k_mps * explicit + excess) / GAINS.gamma_m
    assert float(state) == pytest.approx(explicit, abs=1e-4)


@pytest.mark.parametrize("wrong", [{"k_mps": 0.0}, {"gamma_m": -1.0}, {"clamp": 3.0}, {"k": 1.0}])
def test_gains_are_checked(wrong: dict[str, float]) -> None:
    with pytest.raises(ValidationError):
        AuxiliaryGains.model_validate({"k_mps": 0.05, "gamma_m": 0.1, **wrong})
