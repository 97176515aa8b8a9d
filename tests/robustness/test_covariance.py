"""The covariances of the estimates by both cameras against their errors.

``pytest -s -m "nightly or not nightly" tests/robustness/test_covariance.py`` prints the figures that
``docs/explanation/estimator.md`` cites: per coordinate the RMS error over the RMS standard deviation.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2

from msrr_bullet.log import MemoryRecorder, TruePose
from msrr_bullet.sensors.image_noise import ImageNoise
from msrr_bullet.trial.trial import Trial
from msrr_perception.detection.detector import PupilDetector
from msrr_perception.detection.onboard_vision import OnboardVision
from msrr_perception.estimation.corner_filter import CornerEkf
from msrr_perception.pose.calibration import Quantity
from msrr_perception.pose.target import TargetModel
from msrr_scenes.as_built import draw_as_built
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import (
    NS_PER_S,
    ArenaEstimate,
    Detections,
    Exposure,
    Pixels,
    PoseEstimate,
    WheelOdometry,
)
from msrr_scenes.specs.as_built import Grade, graded_optics
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.sensors import OdometrySpec
from tests.conftest import not_none, pose_error

#: Gaps of the standing views [m], their number, and frames at 25 Hz for which the unit stands.
GAPS_M, VIEWS, FRAMES = (0.58, 0.62), 16, 51

#: Seeds of the approaches, and the gaps at which they are looked at [m].
SEEDS = range(2000, 2050)
WAYPOINTS_M = (0.6, 0.4, 0.2)

#: Bounds of the mean NEES with perfect calibration: variances up to three times too large, and the value
#: that those of an honest covariance exceed once in 2000 times.
_SAFE = 1.0, float(chi2.ppf(0.9995, 3 * len(SEEDS)) / len(SEEDS))


def _graded(grade: Grade) -> dict[str, str]:
    """Return the overrides that give robots and onboard cameras a grade of workmanship."""
    return {"as_built": grade} | {f"cameras.onboard.{k}": str(v) for k, v in graded_optics(grade).items()}


#: What robots and cameras are like: overrides, and the bounds of the mean NEES.
BOUNDS: dict[str, tuple[dict[str, str], float, float]] = {
    "noise 2": ({}, *_SAFE),
    "noise 8": ({"cameras.onboard.noise_grey": "8"}, *_SAFE),
    "encoders of 5 Hz": ({"odometry.rate_hz": "5"}, 0.0, _SAFE[1]),
    "blur 1 px": ({"cameras.onboard.blur_px": "1"}, 0.0, 6.0),
    "careful": (_graded("careful"), 1.0, 6.0),
    "workshop": (_graded("workshop"), 1.0, 6.0),
}

#: Error and standard deviation of (x, y, yaw), shape (6,) [m, rad].
Sample = np.ndarray


def stand(view: Any, target: TargetModel, key: int, blur_px: float) -> Sample:
    """Let the filter watch a view, each frame with noise of its own, and return its last estimate."""
    lens, vision = ImageNoise(key, blur_px, 2.0), OnboardVision(target, PupilDetector())
    estimator = CornerEkf(target, OdometrySpec())
    for frame in range(FRAMES):
        now_ns = frame * 40_000_000

        def fetch(window: Window, frame: int = frame) -> Pixels:
            x, y = window.x + view.margin - lens.margin, window.y + view.margin - lens.margin
            height, width = window.height + 2 * lens.margin, window.width + 2 * lens.margin
            ideal = np.ascontiguousarray(view.ideal[y : y + height, x : x + width])
            return lens.read_out(ideal, window, frame)

        estimator.add_odometry(WheelOdometry("a", now_ns, 0.0, 0.0))
        exposure = Exposure(target.camera_name, frame + 1, now_ns)
        estimator.add_detections(vision.detect(exposure, estimator.predict(now_ns), fetch))
    estimate = not_none(estimator.estimate(now_ns))
    return sample(estimate, view.X_DU)


def sample(estimate: PoseEstimate, X_DU: SE2) -> Sample:
    return np.concatenate([pose_error(estimate.X_DU, X_DU), np.sqrt(np.diag(estimate.covariance))])


def ratios(what: str, samples: Iterable[Sample]) -> np.ndarray:
    """Return and print the RMS error over the RMS standard deviation of x, y and yaw, shape (3,)."""
    rms = np.sqrt(np.mean(np.square(list(samples)), axis=0))
    print(f"\n{what}: RMS error over sigma", *(f"{r:.2f}" for r in rms[:3] / rms[3:]), end="")
    return np.asarray(rms[:3] / rms[3:])


def test_standing_at_the_blur_of_the_scene(gallery: Callable[..., Any]) -> None:
    """16 views from 0.6 m for 2 s: the standard deviations are right to a factor of 1.6.

    Measured: 0.44, 0.60 and 0.59. The errors of the views are independent, so that 16 times the square of
    such a ratio is distributed as chi-square: one of three exceeds 1.6 by chance once in 600 times.
    """
    views = gallery(GAPS_M, VIEWS)
    seen = ratios("stands, 0.4 px", (stand(v, views.target, i, 0.4) for i, v in enumerate(views.views)))
    assert (seen < 1.6).all()


def test_standing_at_a_blur_of_one_pixel(gallery: Callable[..., Any]) -> None:
    """The other side: the same frames blurred by 1 px, where the corners of all frames err alike.

    The filter takes each frame for new information, so that its standard deviation falls and the error stays:
    it is optimistic. Measured: 1.14, 1.21 and 1.25; if these are the true ones, chance leaves the bounds once
    in 90 times.
    """
    views = gallery(GAPS_M, VIEWS)
    seen = ratios("stands, 1 px", (stand(v, views.target, i, 1.0) for i, v in enumerate(views.views)))
    assert (seen < 2.0).all()
    assert (seen[1:] > 0.7).all()


@pytest.mark.nightly
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("what", BOUNDS)
def test_on_the_way(what: str, shipped: Callable[..., Scene]) -> None:
    """The mean NEES of 50 approaches, at 0.6, 0.4 and 0.2 m, is that of a covariance that may be trusted.

    These gave 2.01, 2.89 and 2.21 with perfect calibration, and 1.74, 2.61 and 2.33 with a noise of 8 grey
    levels, where 3 is right, with standard errors of 0.2 to 0.4: far away the variances are half as large
    again as they should be. So by chance a mean of 50 lies below the lower bound once in 1000 times, and
    above the upper one of an honest covariance once in 2000. The other bounds are wider, because some of the
    light beside small, blurred tags is left, and errors of calibration enter to first order.

    Robots of the grade ``workshop`` have most blur. Over 50 other approaches, of the seeds 3000 to 3049, they
    gave 3.6, 3.5 and 3.3, and 2.6 in the seat. Of 200,000 means of 50 that were drawn from these, none is
    above 6. When the light beside the tags was not subtracted, these seeds gave 5.0 at 0.4 m, and 150 of them
    6.1.

    Between the readings of slow encoders the wheels may accelerate. While the covariance had nothing of it,
    the mean NEES of all estimates of four approaches was 345 with encoders of 5 Hz; it is 0.7.

    The last estimate is of a unit in its seat, and has the upper bound alone: with perfect calibration its
    NEES is 0.1, for the filter grants every unit that touches its port a spinning wheel.
    """
    overrides, low, high = BOUNDS[what]
    places = *(f"at {gap:g} m" for gap in WAYPOINTS_M), "in the seat"
    at: dict[str, list[np.ndarray]] = {place: [] for place in places}
    for seed in SEEDS:
        estimates = approach(shipped("close_range", overrides), seed)
        passed = [next(off for gap, off in estimates if gap < waypoint) for waypoint in WAYPOINTS_M]
        for place, off in zip(places, [*passed, estimates[-1][1]], strict=True):
            at[place].append(off)
    means = {place: float(np.mean(values, axis=0)[0]) for place, values in at.items()}
    for place, values in at.items():
        rms, mean = np.sqrt(np.mean(np.square(values), axis=0))[1:], np.mean(values, axis=0)[1:]
        print(f"\n{what}, {place}: NEES {means[place]:.2f}, x, y, yaw in sigma: RMS {rms.round(1)}", end="")
        print(f", mean {mean.round(1)}", end="")
    assert max(means.values()) <= high, means
    assert min(means[place] for place in places[:-1]) >= low, means


@pytest.mark.nightly
@pytest.mark.timeout(1800)
@pytest.mark.parametrize(
    ("name", "grade"), [("close_range", "careful"), ("two_units", "careful"), ("close_range", "rough")]
)
def test_what_an_approach_shows_of_the_calibration(
    name: str, grade: str, shipped: Callable[..., Scene], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The errors of the filter about its calibration in 48 trials are as large as their standard deviations.

    Each trial has tags of other ids: what a tag shows beside its borders moves its edges alike in all trials,
    so that trials with the same tags would be one draw of these errors.

    Measured: 0.6 to 1.7, most for focal length and k1 in ``two_units``; 2.1 for k1 in ``close_range`` if
    corners of tags that a turn smears count as those of others do. Of 39 honest deviations one gives a ratio
    above 1.4 once in 300 times, and of 39 that are 1.4 times too small one gives a ratio above 2.0 once in
    900. Nothing that was built within its tolerances contradicts them. Of ``rough`` robots the camera is left
    out: what noise and blur leave of tags far away tells of its lens, with errors unknown to the filter
    (1.8 for pitch and ``cy_px``, 2.2 for k1).
    """
    filters: list[CornerEkf] = []
    receive = CornerEkf.add_detections

    def add_detections(self: CornerEkf, detections: Detections) -> None:
        filters[:] = [self]
        receive(self, detections)

    monkeypatch.setattr(CornerEkf, "add_detections", add_detections)
    errors, learned = defaultdict(list), defaultdict(list)
    for number, seed in enumerate(range(900, 948), 1):
        scene = shipped(name, {"as_built": grade, "units.b.number": str(number)})
        Trial(scene, seed).run()
        built = draw_as_built(scene, seed).errors
        for known in filters[0].calibration_errors():
            key = _name_as_built(scene, scene.docks[0], known.quantity)
            errors[key].append((known.error - built[key]) / known.sigma)
            learned[key].append(known.sigma / known.tolerance)
            assert not known.contradicts, known
    ratio = {key: math.sqrt(np.square(values).mean()) for key, values in errors.items()}
    print(f"\n{name}, {grade}: sigma over tolerance, RMS and mean of the errors over sigma")
    for key, value in ratio.items():
        print(f"{key:36} {np.mean(learned[key]):4.2f} {value:4.2f} {np.mean(errors[key]):+5.2f}")
    assert len(ratio) == 39
    judged = {key: value for key, value in ratio.items() if grade == "careful" or "/onboard/" not in key}
    assert all(value < 2.0 for value in judged.values()), ratio


def _name_as_built(scene: Scene, step: DockStep, quantity: Quantity) -> str:
    """Return the name of a quantity of a docking pair among what was built."""
    group, key = quantity.name.split(".")
    target, port = step.target_unit, step.target_port
    if quantity.tag is not None:
        slot = next(slot for slot, tag in scene.tag_ids(target).items() if tag == quantity.tag)
        return f"unit/{target}/tags/{slot}/{key}"
    part = {"tags": f"{target}/tags", "bracket": f"{target}/bracket/{port}"}.get(
        group, f"{step.unit}/{group}"
    )
    return f"unit/{part}/{key}"


@pytest.mark.nightly
@pytest.mark.timeout(1800)
def test_from_above_with_care(shipped: Callable[..., Scene]) -> None:
    """The mean NEES of the overhead estimates of 50 trials of robots built with care is between 1.5 and 6.

    Each trial draws a calibration, and gives a value for each of the two units as soon as both are known and
    6 s later, when one of them drives. If these are distributed as chi-square with 3 degrees of freedom, the
    mean of 50 leaves 2.0 .. 4.3 once in 1000 times.
    """
    at: dict[tuple[str, int], list[float]] = defaultdict(list)
    for seed in SEEDS:
        recorder = MemoryRecorder()
        Trial(shipped("two_units", {"as_built": "careful"}), seed, recorder=recorder).run()
        truth = {(m.name, ns): m.X_WB for _, ns, m in recorder.messages if isinstance(m, TruePose)}
        estimates = [m for _, _, m in recorder.messages if isinstance(m, ArenaEstimate)]
        for after_s in (0, 6):
            due_ns = estimates[0].stamp_ns + after_s * NS_PER_S
            arena = next(m for m in estimates if m.stamp_ns >= due_ns and m.target is not None)
            for body in (arena.own, arena.target):
                assert body is not None
                e = pose_error(body.X_WB, truth[body.name, arena.stamp_ns])
                at[body.name, after_s].append(float(e @ np.linalg.solve(body.covariance, e)))
    means = {key: float(np.mean(values)) for key, values in at.items()}
    print("\nfrom above: NEES", *(f"{n:.2f} of {unit} after {t} s" for (unit, t), n in means.items()), end="")
    assert all(len(values) == len(SEEDS) for values in at.values())
    assert len(means) == 4
    assert all(1.5 <= mean <= 6.0 for mean in means.values()), means


def approach(scene: Scene, seed: int) -> list[tuple[float, np.ndarray]]:
    """Run a trial; return the true gap [m], and NEES and errors in sigma, shape (4,), of each estimate."""
    recorder, step = MemoryRecorder(), scene.plan[0]
    Trial(scene, seed, recorder=recorder).run()
    target = TargetModel.from_scene(scene, step)
    X_target_D = scene.dock_frame(step)
    truth = {(m.name, ns): m.X_WB for _, ns, m in recorder.messages if isinstance(m, TruePose)}
    found = []
    for _, ns, m in recorder.messages:
        if isinstance(m, PoseEstimate):
            X_DU = (truth[step.target_unit, ns] @ X_target_D).inverse() @ truth[step.unit, ns]
            error, sigma = np.split(sample(m, X_DU), 2)
            nees = float(error @ np.linalg.solve(m.covariance, error))
            found.append((-X_DU.x - target.front, np.array([nees, *(error / sigma)])))
    return found
