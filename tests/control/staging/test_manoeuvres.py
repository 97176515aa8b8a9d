"""Turns on the spot and straight ways: they end where they should, in time and within the drive's limits."""

from __future__ import annotations

import math

import pytest

from msrr_control.staging.manoeuvres import StraightDrive, spot_turn
from msrr_control.staging.parameters import RouteFollowingParams
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.specs.vehicle import LimitsSpec

PARAMS, LIMITS = RouteFollowingParams(), LimitsSpec.model_validate({})
SLOW = LIMITS.model_copy(update={"v_max_mps": 0.04, "w_max_radps": 0.5})
DT_S = 0.02


@pytest.mark.parametrize("error", [-3.0, -0.1, 0.02, 0.4, 3.1])
def test_a_turn_on_the_spot_goes_towards_its_end_and_slows_down_before_it(error: float) -> None:
    for limits in (LIMITS, SLOW):
        fastest = min(0.7 * limits.w_max_radps, 1.0)
        twist = spot_turn(error, PARAMS, limits)
        assert twist.v == 0.0
        assert twist.w == pytest.approx(math.copysign(min(PARAMS.turn_per_s * abs(error), fastest), error))


def test_a_turn_on_the_spot_may_be_allowed_in_part() -> None:
    for allowed in (0.0, 0.05, 0.2):
        assert spot_turn(-0.2, PARAMS, LIMITS, allowed) == spot_turn(-allowed, PARAMS, LIMITS)
    assert spot_turn(-0.2, PARAMS, LIMITS, 0.3) == spot_turn(-0.2, PARAMS, LIMITS)


@pytest.mark.parametrize("distance", [-0.5, -0.03, 0.3])
@pytest.mark.parametrize(("limits", "fastest"), [(LIMITS, 0.1), (SLOW, 0.04)])
def test_a_straight_way_ends_at_its_length_in_time(
    distance: float, limits: LimitsSpec, fastest: float
) -> None:
    way = StraightDrive(SE2(0.3, -0.2, 2.0), distance)
    X_WU, time_s, reached = way.X_WS, 0.0, 0.0
    while (twist := way.step(X_WU, limits)) is not None:
        assert twist.w == 0.0
        assert twist.v * distance > 0.0
        reached = max(reached, abs(twist.v))
        X_WU, time_s = X_WU @ SE2(DT_S * twist.v, 0.0, 0.0), time_s + DT_S
    assert (way.X_WS.inverse() @ X_WU).x == pytest.approx(distance, abs=0.01)
    assert reached == pytest.approx(min(fastest, 2.0 * abs(distance)))
    assert time_s < way.longest_s(limits) < abs(distance) / fastest + 5.0
    past = way.X_WS @ SE2(1.2 * distance + math.copysign(0.02, distance), 0.5, 0.3)
    back = way.step(past, limits)
    assert back is not None
    assert back.v * distance < 0.0, "one that has gone too far comes back"
