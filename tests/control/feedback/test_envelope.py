import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from msrr_control.feedback.envelope import (
    EnvelopeGains,
    braking_speed,
    envelope,
    envelope_slope,
    enveloped_acceleration,
)

GAINS = EnvelopeGains()
ALL_GAINS = st.builds(
    EnvelopeGains, gamma=st.floats(0.05, 0.5), rho=st.floats(0.01, 0.2), alpha_per_s=st.floats(0.5, 5.0)
)


@settings(max_examples=100, deadline=None)
@given(ALL_GAINS, st.floats(-5.0, 5.0))
def test_the_slope_is_the_finite_difference(gains: EnvelopeGains, position: float) -> None:
    h = 1e-6
    if abs(position) < 2e-3 * gains.rho + 2 * h:
        position = 0.3
    x = np.array([position - h, position + h])
    numeric = np.diff(envelope(x, gains))[0] / (2 * h)
    assert envelope_slope(np.array(position), gains) == pytest.approx(numeric, rel=1e-4, abs=1e-6)


@settings(max_examples=100, deadline=None)
@given(ALL_GAINS)
def test_continuous_and_falling_through_the_bound(gains: EnvelopeGains) -> None:
    x = gains.rho * np.concatenate([-np.logspace(2, -12, 400), [0.0], np.logspace(-12, 2, 400)])
    assert np.all(np.diff(envelope(x, gains)) <= 1e-12)
    slope = envelope_slope(x, gains)
    assert np.all(slope <= 0.0)
    near = np.abs(x) < 1e-4 * gains.rho
    np.testing.assert_allclose(slope[near], -np.sqrt(gains.gamma / gains.rho), rtol=1e-3)


@settings(max_examples=100, deadline=None)
@given(ALL_GAINS, st.floats(0.0, 1.0))
def test_the_envelope_asks_for_no_more_than_gamma_inside(gains: EnvelopeGains, share: float) -> None:
    """|F' F| <= gamma from far away up to rho beyond the bound: why gamma < u_max is needed."""
    for position in (-10.0 * share, share * gains.rho):
        x = np.array(position)
        assert abs(envelope(x, gains) * envelope_slope(x, gains)) <= gains.gamma * (1 + 1e-9)


@pytest.mark.parametrize("distance", [0.0, 1e-300, 1e-9, 1e-4, 1.0, 1e6, 1e300])
def test_the_braking_speed_is_finite_from_nothing_to_very_far(distance: float) -> None:
    speed = braking_speed(np.array([distance, -distance]), GAINS)
    assert np.all(np.isfinite(speed))
    assert speed[0] == speed[1]
    far = np.sqrt(max(2 * GAINS.gamma * (distance - GAINS.rho * np.log(2)), 0.0))
    assert speed[0] >= far
    if distance > 1.0:
        assert speed[0] == pytest.approx(far)


def _run(
    x: np.ndarray, v: np.ndarray, gains, max_acceleration: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """Return how far double integrators get below 0 under random commands, mostly towards the wall there."""
    dt, farthest = 0.002, -x
    wanted = np.zeros_like(x)
    for k in range(600):
        if k % 25 == 0:
            wanted = np.where(rng.random(len(x)) < 0.7, -2.0, 2.0) * rng.random(len(x))
        u = np.empty_like(x)
        for i, g in enumerate(gains):
            part = slice(i, None, len(gains))
            u[part] = enveloped_acceleration(wanted[part], x[part], v[part], g, max_acceleration[i])
        x, v = x + dt * v + 0.5 * dt * dt * u, v + dt * u
        farthest = np.maximum(farthest, -x)
    return farthest


def test_no_wish_leads_from_inside_the_envelope_across_the_wall() -> None:
    """20,000 random states, gains and wanted accelerations; the tolerance is what a step of 2 ms can add."""
    rng = np.random.default_rng(21)
    max_acceleration = rng.uniform(0.3, 1.0, size=20)
    gains = [
        EnvelopeGains(gamma=m * rng.uniform(0.2, 0.9), rho=rng.uniform(0.02, 0.15), alpha_per_s=a)
        for m, a in zip(max_acceleration, rng.uniform(1.0, 4.0, size=20), strict=True)
    ]
    x = rng.uniform(0.0, 0.6, size=20_000)
    v = np.empty_like(x)
    for i, g in enumerate(gains):
        part = slice(i, None, 20)
        v[part] = -rng.uniform(-0.5, 1.0, size=1000) * envelope(-x[part], g)
    assert _run(x, v, gains, max_acceleration, rng).max() < 2e-5


def test_arbitrary_states_do_cross_and_are_pulled_back() -> None:
    rng = np.random.default_rng(22)
    x, v = rng.uniform(-0.1, 0.3, size=2000), rng.uniform(-0.5, 0.5, size=2000)
    assert (_run(x, v, [GAINS], np.array([0.5]), rng) > 0.01).mean() > 0.05
    for _ in range(8000):
        u = enveloped_acceleration(np.full_like(x, -2.0), x, v, GAINS, 0.5)
        x, v = x + 0.002 * v, v + 0.002 * u
    assert x.min() > -0.005


def test_far_from_the_wall_only_the_drive_limits_what_is_wanted() -> None:
    wanted = np.random.default_rng(23).normal(size=200)
    free = enveloped_acceleration(wanted, np.full(200, 9.0), np.zeros(200), GAINS, 0.5)
    np.testing.assert_array_equal(free, np.clip(wanted, -0.5, 0.5))
