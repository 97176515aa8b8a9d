"""Whatever the readings of the encoders say, the corner filter has estimates that can be reckoned with."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from msrr_perception.estimation.corner_filter import CornerEkf
from msrr_perception.pose.target import TargetModel
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.loading.load import load_scene
from msrr_scenes.messages import WheelOdometry
from tests.perception.conftest import Drive

TICKS = 160

#: Seeds of drives in degrees, with jumps of up to 1e12 rad, and with steps of 3 rad. The least squares of the
#: filter failed in those of the first two lines, and covariances became negative in those of the last two.
#: One of each way of failing and each kind of reading (the seed modulo 3) at least is in the quick tier.
SEEDS = (6, 10, 2)
MORE_OF_THEM = (33, 39, 16, 19, 8, 14)
NEGATIVE = (157, 278)
MORE_NEGATIVE = (553, 1298, 1300)


def _misread(
    reading: WheelOdometry, kind: int, offset: np.ndarray, rng: np.random.Generator
) -> WheelOdometry:
    """Return a reading as it should not be; ``offset`` is what it was off by until now."""
    if kind == 0:
        return replace(reading, left=57.3 * reading.left, right=57.3 * reading.right)
    if kind == 2:
        offset += rng.normal(0.0, 3.0, 2)
    elif rng.random() < 0.05:
        offset += rng.normal(size=2) * 10.0 ** rng.integers(0, 13)
    return replace(reading, left=reading.left + float(offset[0]), right=reading.right + float(offset[1]))


@pytest.mark.parametrize(
    "seed",
    [
        *(SEEDS + NEGATIVE),
        *(pytest.param(seed, marks=pytest.mark.nightly) for seed in MORE_OF_THEM + MORE_NEGATIVE),
    ],
)
def test_wild_wheels_leave_estimates_finite_and_covariances_positive(seed: int) -> None:
    scene = load_scene("close_range", {"as_built": "careful"})
    target = TargetModel.from_scene(scene.told(), scene.docks[0])
    ekf, rng, offset = CornerEkf(target, scene.odometry), np.random.default_rng([seed, 1]), np.zeros(2)
    start = SE2(-rng.uniform(0.15, 1.2), rng.normal(0.0, 0.1), rng.normal(0.0, 0.3))
    drive = Drive(target, seed, start, tags=target.tags)
    estimates = 0
    for _ in range(TICKS):
        reading, picture = drive.step()
        ekf.add_odometry(_misread(reading, seed % 3, offset, rng))
        if picture is not None:
            ekf.add_detections(picture)
        found, learned = ekf.estimate(drive.now_ns), ekf.learned(seated=False)
        if found is None or learned is None:
            continue
        estimates += 1
        assert np.isfinite(found.X_DU.as_array()).all()
        variances = np.linalg.eigvalsh(found.covariance)
        assert variances[0] > -1e-9 * variances[-1]
        assert (np.diag(learned.covariance) > 0.0).all()
    assert estimates > TICKS // 2
