import numpy as np
import pytest

from msrr_control.docking.guidance import GuidanceSpec, GuidanceState, guidance_start, guidance_step

SPEC = GuidanceSpec()
REACH, DT = 0.018, 0.02


def _run(tip_of, visibility=1.0, steps=600, start=-0.7):
    """Let a unit follow as ``tip_of(reference)`` says; return places and speeds."""
    state = guidance_start(np.array([start, 0.0]))
    places, speeds = [float(state.x)], [0.0]
    for _ in range(steps):
        state = guidance_step(state, tip_of(state), np.array(visibility), SPEC, REACH, DT)
        places.append(float(state.x))
        speeds.append(float(state.speed))
    return np.array(places), np.array(speeds)


def _on_it(state: GuidanceState):
    return np.array([float(state.x), 0.0])


def test_a_perfect_follower_sees_the_papers_trajectory() -> None:
    places, speeds = _run(_on_it)
    assert speeds.max() == pytest.approx(SPEC.speed_mps)
    assert np.argmax(speeds >= SPEC.speed_mps - 1e-12) * DT == pytest.approx(SPEC.ramp_s, abs=2 * DT)
    assert np.all(np.abs(np.diff(speeds)) <= SPEC.acceleration * DT + 1e-12)
    assert np.all(np.diff(places) >= 0.0)
    at_pins = int(np.argmax(places >= -REACH))
    assert speeds[at_pins] == pytest.approx(SPEC.contact_mps, abs=0.005)
    assert places[-1] == pytest.approx(SPEC.overrun_m, abs=1e-3)
    # It brakes before its end; a speed that is left there would push the unit for ever.
    almost_there = int(np.argmax(places >= SPEC.overrun_m - 1e-3))
    assert speeds[almost_there] < 0.5 * SPEC.contact_mps
    assert speeds[-1] == 0.0


def test_it_waits_for_a_unit_that_stands_still() -> None:
    places, _ = _run(lambda state: np.array([-0.7, 0.0]))
    assert places[-1] + 0.7 < 1.5 * SPEC.lag_m


@pytest.mark.parametrize(("lag", "share"), [(0.5, 1.0), (0.75, 0.5), (1.0, 0.0)])
def test_it_slows_down_from_half_of_the_largest_lag_on(lag: float, share: float) -> None:
    _, speeds = _run(lambda state: np.array([float(state.x) - lag * SPEC.lag_m, 0.0]))
    assert speeds.max() == pytest.approx(share * SPEC.speed_mps)


def test_it_waits_for_a_target_that_is_lost_and_slows_down_for_one_that_is_predicted() -> None:
    lost, _ = _run(_on_it, visibility=0.0)
    assert np.all(lost == -0.7)
    _, speeds = _run(_on_it, visibility=0.5)
    assert speeds.max() == pytest.approx(0.5 * SPEC.speed_mps)


def test_it_does_not_enter_the_port_off_the_axis() -> None:
    places, _ = _run(lambda state: np.array([float(state.x), 0.04]))
    assert places[-1] < -REACH - 0.02
    places, _ = _run(lambda state: np.array([float(state.x), 0.5 * SPEC.corridor_m]))
    assert places[-1] > 0.0


def test_a_retry_starts_where_the_tip_is() -> None:
    state = guidance_start(np.array([[-0.45, 0.02], [-0.3, 0.0]]))
    np.testing.assert_array_equal(state.x, [-0.45, -0.3])
    np.testing.assert_array_equal(state.speed, 0.0)


def test_started_beyond_its_end_it_stays_there() -> None:
    places, _ = _run(_on_it, start=0.05)
    assert places[-1] == SPEC.overrun_m
