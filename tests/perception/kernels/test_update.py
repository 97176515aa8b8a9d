"""The compiled update by corners, against the same equations in plain numpy with the prior's inverse."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from msrr_perception.estimation.corner_update import CornerUpdate
from msrr_perception.kernels.calibrated import PRINT
from msrr_perception.kernels.corners import MeasuredCorners, WeightedCorners, derivatives, roots_of_covariance
from msrr_perception.kernels.edges import reach_px
from msrr_perception.kernels.rates import AT_REST, Rates
from msrr_perception.kernels.section_errors import CornerVariances, border_px, sampling_px, surplus
from msrr_perception.motion.filter_state import FilterState
from msrr_perception.pose.calibration import StateLayout
from msrr_perception.pose.joint_pose import CornerNoise
from msrr_perception.pose.target import TargetModel
from msrr_scenes.messages import Detections, Exposure, TagDetection
from msrr_scenes.specs.scene import Scene
from tests.perception.conftest import see

GATE = 0.9999
EXPOSURE = Exposure("a/onboard", 0, 0)


def _variances(target: TargetModel, tags: list[TagDetection], rates: Rates, scale: float) -> CornerVariances:
    """Return what data sheet, image and smear say of corners; constants as the filter documents them."""
    smear_px = target.exposure_s * target.camera.focal * abs(rates.velocity[len(rates.velocity) // 2, 2])
    errors, noise, place, changing, border, rest = target.corner_errors, [], [], [], [], []
    for tag in tags:
        (ax, ay), (bx, by), (cx, cy), (dx, dy) = tag.corners
        edge = np.sqrt(0.5 * abs((cx - ax) * (dy - by) - (cy - ay) * (dx - bx)))
        by_place, by_border = (of(errors.blur_px, reach_px(edge)) for of in (sampling_px, border_px))
        noise.append(scale * errors.frame_px(edge) ** 2)
        place.append(scale * by_place**2)
        changing.append(scale * 0.6 * by_border**2)
        border.append(np.sqrt(0.4) * by_border)
        modelled = scale * errors.corner_variance(edge)
        longest = max(np.hypot(*(tag.corners[k] - tag.corners[k - 1])) for k in range(4))
        smeared = 0.3 if smear_px > 0.5 * longest / 8.0 else 0.0
        sigmas = np.hypot(np.zeros(4) if tag.corner_sigma_px is None else tag.corner_sigma_px, smeared)
        rest.append([scale * 0.005**2 + surplus(sigma**2, modelled) for sigma in sigmas])
    return CornerVariances(*map(np.array, (noise, place, changing, border, rest)))


def _by_numpy(
    target: TargetModel, prior: FilterState, tags: list[TagDetection], rates: Rates
) -> tuple[FilterState, bool] | None:
    """Return the update by Gauss-Newton steps in information form, and whether all of them descended."""
    layout, m, P = target.filter_layout, prior.mean, prior.covariance
    which = np.array([layout.index[t.tag_id] for t in tags])
    corners = np.array([t.corners.reshape(8) for t in tags])
    after = target.shutter.after_stamp(corners[:, 1::2])
    measured = MeasuredCorners(which, corners, np.zeros((len(tags), 4)), after)
    variances = _variances(target, tags, rates, prior.noise_scale)
    roots = roots_of_covariance(
        target.optics, layout.tags, measured, rates, m, variances, target.frame_period_s
    )
    inside, border = [], variances.border
    for t in range(len(tags)):
        one = WeightedCorners(which[[t]], corners[[t]], after[[t]], border[[t]], roots[[t]], rates)
        r, J = derivatives(target.optics, layout.tags, one, m)
        inside.append(r @ np.linalg.solve(J @ P @ J.T + np.eye(8), r) <= chi2.ppf(GATE, 8))
    if not any(inside):
        return None
    seen = WeightedCorners(
        which[inside], corners[inside], after[inside], border[inside], roots[inside], rates
    )
    x, (r, J) = m, derivatives(target.optics, layout.tags, seen, m)
    base, information = _in_metres(layout, m, P, x)
    cost = chi = r @ r
    for _ in range(6):
        H = information + J.T @ J
        step = np.linalg.solve(H, J.T @ r - information @ (x - base))
        if step @ H @ step < 9e-6 * len(m):
            break
        x = x + step
        r, J = derivatives(target.optics, layout.tags, seen, x)
        before, chi = cost, r @ r
        cost = chi + (x - base) @ information @ (x - base)
        if cost > before + 0.01:
            return prior, False
        base, information = _in_metres(layout, m, P, x)
    scale = 0.9 * prior.noise_scale + 0.1 * prior.noise_scale * chi / corners[inside].size
    covariance = np.linalg.inv(information + J.T @ J)
    # Laplace's method: a likelihood is as high as the best point, and as wide as the covariance there.
    cost += np.linalg.slogdet(information + J.T @ J)[1] - np.linalg.slogdet(information)[1]
    cost += chi2.ppf(GATE, 8) * (len(tags) - sum(inside))
    scale = float(np.clip(scale, 1.0, 100.0))
    return prior._replace(mean=x, covariance=covariance, noise_scale=scale, cost=prior.cost + cost), True


def _in_prints(layout: StateLayout, state: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return a state with lengths as multiples of the print, and its derivatives by the state."""
    printed, lengths, origins = layout.tags.columns[0, PRINT], layout.tags.lengths, layout.tags.origins
    by_print, jacobian = state.copy(), np.eye(len(state))
    if printed >= 0:
        size = 1.0 + state[printed]
        by_print[lengths] = (state[lengths] - origins) / size
        jacobian[lengths, lengths] = 1.0 / size
        jacobian[lengths, printed] = -by_print[lengths] / size
    return by_print, jacobian


def _in_metres(
    layout: StateLayout, mean: np.ndarray, covariance: np.ndarray, state: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return mean and information of a prior that is Gaussian in lengths by the print, linear at a state."""
    (told, at_mean), (now, at_state) = _in_prints(layout, mean), _in_prints(layout, state)
    to_metres = np.linalg.inv(at_state)
    spread = to_metres @ at_mean @ covariance @ at_mean.T @ to_metres.T
    return state - to_metres @ (now - told), np.linalg.inv(spread)


def _prior(target: TargetModel, rng: np.random.Generator) -> FilterState:
    """Return a state as a filter has it: errors of calibration by tolerance, all a little correlated."""
    layout = target.filter_layout
    sigmas = np.concatenate([[0.01, 0.01, 0.01, 1e-3, 1e-3, 0.01, 0.01, 0.01], layout.prior]) * rng.uniform(
        0.3, 1.0, layout.size
    )
    A = np.eye(layout.size) + rng.normal(0.0, 0.3 / np.sqrt(layout.size), (layout.size, layout.size))
    mean = 0.3 * sigmas * rng.normal(size=layout.size)
    mean[:3] += [rng.uniform(-0.8, -0.15), rng.normal(0.0, 0.02), rng.normal(0.0, 0.03)]
    P = (A @ A.T) * np.outer(sigmas, sigmas)
    return FilterState(0, mean, 0.5 * (P + P.T), None, 0, 0, rng.uniform(1.0, 3.0))


@pytest.mark.parametrize(("grade", "readout_ms"), [("perfect", 0.0), ("careful", 0.0), ("careful", 30.0)])
def test_the_update_is_that_of_plain_numpy(scene: Scene, grade: str, readout_ms: float) -> None:
    """One to five tags, with and without measured deviations, one of them far off in a third of the cases."""
    given = {"as_built": grade, "cameras": {"onboard": {"rolling_shutter_ms": readout_ms}}}
    built = Scene.model_validate({**scene.model_dump(exclude=set(given)), **given})
    target = TargetModel.from_scene(built.told(), built.docks[0])
    update = CornerUpdate(target, None, CornerNoise().tilt_sigma, GATE, 2.0)
    rng, compared, gated = np.random.default_rng(5), 0, 0
    for case in range(40):
        prior = _prior(target, rng)
        rates = Rates(-5e-3, 5e-3, *(k * rng.normal(0.0, [0.1, 0.02, 0.3], (3, 3)) for k in (1e-3, 1.0)))
        pose = rng.multivariate_normal(prior.mean[:5], 0.1 * prior.covariance[:5, :5])
        ids = rng.permutation(target.tags)[: rng.integers(1, 6)]
        tags = [t for i in ids for t in see(pose, [i], rng, 0.05)]
        if case % 2:
            tags = [replace(t, corner_sigma_px=rng.uniform(0.02, 0.4, 4)) for t in tags]
        if case % 3 == 0:
            tags[0] = replace(tags[0], corners=tags[0].corners + 60.0)
        expected = _by_numpy(target, prior, tags, rates)
        found = update.correct(prior, Detections(EXPOSURE, tuple(tags), ()), rates)
        assert (found is None) == (expected is None)
        gated += expected is None or case % 3 == 0
        if found is None or expected is None or not expected[1]:
            continue
        compared += 1
        sigma = np.sqrt(np.diag(expected[0].covariance))
        # Rounding: what lies beyond the borders of small tags has 1e5 times the variance of the least errors.
        np.testing.assert_allclose((found.mean - expected[0].mean) / sigma, 0.0, atol=1e-8)
        difference = (found.covariance - expected[0].covariance) / np.outer(sigma, sigma)
        np.testing.assert_allclose(difference, 0.0, atol=1e-9)
        assert found.noise_scale == pytest.approx(expected[0].noise_scale, rel=1e-9)
        assert found.cost == pytest.approx(expected[0].cost, abs=1e-6)
        assert (found.covariance == found.covariance.T).all()
    assert compared > 20
    assert gated > 5


def test_where_a_step_does_not_descend_the_fit_is_damped(scene: Scene) -> None:
    """A unit that hardly knows where it is sees three tags: without damping the steps overshoot."""
    target = TargetModel.from_scene(scene, scene.docks[0])
    update = CornerUpdate(target, None, CornerNoise().tilt_sigma, GATE, 2.0)
    layout, X = target.filter_layout, np.array([-0.6, 0.05, 0.05, 0.0, 0.0])
    mean = np.zeros(layout.size)
    mean[:3] = X[:3] + np.array([-0.3, 0.1, 0.0])
    sigmas = np.concatenate([[0.5, 0.3, 0.5, 1e-3, 1e-3, 0.01, 0.01, 0.01], layout.prior])
    prior = FilterState(0, mean, np.diag(sigmas**2), None, 0)
    tags = list(see(X, target.port_tags))
    plain = _by_numpy(target, prior, tags, AT_REST)
    assert plain is not None
    assert not plain[1]
    found = update.correct(prior, Detections(EXPOSURE, tuple(tags), ()), AT_REST)
    assert found is not None
    np.testing.assert_allclose(found.mean[:3], X[:3], atol=1e-4)
