"""Two hundred unicycle trials per case against the figures that the corrected equations promise.

Percentiles at a fixed seed: these tests cannot fail by chance. The bounds are the paper's figures or better.
"""

from dataclasses import replace

import numpy as np
import pytest
from pydantic import ValidationError

from msrr_control.path_following.c1 import C1PathFollowingLaw, C1PathFollowingParams
from msrr_control.path_following.c2 import C2PathFollowingLaw, C2PathFollowingParams
from msrr_control.path_following.path import PaceSpec
from msrr_control.studies import metrics
from msrr_control.studies.disturbance import Disturbance
from msrr_control.studies.path_following_study import (
    PathFollowingStartSet,
    PathFollowingStudyResult,
    draw_paths,
    run_path_following_study,
)
from msrr_scenes.errors import ParameterError
from msrr_scenes.specs.vehicle import LimitsSpec

NORMAL = LimitsSpec.model_validate({})
TIGHT = LimitsSpec.model_validate({"setting": "tight"})
NOISE = Disturbance(sigma_xy_m=0.005, sigma_yaw_deg=1.0, delay_s=0.05, compensated=False)
BODY_M = 0.08


def _study(
    params: C1PathFollowingParams | None = None, limits: LimitsSpec = NORMAL, **more
) -> PathFollowingStudyResult:
    params = params if params is not None else C1PathFollowingParams()
    law = C1PathFollowingLaw(params, limits, 0.10)
    return run_path_following_study(law, limits, np.random.default_rng(1), walls=params.walls, **more)


@pytest.fixture(scope="module")
def ideal() -> PathFollowingStudyResult:
    return _study()


@pytest.fixture(scope="module")
def noisy() -> PathFollowingStudyResult:
    return _study(disturbance=NOISE)


@pytest.mark.parametrize(("name", "tracking"), [("ideal", (0.012, 0.015)), ("noisy", (0.020, 0.025))])
def test_the_figures_of_the_long_distance_phase(name, tracking, request) -> None:
    result = request.getfixturevalue(name)
    figures = result.figures()
    for name, (median, p95) in (
        ("tracking", tracking),
        ("amplitude", (0.25, 0.27)),
        ("recovery", (2.2, 2.5)),
    ):
        figure = figures[name]
        assert not np.isnan(figure).any()
        assert np.median(figure) <= median
        assert np.percentile(figure, 95) <= p95
    assert result.body_distance().min() - BODY_M > 0.03


def test_every_command_is_within_the_drive() -> None:
    result = _study(limits=TIGHT, disturbance=NOISE, trials=50)
    assert np.abs(result.command[..., 0]).max() <= TIGHT.v_max_mps
    assert np.abs(result.command[..., 1]).max() <= TIGHT.w_max_radps
    assert result.body_distance().min() - BODY_M > 0.02


def test_the_unit_ends_on_the_lead_in(noisy: PathFollowingStudyResult) -> None:
    assert metrics.deviation(noisy.tip, noisy.desired)[-1].max() < 0.015
    path, _ = draw_paths(PathFollowingStartSet(), noisy.pose.shape[1], np.random.default_rng(1))
    end = path.at(path.length)
    off = np.angle(np.exp(1j * (noisy.pose[-1, :, 2] - end.heading)))
    assert np.degrees(np.abs(off)).max() < 8.0


def test_the_distance_of_a_body_is_that_of_a_square_about_the_axle(ideal: PathFollowingStudyResult) -> None:
    pose = np.array([[[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [1.0, 1.0, np.pi / 4.0], [0.0, 0.0, np.pi / 2.0]]])
    obstacle = np.array(
        [[0.4, 0.05], [-0.4, -0.5], [1.0 - 0.3 * np.sqrt(0.5), 1.0 + 0.3 * np.sqrt(0.5)], [0.05, -0.4]]
    )
    result = replace(ideal, pose=pose, obstacle=obstacle)
    np.testing.assert_allclose(result.body_distance(), [[0.3, 0.5, 0.2, 0.3]], atol=1e-12)


def test_paths_and_obstacles_are_in_the_set() -> None:
    starts = PathFollowingStartSet(radius_m=(0.8, 1.0), sweep_deg=(100.0, 140.0))
    path, middle = draw_paths(starts, 2000, np.random.default_rng(3))
    radius = 1.0 / np.abs(path.curvature[:, 0])
    assert ((radius >= 0.8) & (radius <= 1.0)).all()
    sweep = np.degrees(path.lengths[:, 0] / radius)
    assert ((sweep > 100.0 - 1e-9) & (sweep < 140.0 + 1e-9)).all()
    np.testing.assert_allclose(path.lengths[:, 1], starts.lead_in_m)
    assert 800 < (path.curvature[:, 0] > 0.0).sum() < 1200
    assert (path.curvature[:, 1] == 0.0).all()
    beside = metrics.from_path(middle[None], path)[0]
    assert beside.max() <= starts.beside_m + 1e-9
    assert beside.max() > 0.95 * starts.beside_m
    assert beside.min() < 0.05 * starts.beside_m
    # The nearest point of the circle, by its middle, which lies on the y axis.
    turn = np.sign(path.curvature[:, 0])
    along = np.mod(np.arctan2(middle[:, 0], radius - turn * middle[:, 1]), 2.0 * np.pi) * radius
    latest = np.maximum(path.arc_end - starts.before_end_m, starts.after_start_m)
    assert (along >= starts.after_start_m - 1e-9).all()
    assert (along <= latest + 1e-9).all()


def test_units_start_about_the_beginning_of_their_paths_and_end_them(ideal: PathFollowingStudyResult) -> None:
    off, starts = ideal.pose[0] - [-0.10, 0.0, 0.0], PathFollowingStartSet()
    most = np.array([starts.error_m, starts.error_m, np.radians(starts.error_deg)])
    assert (np.abs(off) <= most).all()
    assert (np.abs(off).max(axis=0) > 0.95 * most).all()
    np.testing.assert_allclose(np.diff(ideal.time), 0.02)
    np.testing.assert_allclose(ideal.desired[-1], ideal.path.at(ideal.path.length).point, atol=1e-3)
    ended = ideal.desired[np.rint(ideal.arc_end / 0.02).astype(int), np.arange(200)]
    beyond = np.linalg.norm(ended - ideal.path.at(ideal.path.arc_end).point, axis=1)
    assert beyond.max() < 0.02 * PaceSpec().cruise_mps + 1e-3


def test_without_the_envelope_it_drives_through() -> None:
    result = _study(C1PathFollowingParams(envelope=False), trials=50)
    assert (result.body_distance().min(axis=0) < BODY_M).all()


def test_the_spring_adds_a_margin(ideal: PathFollowingStudyResult) -> None:
    without = _study(C1PathFollowingParams(spring=False)).body_distance().min()
    assert 0.002 < ideal.body_distance().min() - without < 0.03


def test_anti_windup_lessens_the_overshoot_where_limits_bite() -> None:
    kept = np.median(_study(limits=TIGHT, trials=100).figures()["amplitude"])
    without = np.median(
        _study(C1PathFollowingParams(anti_windup=False), limits=TIGHT, trials=100).figures()["amplitude"]
    )
    assert kept < without


def test_compensating_the_delay_halves_the_steady_error() -> None:
    late = Disturbance(delay_s=0.1, compensated=False)
    none = PathFollowingStartSet(obstacle_m=None)
    states: list[object] = []
    blind = _study(disturbance=late, starts=none, trials=50, observer=states.append)
    assert not blind.walled.any()
    assert len(states) == len(blind.time)
    off = np.median(blind.figures()["tracking"])
    on = np.median(
        _study(disturbance=late.model_copy(update={"compensated": True}), starts=none, trials=50).figures()[
            "tracking"
        ]
    )
    assert on < 0.5 * off


def test_the_same_seed_gives_the_same_bits() -> None:
    brief = PathFollowingStartSet(radius_m=(0.8, 0.9), sweep_deg=(60.0, 70.0))
    first, again = (_study(disturbance=NOISE, starts=brief, trials=20) for _ in range(2))
    np.testing.assert_array_equal(first.pose, again.pose)


def test_what_is_lag_is_told_from_what_is_swing(ideal: PathFollowingStudyResult) -> None:
    """C2 waits behind the obstacle: far from the desired point, hardly farther from the path than C1."""
    law = C2PathFollowingLaw(C2PathFollowingParams(), NORMAL, 0.10)
    c1, c2 = ideal, run_path_following_study(law, NORMAL, np.random.default_rng(1), trials=60)
    for result in (c1, c2):
        # The desired point is a point of the path, so nothing is nearer to it than to the path.
        off = metrics.deviation(result.tip, result.desired)
        assert np.all(metrics.from_path(result.tip, result.path) <= off + 1e-9)
    of_c1, of_c2 = c1.figures(), c2.figures()
    for figures in (of_c1, of_c2):
        assert np.all(figures["amplitude_path"] <= figures["amplitude"] + 1e-9)
    assert np.median(of_c1["amplitude"] - of_c1["amplitude_path"]) < 0.002
    assert np.median(of_c2["amplitude"] - of_c2["amplitude_path"]) > 0.08
    assert np.median(of_c2["recovery"] - of_c2["recovery_path"]) > 0.3


@pytest.mark.parametrize("wrong", [{"trials": 0}, {"rate_hz": 0.0}])
def test_a_study_of_nothing_is_refused(wrong: dict[str, float]) -> None:
    (name,) = wrong
    with pytest.raises(ParameterError, match=f"^{name}: has to be a number from"):
        _study(**wrong)


@pytest.mark.parametrize("radius_m", [(1.4, 1.0), (0.0, 1.0)])
def test_ranges_of_radii_that_are_none_are_refused(radius_m: tuple[float, float]) -> None:
    with pytest.raises(ValidationError, match="radius_m"):
        PathFollowingStartSet(radius_m=radius_m)
