from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.stats import chi2

from msrr_perception.estimation.dock_frame import pose_in_D
from msrr_perception.kernels.calibrated import CLOCK
from msrr_perception.motion.drive_motion import DriveMotion
from msrr_perception.motion.filter_state import FilterState
from msrr_perception.motion.motion_noise import DEFAULT_NOISE, MotionNoise
from msrr_perception.motion.wheel_history import WheelHistory
from msrr_perception.pose.target import TargetModel
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import WheelOdometry
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.sensors import OdometrySpec

TICK_NS = 10_000_000
SILENT = MotionNoise(slip=0.0, sideways=0.0, contact=0.0, guidance=0.0, drift=0.0, turn_drift=0.0)


def _wheels(left: np.ndarray, right: np.ndarray) -> WheelHistory:
    history = WheelHistory()
    for i, (a, b) in enumerate(zip(left, right, strict=True)):
        history.add(WheelOdometry("a", i * TICK_NS, float(a), float(b)))
    return history


def _start(motion: DriveMotion, pose: SE2, history: WheelHistory) -> FilterState:
    prior = motion.prior
    mean = np.concatenate([[pose.x, pose.y, pose.yaw, 0.0, 0.0], prior.mean])
    P = block_diag(np.diag([1e-6, 1e-6, 1e-6, 1e-5, 1e-5]), prior.covariance)
    return FilterState(0, mean, P, history.angles_at(0), 0)


def test_odometry_alone_is_the_integral_on_se2(target: TargetModel) -> None:
    """300 random steps, some of them turns on the spot and some straight, against exp on SE(2)."""
    rng = np.random.default_rng(0)
    steps = rng.normal(0.0, 0.1, (300, 2))
    steps[50:60, 1] = -steps[50:60, 0]
    steps[60:70, 1] = steps[60:70, 0]
    angles = np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
    history = _wheels(*angles.T)
    motion = DriveMotion(target, OdometrySpec(), DEFAULT_NOISE)
    X = start = SE2(-0.7, 0.1, 0.3)
    for left, right in steps * target.wheel_radius:
        X = X @ SE2.exp(0.5 * (left + right), 0.0, (right - left) / target.track)
    state = motion.propagate(_start(motion, start, history), history, 300 * TICK_NS)
    np.testing.assert_allclose(state.mean[:3], X.as_array(), atol=1e-9)


@pytest.mark.parametrize("strain", [0.0, 0.04])
def test_stops_on_the_way_change_nothing(target: TargetModel, strain: float) -> None:
    """The way is the same in one go and in pieces that end between readings (steps of constant speed)."""
    turn = np.linspace(0.0, 4.0, 41)
    history = _wheels(turn, 1.4 * turn)
    motion = DriveMotion(target, OdometrySpec(), replace(DEFAULT_NOISE, strain=strain))
    start = _start(motion, SE2(-0.7, 0.1, 0.3), history)
    whole = motion.propagate(start, history, 40 * TICK_NS)
    state = start
    for t in np.linspace(0, 40 * TICK_NS, 58).astype(int):
        state = motion.propagate(state, history, int(t))
    np.testing.assert_allclose(state.mean, whole.mean, atol=1e-9)
    np.testing.assert_allclose(state.covariance, whole.covariance, rtol=2e-3, atol=1e-9)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_between_rare_readings_the_wheels_may_accelerate(target: TargetModel, sign: float) -> None:
    """Both do, and the axle is off by sqrt(2) sigma, for each is taken to err for itself."""
    acceleration, times = 0.2, 0.2 * np.arange(6)
    history = WheelHistory()
    for t, angle in zip(times, 0.5 * acceleration * times**2 / target.wheel_radius, strict=True):
        history.add(WheelOdometry("a", round(1e9 * t), float(angle), float(sign * angle)))
    motion, blind = (
        DriveMotion(target, OdometrySpec(), replace(SILENT, acceleration=a)) for a in (acceleration, 0.0)
    )
    for t in (0.3, 0.75, 1.05, 1.15):
        start, stamp = _start(motion, SE2(), history), round(1e9 * t)
        way = 0.5 * acceleration * t * t
        x, turn = (way, 0.0) if sign > 0.0 else (0.0, -2.0 * way / target.track)
        for moved, still in (
            (motion.propagate(start, history, stamp), blind.propagate(start, history, stamp)),
            (motion.predict(start, history, stamp), blind.predict(start, history, stamp)),
        ):
            added = np.sqrt(np.diag(moved.covariance - still.covariance)[[0, 2]])
            pose = moved.mean if isinstance(moved, FilterState) else moved.X_DU.as_array()
            off = pose[0] - x if sign > 0.0 else pose[2] - turn
            assert abs(off) == pytest.approx(math.sqrt(2.0) * added[0 if sign > 0.0 else 1], rel=1e-3)


def test_lengths_are_strained_and_turns_are_not(target: TargetModel) -> None:
    """A way of 0.2 m is off by 4 % of it, and by what that changes on 0.2 m; a turn by nothing."""
    angles = np.linspace(0.0, 0.2 / target.wheel_radius, 41)
    for sign, along in ((1.0, 0.2 * 0.04), (-1.0, 0.0)):
        history, ended = _wheels(angles, sign * angles), []
        for strain in (0.0, 0.04):
            motion = DriveMotion(target, OdometrySpec(), replace(SILENT, strain=strain))
            ended.append(motion.propagate(_start(motion, SE2(), history), history, 40 * TICK_NS))
        added = ended[1].covariance - ended[0].covariance
        assert math.sqrt(max(added[0, 0], 0.0)) == pytest.approx(along, rel=0.03, abs=1e-6)
        assert added[2, 2] == pytest.approx(0.0, abs=1e-12)


def test_the_covariance_moves_by_the_derivative_of_the_motion(target: TargetModel) -> None:
    """Without noise F P F^T with F by central differences of the mean, for all states."""
    turn = np.linspace(0.0, 3.0, 11)
    history = _wheels(0.6 * turn, turn)
    motion = DriveMotion(target, OdometrySpec(noise_rad=0.0), replace(SILENT, tilt_sigma=1e-9))
    rng = np.random.default_rng(1)
    state = _start(motion, SE2(-0.7, 0.1, 0.3), history)
    n = len(state.mean)
    A = rng.normal(0.0, 0.01, (n, n))
    state = state._replace(covariance=A @ A.T)
    end = motion.propagate(state, history, 10 * TICK_NS)
    h, F = 1e-6, np.empty((n, n))
    for i in range(n):
        e = h * np.eye(n)[i]
        ahead, behind = (
            motion.propagate(state._replace(mean=state.mean + s * e), history, 10 * TICK_NS).mean
            for s in (1, -1)
        )
        F[:, i] = (ahead - behind) / (2.0 * h)
    np.testing.assert_allclose(end.covariance, F @ state.covariance @ F.T, rtol=1e-3, atol=1e-8)


def test_wheel_errors_are_covered_by_the_covariance(target: TargetModel) -> None:
    """200 drives of 0.5 m without a camera, radii off by 2 % and noisy encoders.

    The summed NEES is chi-square with 600 degrees of freedom at most (the model also allows for slip, which
    this drive has none of): odds 1e-6 to exceed the upper bound; the lower one says it is not idle.
    """
    spec, nees, n = OdometrySpec(), 0.0, 200
    rng = np.random.default_rng(4)
    motion = DriveMotion(target, spec, DEFAULT_NOISE)
    for _ in range(n):
        scale = 1.0 + rng.normal(0.0, spec.scale_error, 2)
        true = np.outer(np.arange(101), [0.14, 0.16])  # rad
        noise = spec.noise_rad * np.sqrt(np.array([0.14, 0.16])) * rng.normal(size=(100, 2))
        measured = true / scale + np.concatenate([np.zeros((1, 2)), np.cumsum(noise, axis=0)])
        history = _wheels(*measured.T)
        way = true[-1] * target.wheel_radius
        X = SE2(-0.7, 0.0, 0.0) @ SE2.exp(way.mean(), 0.0, float(way[1] - way[0]) / target.track)
        state = motion.propagate(_start(motion, SE2(-0.7, 0.0, 0.0), history), history, 100 * TICK_NS)
        e = state.mean[:3] - X.as_array()
        nees += float(e @ np.linalg.solve(state.covariance[:3, :3], e))
    assert 0.3 * 3 * n < nees < chi2.ppf(1 - 1e-6, 3 * n)


def test_what_readings_are_rounded_by_is_in_the_covariance(target: TargetModel) -> None:
    """400 motions of 4 mm and 0.04 rad between two exposures, by encoders of 512 ticks per turn.

    Their summed NEES is chi-square with 1200 degrees of freedom at most (the unit does not slip): odds 1e-6
    to exceed the upper bound; the lower one says that it is not idle.
    """
    spec, tick, nees, n = OdometrySpec(ticks_per_turn=512), 2.0 * math.pi / 512, 0.0, 400
    rng, motion = np.random.default_rng(5), DriveMotion(target, spec, DEFAULT_NOISE)
    for _ in range(n):
        true = rng.uniform(0.0, tick, 2) + np.outer([0.0, 0.25, 0.5, 0.75, 1.0], [0.04, 0.2])
        history = _wheels(*(tick * np.floor(true / tick)).T)
        way = (true[-1] - true[0]) * target.wheel_radius
        X = SE2(-0.7, 0.0, 0.0) @ SE2.exp(way.mean(), 0.0, float(way[1] - way[0]) / target.track)
        start = _start(motion, SE2(-0.7, 0.0, 0.0), history)
        state = motion.to_measurement(start, history, 4 * TICK_NS)
        e = state.mean[:3] - X.as_array()
        known = state.covariance[:3, :3] - start.covariance[:3, :3]
        nees += float(e @ np.linalg.solve(known, e))
    assert 0.3 * 3 * n < nees < chi2.ppf(1 - 1e-6, 3 * n)


def test_tilt_forgets_and_scales_do_not(target: TargetModel) -> None:
    motion = DriveMotion(target, OdometrySpec(), DEFAULT_NOISE)
    state = _start(motion, SE2(-0.7, 0.0, 0.0), WheelHistory())
    state = state._replace(mean=np.array([-0.7, 0.0, 0.0, 0.01, -0.01, 0.02, 0.01, 0.005, 0.01]))
    later = motion.propagate(state, WheelHistory(), 10 * 1_000_000_000)
    np.testing.assert_allclose(later.mean[3:5], 0.0, atol=1e-5)
    np.testing.assert_allclose(later.covariance[3, 3], DEFAULT_NOISE.tilt_sigma**2, rtol=1e-3)
    np.testing.assert_array_equal(later.mean[5:], state.mean[5:])
    np.testing.assert_array_equal(later.mean[:3], state.mean[:3])


@pytest.mark.parametrize(("x", "grows"), [(-0.5, False), (-0.11, True)])
def test_wheels_may_spin_at_the_port_only(target: TargetModel, x: float, grows: bool) -> None:
    turn = np.linspace(0.0, 0.02 / target.wheel_radius, 41)  # 20 mm of wheel travel
    history = _wheels(turn, turn)
    motion = DriveMotion(target, OdometrySpec(), DEFAULT_NOISE)
    state = motion.propagate(_start(motion, SE2(x, 0.0, 0.0), history), history, 40 * TICK_NS)
    sigma = math.sqrt(state.covariance[0, 0])
    assert (sigma > 0.0018) == grows


@pytest.mark.parametrize(
    ("place", "at_port"), [((-0.5, 0.02), False), ((-0.11, 0.02), True), ((-0.11, -0.8), False)]
)
@pytest.mark.parametrize("loose", [False, True])
@pytest.mark.parametrize("turned", [(0.8, 0.5), (-0.8, -0.5), (-0.3, 0.4)])
def test_what_the_encoders_do_not_measure_adds_up_from_its_parts(
    scene: Scene, place: tuple[float, float], at_port: bool, loose: bool, turned: tuple[float, float]
) -> None:
    """One step in a bend, ahead, back, or nearly on the spot, against J Q J^T of independent motions.

    They are those of the wheels, and along and across the unit. One far to the side of the port was taken to
    touch it where it was near to the plane of its face: of two poses by one tag, a wrong one won by that.
    """
    built = Scene.model_validate({**scene.model_dump(exclude={"as_built"}), "as_built": "careful"})
    target = TargetModel.from_scene(built.told(), built.docks[0])
    backlash, radius = target.tolerances.backlash, target.wheel_radius
    assert backlash > 0.0
    noise = MotionNoise(slip=0.01, sideways=0.02, contact=0.05, guidance=0.03, drift=4e-4, turn_drift=0.006)
    after = []
    for spec, kind, first in (
        (OdometrySpec(noise_rad=0.02), noise, 0.0 if loose else 9.0 * backlash),
        (OdometrySpec(noise_rad=0.0), SILENT, 9.0 * backlash),
    ):
        before = first * np.sign(turned)
        history = _wheels(*np.array([[0.0, 0.0], before, before + turned]).T)
        motion = DriveMotion(target, spec, kind)
        state = _start(motion, SE2(*place, 0.3), history)._replace(stamp_ns=TICK_NS, wheels=None)
        after.append(motion.propagate(state, history, 2 * TICK_NS))
    d, dt = radius * np.abs(turned), 1e-9 * TICK_NS
    wheel = noise.slip**2 + radius * (0.02**2 + 0.5 * backlash * loose) + at_port * noise.contact**2
    across = noise.sideways**2 + at_port * noise.guidance**2
    Q = np.diag([*(wheel * d), across * d.mean(), *[noise.drift**2 * dt] * 2, noise.turn_drift**2 * dt])
    track = target.track
    J = np.array([[0.5, 0.5, 0, 1, 0, 0], [0, 0, 1, 0, 1, 0], [-1 / track, 1 / track, 0, 0, 0, 1]])
    middle = 0.3 + 0.5 * radius * (turned[1] - turned[0]) / track
    R = np.array(
        [[math.cos(middle), -math.sin(middle), 0], [math.sin(middle), math.cos(middle), 0], [0, 0, 1]]
    )
    added = after[0].covariance - after[1].covariance
    np.testing.assert_allclose(added[:3, :3], R @ J @ Q @ J.T @ R.T, rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize("grade", ["perfect", "careful"])
def test_a_prediction_is_the_state_moved_and_seen_from_the_dock_frame(scene: Scene, grade: str) -> None:
    """Against dense matrices, at the time of the state, between two readings, and at a reading."""
    built = Scene.model_validate({**scene.model_dump(exclude={"as_built"}), "as_built": grade})
    target = TargetModel.from_scene(built.told(), built.docks[0])
    rng, layout = np.random.default_rng(0), target.filter_layout
    history = _wheels(*np.cumsum(rng.normal(0.05, 0.05, (2, 20)), axis=1))
    motion = DriveMotion(target, OdometrySpec(), DEFAULT_NOISE)
    A = rng.normal(0.0, 0.01, (layout.size, layout.size))
    start = FilterState(2 * TICK_NS, rng.normal(0.0, 0.01, layout.size), A @ A.T, None, TICK_NS)
    for stamp_ns in (2 * TICK_NS, 75 * TICK_NS // 10, 12 * TICK_NS):
        moved = motion.propagate(start, history, stamp_ns)
        X, J = pose_in_D(layout, moved)
        found = motion.predict(start, history, stamp_ns)
        assert (found.stamp_ns, found.last_seen_ns) == (stamp_ns, TICK_NS)
        assert found.X_DU == X
        np.testing.assert_allclose(found.covariance, J @ moved.covariance @ J.T, rtol=1e-9, atol=1e-15)


@pytest.mark.parametrize("late_s", [-0.02, 0.0, 0.03])
@pytest.mark.parametrize(("left", "right"), [(0.2, 0.3), (-0.25, 0.25), (0.1, 0.1)])
def test_the_rates_about_an_exposure_are_those_of_the_arc_that_is_driven(
    scene: Scene, left: float, right: float, late_s: float
) -> None:
    """Way and velocity in D of a unit on a circle, at all instants within three sigma of the exposure.

    A time by which the clock is ahead of 30 ms turns the unit on the spot by nearly a quarter of a radian.
    """
    built = {"grade": "perfect", "onboard": {"clock_ms": {"sigma": 10.0}}}
    told = Scene.model_validate({**scene.model_dump(exclude={"as_built"}), "as_built": built}).told()
    target = TargetModel.from_scene(told, told.plan[0])
    motion, ticks = DriveMotion(target, OdometrySpec(), DEFAULT_NOISE), np.arange(41)
    history = _wheels(left * ticks, right * ticks)
    start = _start(motion, SE2(-0.7, 0.1, 0.3), history)
    mean = start.mean.copy()
    mean[target.filter_layout.tags.columns[0, CLOCK]] = late_s
    mean[5:7] = 0.03, -0.02  # what was learned of the radii
    rates = motion.rates(start._replace(stamp_ns=20 * TICK_NS, mean=mean), history)

    by_left, by_right = target.wheel_radius / (1e-9 * TICK_NS) * np.array([1.03 * left, 0.98 * right])
    v, w = 0.5 * (by_left + by_right), (by_right - by_left) / target.track
    X_stamp, after = SE2(-0.7, 0.1, 0.3), rates.first + rates.step * np.arange(len(rates.way))
    np.testing.assert_allclose(
        [after[0], np.mean(after), after[-1]], -late_s + np.array([-0.03, 0.0, 0.03]), atol=1e-9
    )
    for t, way, velocity in zip(after, rates.way, rates.velocity, strict=True):
        X = X_stamp @ SE2.exp(t * v, 0.0, t * w)
        ahead = v * np.array([math.cos(X.yaw), math.sin(X.yaw)])
        np.testing.assert_allclose(way, X.as_array() - X_stamp.as_array(), rtol=0.01, atol=2e-5)
        np.testing.assert_allclose(velocity, [*ahead, w], rtol=2e-3, atol=1e-3)


@pytest.mark.parametrize(("until", "last"), [(20, 25), (10, 10)])
def test_what_tells_the_angles_about_an_instant_tells_those_at_any(until: int, last: int) -> None:
    """Also before the first reading, after the newest one, and long after it."""
    rng = np.random.default_rng(0)
    history = _wheels(*np.cumsum(rng.normal(size=(2, until + 1)), axis=1))
    about = history.about(last * TICK_NS, 30 * TICK_NS)
    for at_ns in rng.integers((last - 30) * TICK_NS, (last + 30) * TICK_NS, 50).tolist():
        angles = history.angles_at(at_ns)
        assert angles is not None
        time = 1e-9 * (at_ns - last * TICK_NS)
        found = [np.interp(time, about[:, 0], about[:, k]) for k in (1, 2)]
        np.testing.assert_allclose(found, [angles.left, angles.right], atol=1e-9)


def test_nothing_tells_the_angles_before_the_first_reading() -> None:
    assert WheelHistory().about(0, TICK_NS).shape == (0, 3)
