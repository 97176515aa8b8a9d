"""A thousand unicycle trials against the figures that the corrected equations promise.

Medians and 95th percentiles of 1000 trials at a fixed seed: these tests cannot fail by chance, and the bounds
leave room for another seed (percentiles of 1000 scatter by a few per cent).
"""

import math
from dataclasses import replace

import numpy as np
import pytest

from msrr_control.docking.c1 import C1DockingLaw, C1DockingParams
from msrr_control.docking.guidance import GuidanceSpec
from msrr_control.docking.law import DockSetup
from msrr_control.feedback.visibility_cone import edge_angles
from msrr_control.studies.disturbance import Disturbance
from msrr_control.studies.docking_study import CLOSE, CLOSE_HARD, StudyResult, draw_starts, run_docking_study
from msrr_scenes.errors import ParameterError, ProgramFailedError

#: The trajectory of the paper: no slowing down before contact, its end beyond it.
STEADY = C1DockingParams(guidance=GuidanceSpec(contact_mps=0.11, overrun_m=0.08))
NOISE = Disturbance(sigma_xy_m=0.005, sigma_yaw_deg=1.0, delay_s=0.05)


def _study(facts: DockSetup, params: C1DockingParams, **more) -> StudyResult:
    return run_docking_study(C1DockingLaw(params, facts), facts, np.random.default_rng(1), **more)


def test_ideal_starts(facts: DockSetup) -> None:
    result = _study(facts, STEADY)
    settling, final = result.settling_time(), result.final_error()
    assert result.at_face.all()
    trials = np.arange(1000)
    assert (result.tip[result.contact, trials, 0] >= 0.0).all()
    assert (result.tip[result.contact - 1, trials, 0] < 0.0).all()
    assert np.median(settling) == pytest.approx(1.0, abs=0.2)
    assert np.percentile(settling, 95) == pytest.approx(1.6, abs=0.2)
    assert np.percentile(final, 95) < 0.0015
    assert result.in_cone(facts.los.outer).all()


def test_noise_and_delay(facts: DockSetup) -> None:
    result = _study(facts, STEADY, disturbance=NOISE)
    settling, final = result.settling_time(), result.final_error()
    assert result.at_face.all()
    assert np.median(settling) == pytest.approx(0.9, abs=0.2)
    assert np.percentile(settling, 95) == pytest.approx(1.6, abs=0.2)
    assert np.median(final) < 0.0022
    assert np.percentile(final, 95) < 0.0033
    assert np.mean(result.in_cone(facts.los.outer)) >= 0.995


def test_the_shipped_trajectory_enters_the_port_straight(facts: DockSetup) -> None:
    """Slowing down for the pins: within 3 mm and 1.5 deg at contact in 95 % of noisy trials."""
    result = _study(facts, C1DockingParams(), disturbance=NOISE)
    lateral, yaw = result.at_contact()
    assert result.at_face.all()
    assert np.percentile(np.abs(lateral), 95) < 0.003
    assert np.degrees(np.percentile(np.abs(yaw), 95)) < 1.5


def test_the_cone_correction_keeps_targets_that_are_lost_without_it(tight: DockSetup) -> None:
    hard = {"starts": CLOSE_HARD, "trials": 500}
    kept = np.mean(_study(tight, C1DockingParams(), **hard).in_cone(tight.los.outer))
    without = np.mean(_study(tight, C1DockingParams(los_correction=False), **hard).in_cone(tight.los.outer))
    assert kept > without + 0.02


def test_delay_that_nobody_compensates_costs_its_distance(facts: DockSetup) -> None:
    late = Disturbance(delay_s=0.1, compensated=False)
    result = _study(facts, STEADY, disturbance=late, trials=100)
    assert np.median(result.final_error()) == pytest.approx(0.11 * 0.1, abs=0.002)


def test_starts_are_in_the_set_and_in_the_cone(facts: DockSetup) -> None:
    poses = draw_starts(CLOSE_HARD, 2000, facts, np.random.default_rng(5))
    port = poses[:, :2] + facts.offset * np.stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])], axis=1)
    spread = CLOSE_HARD.spread
    assert np.all(np.abs(port[:, 0] + CLOSE.distance_m) <= spread.x_m + 1e-12)
    assert np.all(np.abs(port[:, 1]) <= spread.y_m + 1e-12)
    assert np.all(np.abs(poses[:, 2]) <= np.radians(spread.yaw_deg))
    assert np.abs(edge_angles(poses, facts.los, facts.camera_offset)).max() < facts.los.outer


def test_the_same_seed_gives_the_same_bits(facts: DockSetup) -> None:
    a = _study(facts, C1DockingParams(), trials=20, disturbance=NOISE)
    b = _study(facts, C1DockingParams(), trials=20, disturbance=NOISE)
    np.testing.assert_array_equal(a.pose, b.pose)


def _made(off: np.ndarray, contact: list[int], edge: np.ndarray | None = None) -> StudyResult:
    """A result of 0.1 s steps with these distances from trajectory and axis, shape (steps, trials)."""
    steps, trials = off.shape
    nothing, away = np.zeros((steps, trials, 2)), np.stack([np.zeros_like(off), off], axis=-1)
    edges = nothing if edge is None else np.stack([np.zeros_like(edge), -edge], axis=-1)
    pose = np.stack([np.zeros_like(off), off, 2.0 * off], axis=-1)
    return StudyResult(0.1, pose, nothing, nothing, edges, away, nothing, np.array(contact))


def test_the_figures_of_trials_that_are_known() -> None:
    """One that settles, one that does only after contact, one that never does, one that does not come."""
    late = np.arange(41)[:, None]
    off = np.where(late < [12, 12, 99, 25], 0.02, np.where(late < 28, 0.01, 0.001))
    off[30:, 0] = 0.5  # behind the contact nothing counts
    result = _made(off, [29, 11, 20, -1])
    assert result.at_face.tolist() == [True, True, True, False]
    assert result.settling_time().tolist() == pytest.approx([1.2, np.inf, np.inf, 2.5])
    assert result.settling_time(0.005)[3] == pytest.approx(2.8)
    assert result.settling_time(0.03)[2] == 0.0
    for figure in (result.final_error(), result.port_error()):
        assert figure == pytest.approx([0.01, 0.02, 0.02, 0.001])
    assert result.at_contact()[0] == pytest.approx([0.001, 0.02, 0.02])
    assert result.at_contact()[1] == pytest.approx([0.002, 0.04, 0.04])
    nearly = _made(np.where(np.arange(41)[:, None] <= [18, 19], 0.3, 0.0), [29, 29])
    assert nearly.final_error() == pytest.approx([0.0, 0.3]), "the last second is counted from contact"


def test_a_target_is_kept_if_no_edge_leaves_the_cone_before_contact() -> None:
    steps = np.arange(20)[:, None]
    result = _made(np.zeros((20, 3)), [10, 10, -1], np.where(steps == [10, 11, 19], 0.5, -0.3))
    assert result.in_cone(0.4).tolist() == [False, True, False]
    assert result.in_cone(0.6).all()
    assert not result.in_cone(0.2).any()


@pytest.mark.parametrize("compensated", [False, True])
def test_the_law_is_given_edges_as_noisy_and_as_late_as_they_are(facts: DockSetup, compensated: bool) -> None:
    """Moved forward, they are those of now but for their noise."""
    sigma, seen = 0.5, []

    class Watching(C1DockingLaw):
        def step(self, state, inputs, dt):
            seen.append(inputs.edges)
            return super().step(state, inputs, dt)

    errors = Disturbance(sigma_bearing_deg=sigma, delay_s=0.1, compensated=compensated)
    law, rng, states = Watching(STEADY, facts), np.random.default_rng(1), []
    result = run_docking_study(law, facts, rng, 100, disturbance=errors, duration=4.0, observer=states.append)
    assert len(states) == len(seen) == 200
    assert not result.at_face.any()
    late = 0 if compensated else 5
    off = np.array(seen)[late:] - result.edges[: len(seen) - late]
    assert np.degrees(off[10:].std()) == pytest.approx(sigma, rel=0.03)
    assert np.degrees(np.abs(off[10:].mean())) < 0.03


class _Broken(C1DockingLaw):
    """C1 with commands that are wrong in one way."""

    way = ""

    def step(self, state, inputs, dt):
        if self.way == "writes":
            inputs.twist[...] = 0.0
        command, state = super().step(state, inputs, dt)
        if self.way == "nan":
            command[::2] = np.nan
        if self.way == "complex":
            command = command.astype(complex)
        return (command[0] if self.way == "one" else command), state


@pytest.mark.parametrize(
    ("way", "says"),
    [
        ("one", r"_Broken.step returned shape \(2,\); expected finite numbers of shape \(1000, 2\)"),
        ("nan", "_Broken.step returned commands that are not finite"),
        ("complex", "_Broken.step returned commands that are not finite"),
        ("writes", "read-only"),
    ],
)
def test_a_law_that_breaks_the_rules_gives_no_figures(facts: DockSetup, way: str, says: str) -> None:
    """One command drove all trials, NaN stayed in every cone, and a law could stop the units."""
    law = _Broken(STEADY, facts)
    law.way = way
    with pytest.raises((ProgramFailedError, ValueError), match=says):
        run_docking_study(law, facts, np.random.default_rng(1))


@pytest.mark.parametrize(
    "wrong", [{"trials": 0}, {"trials": True}, {"duration": 0.0}, {"duration": math.nan}]
)
def test_a_study_of_nothing_is_refused(wrong: dict[str, float], facts: DockSetup) -> None:
    (name,) = wrong
    with pytest.raises(ParameterError, match=f"^{name}: has to be a number from"):
        _study(facts, STEADY, **wrong)


def test_a_study_without_a_rate_is_refused(facts: DockSetup) -> None:
    with pytest.raises(ParameterError, match=r"^rate_hz: has to be a number from 1 to"):
        _study(replace(facts, rate_hz=0.0), STEADY)
