"""The filter of a body that stands still: how its uncertainty grows, shrinks, and when it starts anew."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.stats import chi2

from msrr_perception.estimation.body_filter import StationaryBody, StationaryNoise
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import GlobalPose

NOISE = StationaryNoise()
S = 1_000_000_000
HERE = SE2(1.0, -0.5, 3.1)
P = np.diag([0.003**2, 0.004**2, 0.02**2])


def _measured(stamp_ns: int, X_WB: SE2 = HERE) -> GlobalPose:
    return GlobalPose("b", stamp_ns, X_WB, P)


def test_it_drifts_by_the_root_of_the_time() -> None:
    """The drift is in metres per square root of a second: 16 s add four times what one second adds."""
    noise = StationaryNoise(drift=0.002, turn_drift=0.01)
    body = StationaryBody.from_measurement(_measured(0))
    for wait_s in (0.25, 1.0, 16.0, 400.0):
        grown = body.propagate(round(wait_s * S), noise).covariance - P
        deviation = np.sqrt(np.diag(grown))
        np.testing.assert_allclose(deviation, math.sqrt(wait_s) * np.array([0.002, 0.002, 0.01]), rtol=1e-9)
        np.testing.assert_array_equal(grown - np.diag(np.diag(grown)), 0.0)


def test_waiting_is_the_same_in_one_go_and_in_many() -> None:
    body = StationaryBody.from_measurement(_measured(0))
    at_once = body.propagate(7 * S, NOISE)
    rng = np.random.default_rng(5)
    for stamp in sorted(rng.integers(1, 7 * S, 40)):
        body = body.propagate(int(stamp), NOISE)
    np.testing.assert_allclose(body.propagate(7 * S, NOISE).covariance, at_once.covariance, rtol=1e-12)
    assert at_once.X_WB == body.X_WB
    assert at_once.last_seen_ns == 0


def test_an_earlier_instant_changes_nothing() -> None:
    body = StationaryBody.from_measurement(_measured(S))
    assert body.propagate(0, NOISE) is body
    assert body.propagate(S, NOISE) is body


def test_measurements_of_a_stationary_body_are_averaged() -> None:
    """Without drift n measurements leave P / n and their mean, also across the seam of the angle."""
    still = StationaryNoise(drift=0.0, turn_drift=0.0)
    rng = np.random.default_rng(8)
    errors = rng.multivariate_normal(np.zeros(3), P, 20)
    measurements = [_measured(i * S, SE2(1.0 + e[0], -0.5 + e[1], 3.1 + e[2])) for i, e in enumerate(errors)]
    body = StationaryBody.from_measurement(measurements[0])
    for measured in measurements[1:]:
        body = body.update(measured, still)
    np.testing.assert_allclose(body.covariance, P / 20, rtol=1e-9)
    mean = errors.mean(axis=0)
    off = body.X_WB.as_array() - HERE.as_array() - mean
    off[2] = math.remainder(off[2], 2.0 * math.pi)
    np.testing.assert_allclose(off, 0.0, atol=1e-12)
    assert (body.last_seen_ns, body.rejected) == (19 * S, 0)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_the_gate_is_where_it_says(axis: int) -> None:
    """A first measurement and a second one have 2 P between them; the gate is in squares of its deviation."""
    assert pytest.approx(chi2.ppf(0.9999, 3), rel=0.01) == NOISE.gate
    body = StationaryBody.from_measurement(_measured(0))
    step = np.zeros(3)
    step[axis] = math.sqrt(NOISE.gate * 2.0 * P[axis, axis])
    for share, inside in ((0.99, True), (1.01, False), (-0.99, True), (-1.01, False)):
        x, y, yaw = HERE.as_array() + share * step
        after = body.update(_measured(0, SE2(x, y, yaw)), NOISE)
        assert (after.rejected == 0) is inside
        assert (after.X_WB == body.X_WB) is not inside


def test_a_moved_body_is_accepted_after_the_set_number_of_measurements() -> None:
    elsewhere = SE2(1.3, -0.5, 3.1)
    body = StationaryBody.from_measurement(_measured(0))
    for k in range(1, NOISE.moved_after):
        body = body.update(_measured(k * S, elsewhere), NOISE)
        assert (body.rejected, body.X_WB, body.last_seen_ns) == (k, HERE, 0)
    body = body.update(_measured(NOISE.moved_after * S, elsewhere), NOISE)
    assert (body.rejected, body.X_WB, body.last_seen_ns) == (0, elsewhere, NOISE.moved_after * S)
    np.testing.assert_array_equal(body.covariance, P)
    # What was under way since before it was moved is not a sign that it was moved back.
    assert body.update(_measured(S), NOISE) is body


def test_a_measurement_inside_the_gate_ends_the_count() -> None:
    body = StationaryBody.from_measurement(_measured(0))
    for k in range(12):
        off = SE2(1.3, -0.5, 3.1) if k % NOISE.moved_after else HERE
        body = body.update(_measured((k + 1) * S, off), NOISE)
        assert body.X_WB.x == pytest.approx(1.0, abs=0.01)
