"""A camera whose clock is wrong, or whose rows are exposed one after another, on a unit that moves.

How far the clock is off is told by the motion of the unit, whatever accelerations it has.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from itertools import product
from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2

from msrr_bullet.sensors.wheel_encoders import WheelEncoders
from msrr_perception.estimation.clock_parts import by_parts
from msrr_perception.estimation.corner_filter import CornerEkf
from msrr_perception.kernels.calibrated import CLOCK
from msrr_perception.motion.filter_state import FilterState
from msrr_perception.pose.target import TargetModel, pose_vector
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import Detections, Exposure, PoseMeasurement, TagDetection, WheelOdometry
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.sensors import OdometrySpec
from tests.conftest import not_none
from tests.perception.conftest import see

MS, SIGMA_PX, LATENCY_MS = 1_000_000, 0.05, 40


def _doubtful(scene: Scene, sigma_ms: float = 8.0, readout_ms: float = 0.0) -> Scene:
    """Return a scene in which only the clock of the onboard camera is in doubt, with a shutter."""
    given = {
        "as_built": {"grade": "perfect", "onboard": {"clock_ms": {"sigma": sigma_ms}}},
        "cameras": {"onboard": {"rolling_shutter_ms": readout_ms}},
    }
    return Scene.model_validate({**scene.model_dump(exclude=set(given)), **given}).told()


def _messages(
    target: TargetModel,
    seed: int,
    late_ms: float,
    odometry: OdometrySpec | None = None,
    pose_sigmas: np.ndarray | None = None,
    ends_ms: int = 1000,
) -> tuple[list[Any], SE2]:
    """Return readings and pictures by arrival until a time of at most a second, and the pose then.

    The unit stands for 0.1 s, sets off, turns to and fro and brakes. A picture of the time t has the stamp
    ``t + late_ms``, where ``t`` is the time of its middle row. Without a data sheet the encoders make no
    errors. With standard deviations of (x, y, yaw) it is a measured pose in the place of the picture.
    """
    rng = np.random.default_rng(seed)
    encoders = None if odometry is None else WheelEncoders("a", odometry, np.random.default_rng(seed))
    poses, angles = _driven(rng.uniform(0.8, 1.2), target.track, target.wheel_radius)
    arrivals: list[tuple[float, int, Any]] = []
    for ms, (left, right) in zip(range(0, 1100, 10), angles, strict=True):
        reading = WheelOdometry("a", ms * MS, left, right)
        arrivals.append((ms, 0, encoders.read((left, right), ms * MS) if encoders else reading))
    for frame, stamp in enumerate(range(0, 1000, 40)):
        at_ms, exposure = stamp - late_ms, Exposure("a/onboard", frame, stamp * MS)
        message: Detections | PoseMeasurement
        if pose_sigmas is None:
            tags = see(pose_vector(_pose_at(poses, at_ms)), target.port_tags, rng, SIGMA_PX)
            message = Detections(exposure, _row_by_row(target, poses, at_ms, tags), ())
        else:
            x, y, yaw = _pose_at(poses, at_ms).as_array() + pose_sigmas * rng.normal(size=3)
            message = PoseMeasurement(exposure, SE2(x, y, yaw), np.diag(pose_sigmas**2), (None, None))
        arrivals.append((at_ms + LATENCY_MS, 1, message))
    arrived = [m for m in arrivals if m[0] <= ends_ms + 100]
    return sorted(arrived, key=lambda m: m[:2]), poses[ends_ms + 100]


@cache
def _driven(phase: float, track: float, wheel_radius: float) -> tuple[list[SE2], list[tuple[float, float]]]:
    """Return poses, one per millisecond from -0.1 s on, and wheel angles, one per 10 ms from 0 s on."""
    X, wheels, poses, angles = SE2(-0.7, 0.02, 0.05), np.zeros(2), [], []
    for ms in range(-100, 1100):
        t = 1e-3 * max(ms - 100, 0)
        v = 0.1 * math.sin(math.pi * min(t, 1.0)) ** 2
        w = 0.8 * phase * math.sin(2.0 * math.pi * phase * t) * min(4.0 * t, 1.0)
        poses.append(X)
        if ms >= 0 and ms % 10 == 0:
            angles.append((float(wheels[0]), float(wheels[1])))
        half = 0.5 * w * track
        wheels = wheels + np.array([v - half, v + half]) * 1e-3 / wheel_radius
        X = X @ SE2.exp(1e-3 * v, 0.0, 1e-3 * w)
    return poses, angles


def _pose_at(poses: list[SE2], ms: float) -> SE2:
    before, share = divmod(ms + 100.0, 1.0)
    step = poses[int(before)].inverse() @ poses[int(before) + 1]
    return poses[int(before)] @ SE2(*(share * np.array([step.x, step.y, step.yaw])).tolist())


def _row_by_row(
    target: TargetModel, poses: list[SE2], at_ms: float, tags: tuple[TagDetection, ...]
) -> tuple[TagDetection, ...]:
    """Return tags with each corner where it is when its row is exposed."""
    shutter = target.shutter
    if not shutter.readout_s:
        return tags
    still = {t.tag_id: t.corners for t in see(pose_vector(_pose_at(poses, at_ms)), target.port_tags)}
    moved = []
    for tag in tags:
        corners = still[tag.tag_id].copy()
        for c, _ in product(range(4), range(3)):  # the third guess of the row is exact
            row_ms = at_ms + 1e3 * float(shutter.after_stamp(corners[c, 1]))
            (seen,) = see(pose_vector(_pose_at(poses, row_ms)), [tag.tag_id])
            corners[c] = seen.corners[c]
        moved.append(replace(tag, corners=tag.corners + corners - still[tag.tag_id]))
    return tuple(moved)


def _filter(scene: Scene, messages: list[Any], horizon_s: float = 1.0) -> CornerEkf:
    target = TargetModel.from_scene(scene, scene.docks[0])
    ekf = CornerEkf(target, scene.odometry, corner_sigma_px=SIGMA_PX, horizon_s=horizon_s)
    for _, kind, message in messages:
        if kind == 0:
            ekf.add_odometry(message)
        elif isinstance(message, PoseMeasurement):
            ekf.add_pose(message)
        else:
            ekf.add_detections(message)
    return ekf


@pytest.mark.parametrize(
    ("sigma_ms", "late_ms", "readout_ms"),
    [
        (8.0, -16.0, 0.0),
        pytest.param(8.0, -8.0, 0.0, marks=pytest.mark.nightly),
        (8.0, 0.0, 0.0),
        pytest.param(8.0, 16.0, 0.0, marks=pytest.mark.nightly),
        pytest.param(16.0, -32.0, 0.0, marks=pytest.mark.nightly),
        (16.0, 32.0, 0.0),
        (32.0, -90.0, 0.0),
        pytest.param(32.0, 64.0, 0.0, marks=pytest.mark.nightly),
        (8.0, -8.0, 30.0),
    ],
)
def test_the_clock_is_found_and_its_covariance_is_honest(
    scene: Scene, sigma_ms: float, late_ms: float, readout_ms: float
) -> None:
    """Ten drives; the squared errors are chi-square with 10 and 30 degrees of freedom: odds 1e-6 to fail."""
    _is_honest(_doubtful(scene, sigma_ms, readout_ms), late_ms, 2e-3)


@pytest.mark.parametrize(
    ("sigma_ms", "late_ms"),
    [(16.0, 16.0), (32.0, -64.0), pytest.param(16.0, -32.0, marks=pytest.mark.nightly)],
)
def test_measured_poses_tell_the_clock_as_well(scene: Scene, sigma_ms: float, late_ms: float) -> None:
    """The same with poses in the place of pictures, as parametric perception has them.

    The clock was not looked at: a pose of which the stamp is off by 16 ms is 1.6 mm off.
    """
    _is_honest(_doubtful(scene, sigma_ms), late_ms, 8e-3, np.array([5e-4, 5e-4, 2e-3]))


@pytest.mark.parametrize("late_ms", [-16.0, 16.0])
@pytest.mark.parametrize("pose_sigmas", [None, np.array([5e-4, 5e-4, 2e-3])], ids=["pictures", "poses"])
def test_a_unit_that_turns_when_it_sees_the_port_first_finds_the_clock_as_well(
    scene: Scene, late_ms: float, pose_sigmas: np.ndarray | None
) -> None:
    """It was taken to stand then; errors of pose and clock were eight times what was said of them."""
    _is_honest(_doubtful(scene, 16.0), late_ms, 8e-3, pose_sigmas, first_ms=400)


def _is_honest(
    scene: Scene,
    late_ms: float,
    most_s: float,
    pose_sigmas: np.ndarray | None = None,
    first_ms: int = 0,
) -> None:
    """Check clock and pose after ten drives, and that the clock is known to ``most_s``.

    Pictures, or measured poses, count from the stamp ``first_ms`` on.
    """
    target = TargetModel.from_scene(scene, scene.docks[0])
    column = target.filter_layout.tags.columns[0, CLOCK]
    clock = pose = 0.0
    for seed in range(10):
        messages, X = _messages(target, seed, late_ms, pose_sigmas=pose_sigmas)
        counted = [m for m in messages if m[1] == 0 or m[2].exposure.stamp_ns >= first_ms * MS]
        ekf = _filter(scene, counted)
        state, found = ekf._history.newest, ekf.predict(1000 * MS)
        assert state is not None
        assert found is not None
        clock += (state.mean[column] - 1e-3 * late_ms) ** 2 / state.covariance[column, column]
        e = found.X_DU.as_array() - X.as_array()
        pose += float(e @ np.linalg.solve(found.covariance, e))
        assert math.sqrt(state.covariance[column, column]) < most_s, "the motion does not tell the clock"
    assert clock < chi2.ppf(1 - 1e-6, 10)
    assert pose < chi2.ppf(1 - 1e-6, 30)


@pytest.mark.parametrize("readout_ms", [30.0, 100.0])
def test_each_corner_is_seen_when_its_row_is_exposed(scene: Scene, readout_ms: float) -> None:
    """Ten drives of a unit whose camera has a rolling shutter and is as designed: odds 1e-6 to fail.

    With one time for all rows of 30 ms the squared errors add up to 800, where 30 is right.
    """
    given = {"as_built": "perfect", "cameras": {"onboard": {"rolling_shutter_ms": readout_ms}}}
    rolling = Scene.model_validate({**scene.model_dump(exclude=set(given)), **given})
    target, pose = TargetModel.from_scene(rolling, rolling.docks[0]), 0.0
    for seed in range(10):
        messages, X = _messages(target, seed, 0.0, ends_ms=600)  # when it is fastest
        found = not_none(_filter(rolling, messages).predict(600 * MS))
        e = found.X_DU.as_array() - X.as_array()
        pose += float(e @ np.linalg.solve(found.covariance, e))
    assert pose < chi2.ppf(1 - 1e-6, 30)


@pytest.mark.parametrize("ticks_per_turn", [1024, 512])
def test_errors_of_the_encoders_are_not_taken_for_motion_that_tells_the_clock(
    scene: Scene, ticks_per_turn: int
) -> None:
    """Twenty drives with encoders that round and have noise; the squared errors are chi-square: odds 1e-6.

    A tick is 0.2 and 0.4 mm at the wheel, and between two exposures a unit drives 4 mm.
    """
    doubtful = _doubtful(scene)
    odometry = doubtful.odometry.model_copy(update={"ticks_per_turn": ticks_per_turn, "scale_error": 0.0})
    coarse = doubtful.model_copy(update={"odometry": odometry})
    target = TargetModel.from_scene(coarse, coarse.docks[0])
    column, clock = target.filter_layout.tags.columns[0, CLOCK], 0.0
    for seed in range(20):
        messages, _ = _messages(target, seed, -8.0, odometry)
        state = not_none(_filter(coarse, messages)._history.newest)
        clock += (state.mean[column] + 8e-3) ** 2 / state.covariance[column, column]
    assert clock < chi2.ppf(1 - 1e-6, 20)


@pytest.mark.parametrize(("sigma_ms", "late_ms"), [(8.0, -8.0), (32.0, -64.0)])
def test_the_order_of_arrival_does_not_matter(scene: Scene, sigma_ms: float, late_ms: float) -> None:
    """Readings after a picture tell how the unit moves then, whether they arrive before it or after it."""
    doubtful = _doubtful(scene, sigma_ms)
    target = TargetModel.from_scene(doubtful, doubtful.docks[0])
    messages, _ = _messages(target, 0, late_ms)
    early = sorted(messages, key=lambda m: (m[0] - (LATENCY_MS - late_ms) * m[1], m[1]))
    a, b = (not_none(_filter(doubtful, order).predict(1000 * MS)) for order in (messages, early))
    assert a.X_DU == b.X_DU
    assert np.array_equal(a.covariance, b.covariance)


@pytest.mark.parametrize("late_ms", [-16.0, 16.0])
def test_a_picture_that_is_nearly_too_late_finds_the_readings_about_its_exposure(
    scene: Scene, late_ms: float
) -> None:
    """A picture 0.28 s late at a horizon of 0.3 s gives the result of pictures in order, bit for bit."""
    doubtful = _doubtful(scene)
    target = TargetModel.from_scene(doubtful, doubtful.docks[0])
    messages, _ = _messages(target, 0, late_ms)
    stamp_ns = 600 * MS
    pictures = {m[2].exposure.stamp_ns: m for m in messages if m[1]}
    held, due = pictures[stamp_ns], pictures[stamp_ns + 280 * MS][0]
    late = sorted(((due, 2, held[2]) if m is held else m for m in messages), key=lambda m: m[:2])
    a, b = (_filter(doubtful, order, horizon_s=0.3).predict(1000 * MS) for order in (messages, late))
    assert a is not None
    assert b is not None
    assert a.X_DU == b.X_DU
    assert np.array_equal(a.covariance, b.covariance)


@pytest.mark.parametrize("sigma_s", [0.0101, 0.016, 0.032])
def test_parts_of_a_doubt_add_up_to_the_state_that_was_cut(sigma_s: float) -> None:
    """An update that tells nothing changes nothing: the parts are as likely together as the whole.

    They end 2.5 standard deviations away; a normal distribution that is cut there has 9 % less variance.
    """
    rng, n, clock = np.random.default_rng(3), 9, 8
    A = rng.normal(size=(n, n))
    sigmas = np.array([0.01, 0.01, 0.02, 1e-3, 1e-3, 0.01, 0.01, 0.01, sigma_s])
    P = A @ A.T
    P *= np.outer(sigmas, sigmas) / np.sqrt(np.outer(np.diag(P), np.diag(P)))
    prior = FilterState(0, rng.normal(size=n) * sigmas, P, None, 0, cost=7.0)
    parts = list[FilterState]()

    def tells_nothing(part: FilterState) -> FilterState:
        parts.append(part)
        return part

    found = not_none(by_parts(prior, clock, tells_nothing))
    assert found.cost == pytest.approx(prior.cost)
    np.testing.assert_allclose(found.mean, prior.mean, atol=1e-12)
    np.testing.assert_allclose((found.covariance - P) / np.outer(sigmas, sigmas), 0.0, atol=0.09)
    assert max(math.sqrt(part.covariance[clock, clock]) for part in parts) <= 0.01


def test_wheels_that_spin_at_a_port_tell_nothing_of_the_clock(scene: Scene) -> None:
    """A unit that is locked pulls at its lock, so that its wheels turn backwards while it stands.

    From one picture in which it had not set off, though its wheels had, the clock was known to 2.4 ms.
    """
    of = _doubtful(scene, 30.0)
    target, rng = TargetModel.from_scene(of, of.docks[0]), np.random.default_rng(2)
    ekf, X_DU, told = CornerEkf(target, of.odometry, corner_sigma_px=SIGMA_PX), SE2(-0.1, 0.0, 0.0), []
    for ms in range(0, 2000, 10):
        angle = -0.04 / target.wheel_radius * 1e-3 * min(max(ms - 400, 0), 1000)
        ekf.add_odometry(WheelOdometry("a", ms * MS, angle, angle))
        if ms % 40 == 0:
            exposure = Exposure("a/onboard", ms // 40, ms * MS)
            ekf.add_detections(
                Detections(exposure, see(pose_vector(X_DU), target.port_tags, rng, SIGMA_PX), ())
            )
            clock = next(k for k in ekf.calibration_errors() if k.quantity.name == "onboard.clock_ms")
            pose = not_none(ekf.predict(ms * MS))
            told.append((clock.error, clock.sigma / clock.tolerance, abs(pose.X_DU.x - X_DU.x)))
    errors, shares, off_m = np.transpose(told)
    assert np.abs(errors).max() < 3.0
    assert shares.min() > 0.95
    assert off_m.max() < 0.0005
