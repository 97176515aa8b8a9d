import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from msrr_control.path_following.c1 import C1PathFollowingLaw, C1PathFollowingParams
from msrr_control.studies.disturbance import Disturbance, DisturbedUnicycles
from msrr_control.studies.path_following_study import run_path_following_study
from msrr_scenes.specs.vehicle import LimitsSpec

NORMAL = LimitsSpec.model_validate({})


def test_wheels_that_slip_lead_the_unit_astray() -> None:
    """The odometry does not see it; only the measured pose brings the unit back."""
    law = C1PathFollowingLaw(C1PathFollowingParams(), NORMAL, 0.1)
    firm, slippery = (
        run_path_following_study(
            law, NORMAL, np.random.default_rng(7), 30, disturbance=Disturbance(slip=slip, delay_s=0.1)
        )
        for slip in (0.0, 0.05)
    )
    assert np.nanmedian(slippery.figures()["tracking"]) > 1.2 * np.nanmedian(firm.figures()["tracking"])


def _units(disturbance: Disturbance, trials: int = 3, dt: float = 0.02) -> DisturbedUnicycles:
    rng = np.random.default_rng(5)
    return DisturbedUnicycles(rng.normal(size=(trials, 3)), disturbance, NORMAL, dt, rng)


@pytest.mark.parametrize("compensated", [False, True])
def test_the_law_is_told_how_old_a_measurement_is(compensated: bool) -> None:
    """60 ms are three steps; the first measurement stays in use until the next one arrives."""
    units = _units(Disturbance(delay_s=0.06, compensated=compensated))
    ages = []
    for _ in range(6):
        units.measure()
        ages.append(units.age_s)
        units.advance(np.zeros((3, 2)))
    assert ages == pytest.approx([0.0] * 6 if compensated else [0.0, 0.02, 0.04, 0.06, 0.06, 0.06])


@given(st.floats(-0.3, 0.3), st.floats(-1.0, 1.0))
def test_slip_of_both_wheels_scales_and_of_one_turns(v: float, w: float) -> None:
    """Speeds that the drive has reached already: a step shows what the wheels make of them."""
    for grips, expected in (
        ((1.0, 1.0), (v, w)),
        ((0.9, 0.9), (0.9 * v, 0.9 * w)),
        ((1.0, 1.02), (v + 0.01 * (v + 0.065 * w), w + 0.02 * (v + 0.065 * w) / 0.13)),
    ):
        units = _units(Disturbance(), 1)
        units.pose, units.twist, units._grips = np.zeros((1, 3)), np.array([[v, w]]), np.array([grips])
        units.advance(np.array([[v, w]]))
        assert units.pose[0, 2] == pytest.approx(0.02 * expected[1], abs=1e-12)
        assert np.hypot(*units.pose[0, :2]) == pytest.approx(0.02 * abs(expected[0]), rel=1e-3, abs=1e-12)


def test_ideal_units_measure_the_truth() -> None:
    units = _units(Disturbance())
    for _ in range(20):
        late, measured = units.measure()
        np.testing.assert_array_equal(late, units.pose)
        np.testing.assert_allclose(measured, units.pose, atol=1e-12)
        units.advance(np.array([[0.3, 0.5]] * 3))


@pytest.mark.parametrize("compensated", [False, True])
def test_measurements_scatter_about_the_truth_by_what_is_stated(compensated: bool) -> None:
    errors = Disturbance(sigma_xy_m=0.02, sigma_yaw_deg=3.0, delay_s=0.04, compensated=compensated)
    units, off = _units(errors, 4000), []
    for _ in range(4):
        late, measured = units.measure()
        off.append(late - units.exposed)
        units.advance(np.zeros((4000, 2)))
    np.testing.assert_allclose(off[-1].std(axis=0), [0.02, 0.02, np.radians(3.0)], rtol=0.05)
    np.testing.assert_allclose(measured - units.pose, off[-1], atol=1e-12)
    np.testing.assert_array_equal(off[0], off[2])  # the first one stays until the next one arrives
    assert (off[3] != off[2]).all()


def test_grips_of_wheels_lie_about_one_and_differ() -> None:
    grips = _units(Disturbance(slip=0.05), 4000)._grips
    assert np.abs(grips - 1.0).max() <= 0.05
    np.testing.assert_allclose(grips.std(axis=0), 0.05 / np.sqrt(3.0), rtol=0.05)
    np.testing.assert_allclose(grips.mean(axis=0), 1.0, atol=0.002)
    assert abs(np.corrcoef(grips.T)[0, 1]) < 0.06


def test_a_noisy_heading_turns_the_motion_since_its_exposure() -> None:
    """What is moved forward starts in the measured heading, not in the true one."""
    units = DisturbedUnicycles(
        np.zeros((200, 3)),
        Disturbance(sigma_yaw_deg=10.0, delay_s=0.1),
        NORMAL,
        0.02,
        np.random.default_rng(0),
    )
    for _ in range(60):
        late, moved = units.measure()
        way = units.pose[:, 0] - units.exposed[:, 0]
        units.advance(np.full((200, 2), [0.3, 0.0]))
    np.testing.assert_allclose(moved[:, 0] - late[:, 0], way * np.cos(late[:, 2]), atol=1e-9)
    np.testing.assert_allclose(moved[:, 1] - late[:, 1], way * np.sin(late[:, 2]), atol=1e-9)


def test_a_delay_is_compensated_by_odometry_unless_it_is_not() -> None:
    blind, seeing = (_units(Disturbance(delay_s=0.1, compensated=c)) for c in (False, True))
    poses = []
    for _ in range(60):
        poses.append(blind.pose)
        (_, late), (_, moved) = blind.measure(), seeing.measure()
        for units in (blind, seeing):
            units.advance(np.array([[0.3, 0.5]] * 3))
    np.testing.assert_array_equal(late, poses[-1 - 5])
    np.testing.assert_allclose(moved, poses[-1], atol=1e-9)


@pytest.mark.parametrize("delay_s", [0.0, 0.02, 0.05, 0.06, 0.07, 0.13])
def test_a_delay_is_as_long_as_it_says(delay_s: float) -> None:
    """50, 70 and 130 ms are no number of control periods of 20 ms."""
    blind, seeing = (
        DisturbedUnicycles(
            np.zeros((1, 3)),
            Disturbance(delay_s=delay_s, compensated=compensated),
            NORMAL,
            0.02,
            np.random.default_rng(0),
        )
        for compensated in (False, True)
    )
    for _ in range(100):
        (_, late), (_, moved) = blind.measure(), seeing.measure()
        x = blind.pose[0, 0]
        for units in (blind, seeing):
            units.advance(np.array([[0.1, 0.0]]))
    assert blind.age_s == pytest.approx(delay_s)
    assert (x - late[0, 0]) / 0.1 == pytest.approx(delay_s, abs=1e-9)
    assert moved[0, 0] == pytest.approx(x)


def test_the_units_of_a_study_lag_a_ramp_by_one_over_kappa() -> None:
    """What is driven in a step of 20 ms, against the command that is held in it."""
    for setting in ("normal", "tight"):
        limits = LimitsSpec.model_validate({"setting": setting})
        units = DisturbedUnicycles(np.zeros((1, 3)), Disturbance(), limits, 0.02, np.random.default_rng(0))
        slope, k = 0.3 * limits.a_max_mps2, 0
        while slope * 0.02 * k < 0.95 * limits.v_max_mps:
            command, before = slope * 0.02 * k, units.pose[0, 0]
            units.advance(np.array([[command, 0.0]]))
            lag = (command - (units.pose[0, 0] - before) / 0.02) / slope
            k += 1
        assert lag == pytest.approx(1.0 / limits.kappa_per_s, rel=0.01)
