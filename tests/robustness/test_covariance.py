"""The covariance of the corner filter against its errors, with the blur of the scene and with 1 px.

``pytest -s -m "nightly or not nightly" tests/robustness/test_covariance.py`` prints the figures that
``perception/README.md`` cites: per coordinate the RMS error over the RMS standard deviation.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
import pytest

from msrr_bullet.log import MemoryRecorder, TruePose
from msrr_bullet.sensors.image_noise import ImageNoise
from msrr_bullet.trial.trial import Trial
from msrr_perception.detection.detector import PupilDetector
from msrr_perception.detection.onboard_vision import OnboardVision
from msrr_perception.estimation.corner_filter import CornerEkf
from msrr_perception.pose.target import TargetModel
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import Exposure, Pixels, PoseEstimate, WheelOdometry
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.sensors import OdometrySpec

#: Gaps of the standing views [m], their number, and frames at 25 Hz for which the unit stands.
GAPS_M, VIEWS, FRAMES = (0.58, 0.62), 16, 51

#: Seeds of the approaches, and the gaps at which they are looked at [m].
SEEDS = range(2000, 2020)
WAYPOINTS_M = ((0.55, 0.65), (0.35, 0.45), (0.15, 0.25))

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
    estimate = estimator.estimate(now_ns)
    assert estimate is not None
    return sample(estimate, view.X_DU)


def sample(estimate: PoseEstimate, X_DU: SE2) -> Sample:
    error = estimate.X_DU.as_array() - X_DU.as_array()
    error[2] = math.remainder(error[2], 2.0 * math.pi)
    return np.concatenate([error, np.sqrt(np.diag(estimate.covariance))])


def ratios(what: str, samples: Iterable[Sample]) -> np.ndarray:
    """Return and print the RMS error over the RMS standard deviation of x, y and yaw, shape (3,)."""
    rms = np.sqrt(np.mean(np.square(list(samples)), axis=0))
    print(f"\n{what}: RMS error over sigma", *(f"{r:.2f}" for r in rms[:3] / rms[3:]), end="")
    return np.asarray(rms[:3] / rms[3:])


def test_standing_at_the_blur_of_the_scene(gallery: Callable[..., Any]) -> None:
    """16 views from 0.6 m for 2 s: the standard deviations are right to a factor of 1.6.

    Measured: 0.66, 0.95 and 0.90. The errors of the views are independent, so that 16 times the square of
    such a ratio is distributed as chi-square; 1.6 is exceeded by chance once in 1000 times.
    """
    views = gallery(GAPS_M, VIEWS)
    seen = ratios("stands, 0.4 px", (stand(v, views.target, i, 0.4) for i, v in enumerate(views.views)))
    assert (seen < 1.6).all()


def test_standing_at_a_blur_of_one_pixel(gallery: Callable[..., Any]) -> None:
    """The other side: the same frames blurred by 1 px, where the corners of all frames err alike.

    The filter takes each frame for new information, so that its standard deviation falls and the error stays:
    y and yaw are optimistic. Measured: 0.89, 2.37 and 2.29; chance leaves 1.1 .. 3.8 once in 500 times.
    """
    views = gallery(GAPS_M, VIEWS)
    seen = ratios("stands, 1 px", (stand(v, views.target, i, 1.0) for i, v in enumerate(views.views)))
    assert (seen < 3.8).all()
    assert (seen[1:] > 1.1).all()


@pytest.mark.nightly
@pytest.mark.timeout(600)
@pytest.mark.parametrize("blur_px", [0.4, 1.0])
def test_on_the_way(blur_px: float, shipped: Callable[..., Scene]) -> None:
    """20 approaches: at 0.6, 0.4 and 0.2 m every ratio is below 1.6."""
    at: dict[tuple[float, float], list[Sample]] = {span: [] for span in WAYPOINTS_M}
    for seed in SEEDS:
        for gap, values in approach(shipped("close_range", {"cameras.onboard.blur_px": str(blur_px)}), seed):
            for near, far in WAYPOINTS_M:
                if near <= gap < far:
                    at[near, far].append(values)
    for (near, far), samples in at.items():
        assert len(samples) > 20 * len(SEEDS)
        assert (ratios(f"on the way, {blur_px:g} px, {near:g} .. {far:g} m", samples) < 1.6).all()


def approach(scene: Scene, seed: int) -> list[tuple[float, Sample]]:
    """Run a trial; return the true gap [m] and the sample of each of its estimates."""
    recorder, step = MemoryRecorder(), scene.plan[0]
    Trial(scene, seed, recorder=recorder).run()
    target = TargetModel.from_scene(scene, step)
    X_target_D = scene.geometry(step.target_unit).dock_frame(step.target_port)
    truth = {(m.name, ns): m.X_WB for _, ns, m in recorder.messages if isinstance(m, TruePose)}
    samples = []
    for _, ns, m in recorder.messages:
        if isinstance(m, PoseEstimate):
            X_DU = (truth[step.target_unit, ns] @ X_target_D).inverse() @ truth[step.unit, ns]
            samples.append((-X_DU.x - target.front, sample(m, X_DU)))
    return samples
