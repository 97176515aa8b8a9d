"""The paper's comparison C2: its parts, and the contrast with C1 that makes it worth having."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from msrr_control.docking.c1 import C1DockingLaw, C1DockingParams
from msrr_control.docking.c2 import C2DockingLaw, C2DockingParams
from msrr_control.docking.guidance import GuidanceSpec
from msrr_control.docking.law import DockSetup, Sensed
from msrr_control.feedback.composite import CompositeGains
from msrr_control.feedback.sliding import SlidingGains, sliding_feedback
from msrr_control.kinematics.unicycle import slipped
from msrr_control.path_following.baseline import (
    C2PathFollowingLaw,
    C2PathFollowingParams,
    RepulsionGains,
    repulsion,
)
from msrr_control.path_following.c1 import C1PathFollowingLaw, C1PathFollowingParams
from msrr_control.path_following.path import PaceSpec, Path
from msrr_control.path_following.reference import SideWall
from msrr_control.path_following.tracking import Obstacles
from msrr_control.staging.registry import build_assembler
from msrr_control.staging.setup import AssemblySetup
from msrr_control.studies.docking_study import Disturbance, run_study
from msrr_control.studies.path_following_study import run_path_following_study
from msrr_scenes.errors import SceneError
from msrr_scenes.loading.load import load_scene
from msrr_scenes.specs.spec import Choice
from msrr_scenes.specs.vehicle import LimitsSpec

NORMAL = LimitsSpec.model_validate({})
PAPER = GuidanceSpec(contact_mps=0.11, overrun_m=0.08, lag_m=10.0, corridor_m=10.0)
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


@given(st.floats(0.0, 2.0), st.floats(-np.pi, np.pi))
def test_the_potential_pushes_straight_away_and_ends_at_its_range(distance: float, angle: float) -> None:
    gains = RepulsionGains()
    away = np.array([np.cos(angle), np.sin(angle)])
    # In the origin: elsewhere the difference to a point 1e-12 m away has no direction left to test.
    one = Obstacles(np.zeros((1, 2)), np.array([True]))
    tip = distance * away
    pushed = repulsion(tip, one, gains)
    assert np.isfinite(pushed).all()
    assert pushed @ away >= 0.0
    assert abs(pushed @ [-away[1], away[0]]) <= 1e-9 * (1.0 + np.hypot(*pushed))
    if np.hypot(*tip) >= gains.range_m:
        np.testing.assert_array_equal(pushed, 0.0)


def test_absent_obstacles_do_not_push() -> None:
    tip = np.array([0.1, 0.0])
    none = Obstacles(np.zeros((1, 2)), np.array([False]))
    np.testing.assert_array_equal(repulsion(tip, none, RepulsionGains()), 0.0)


def test_a_potential_without_a_range_is_refused() -> None:
    with pytest.raises(ValidationError, match="less than range_m"):
        RepulsionGains(range_m=0.1, nearest_m=0.2)


def test_the_cone_correction_is_that_of_c1(facts: DockSetup) -> None:
    """Both turn to the same side where an edge is about to leave; without the correction neither does."""
    wide = Sensed(np.array([-0.5, 0.0, 0.0]), np.array([0.5, 0.3]), np.array(1.0), np.zeros(2))
    with_it, without = (C2DockingLaw(C2DockingParams(los_correction=on), facts) for on in (True, False))
    assert with_it.step(with_it.start(wide), wide, 0.02)[0][1] > 0.0
    assert without.step(without.start(wide), wide, 0.02)[0][1] == 0.0
    lost = wide._replace(visibility=np.array(0.0))
    assert with_it.step(with_it.start(lost), lost, 0.02)[0][1] == 0.0


def test_high_gain_and_delay_separate_c1_from_c2_and_gentle_gains_do_not(facts: DockSetup) -> None:
    """k_n = 6 1/s and 100 ms + 1/kappa: (6 + 2) 0.167 > 1. 60 noisy trials at a fixed seed."""
    wrong = Disturbance(sigma_xy_m=0.005, sigma_yaw_deg=1.0, delay_s=0.1, slip=0.02, compensated=False)

    def lateral(law: C1DockingLaw | C2DockingLaw) -> float:
        result = run_study(law, facts, np.random.default_rng(3), 60, disturbance=wrong, duration=8.5)
        assert result.docked.all()
        return float(np.median(np.abs(result.at_contact()[0])))

    def c1(k: float) -> C1DockingLaw:
        feedback = CompositeGains(k_n_per_s=k)
        return C1DockingLaw(C1DockingParams(feedback=feedback, guidance=PAPER), facts)

    def c2(k: float) -> C2DockingLaw:
        feedback = SlidingGains(k_per_s=k)
        return C2DockingLaw(C2DockingParams(feedback=feedback, guidance=PAPER), facts)

    assert lateral(c1(6.0)) < 0.006
    assert lateral(c2(6.0)) > 0.013
    assert lateral(c1(0.8)) < 0.003
    assert lateral(c2(0.8)) < 0.003


def test_c2_is_pushed_back_where_c1_is_led_around() -> None:
    c1 = C1PathFollowingLaw(C1PathFollowingParams(pace=PaceSpec(lag_m=10.0)), NORMAL, 0.1)
    c2 = C2PathFollowingLaw(C2PathFollowingParams(), NORMAL, 0.1)
    a, b = (run_path_following_study(law, NORMAL, np.random.default_rng(5), 60) for law in (c1, c2))
    assert np.median(b.amplitude()) > 1.4 * np.median(a.amplitude())
    assert np.nanmedian(b.tracking_error()) < 0.01
    assert a.body_distance().min() > 0.08
    assert b.body_distance().min() > 0.08


def test_wheels_that_slip_lead_the_unit_astray() -> None:
    """The odometry does not see it; only the measured pose brings the unit back."""
    law = C1PathFollowingLaw(C1PathFollowingParams(), NORMAL, 0.1)
    firm, slippery = (
        run_path_following_study(
            law, NORMAL, np.random.default_rng(7), 30, disturbance=Disturbance(slip=slip, delay_s=0.1)
        )
        for slip in (0.0, 0.05)
    )
    assert np.nanmedian(slippery.tracking_error()) > 1.2 * np.nanmedian(firm.tracking_error())


@pytest.mark.parametrize(
    "law",
    [
        C2PathFollowingLaw(C2PathFollowingParams(), NORMAL, 0.1),
        C1PathFollowingLaw(C1PathFollowingParams(), NORMAL, 0.1),
    ],
    ids=["c2", "c1"],
)
def test_the_mirrored_world_gives_the_mirrored_command(law: C2PathFollowingLaw | C1PathFollowingLaw) -> None:
    rng = np.random.default_rng(11)

    def drive(sign: float, pose: np.ndarray, middle: np.ndarray, normal: float) -> np.ndarray:
        flip = np.array([1.0, sign, sign])
        path = Path(np.zeros(3), np.array([sign * 0.8, 0.0]), np.array([1.5, 0.3]))
        wall = SideWall(np.array(True), middle * flip[:2], np.array(sign * normal))
        one = Obstacles((middle * flip[:2])[None], np.array([True]))
        state = law.start(pose * flip, np.zeros(2), 0.4)
        for _ in range(20):
            command, state = law.step(state, path, pose * flip, wall, one, 0.02)
        return command

    for _ in range(20):
        case = rng.uniform(-0.5, 0.5, 3), rng.uniform(-0.5, 0.5, 2), rng.uniform(-3.0, 3.0)
        np.testing.assert_allclose(drive(-1.0, *case), drive(1.0, *case) * [1, -1], atol=1e-9)


@given(st.floats(-0.4, 0.4), st.floats(-1.5, 1.5))
def test_slip_of_both_wheels_scales_and_of_one_turns(v: float, w: float) -> None:
    twist = np.array([v, w])
    np.testing.assert_allclose(slipped(twist, np.array([1.0, 1.0]), 0.13), twist, atol=1e-12)
    np.testing.assert_allclose(slipped(twist, np.array([0.9, 0.9]), 0.13), 0.9 * twist, atol=1e-12)
    turned = slipped(np.array([0.2, 0.0]), np.array([1.0, 1.02]), 0.13)
    assert turned[1] == pytest.approx(0.2 * 0.02 / 0.13)


def test_the_assembler_c2_is_built_from_a_scene() -> None:
    scene = load_scene("two_units", {"control.assembly": "{name: c2, params: {repulsion: {eta: 0.01}}}"})
    setup = AssemblySetup.of(scene, scene.plan[0])
    assembler = build_assembler(scene.control.assembly, setup)
    assert assembler.progress is None
    with pytest.raises(SceneError, match="controller 'c2'"):
        build_assembler(Choice(name="c2", params={"repulsion": {"eta": -1.0}}), setup)
