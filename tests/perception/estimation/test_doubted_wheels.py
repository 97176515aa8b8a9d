"""Wheels that turn otherwise than their encoders tell: images that do not agree with them prevail."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from msrr_perception.estimation.corner_filter import CornerEkf
from msrr_perception.estimation.wheel_doubt import doubts_wheels
from msrr_perception.motion.filter_state import FilterState
from msrr_perception.pose.target import TargetModel
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.loading.load import load_scene
from msrr_scenes.messages import NS_PER_S, Detections, Exposure, PoseMeasurement, WheelOdometry
from msrr_scenes.specs.scene import Scene
from tests.conftest import not_none
from tests.perception.conftest import Drive

#: Ticks of 10 ms: the encoders fail after the first, and are as they were before from the second on.
FAILS, MENDED, END = 100, 250, 400

Failure = Callable[[WheelOdometry, WheelOdometry], WheelOdometry]

#: What failing encoders say, by what they should say and what they said last before; and largest error of the
#: place [m]. Where both stand, a unit that drives straight on looks like one that stands, with a wrong lens.
FAILURES: dict[str, tuple[Failure, float]] = {
    "left stands": (lambda r, held: replace(r, left=held.left), 0.01),
    "right stands": (lambda r, held: replace(r, right=held.right), 0.01),
    "left is backwards": (lambda r, held: replace(r, left=2.0 * held.left - r.left), 0.01),
    "both stand": (lambda r, held: replace(r, left=held.left, right=held.right), 0.03),
}


@pytest.fixture(scope="module")
def careful() -> Scene:
    return load_scene("close_range", {"as_built": "careful"}).told()


@pytest.mark.parametrize("name", FAILURES)
@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.nightly) for seed in (1, 2))])
def test_images_prevail_over_encoders_that_fail(careful: Scene, name: str, seed: int) -> None:
    """From half a second after they have failed, the pose at an exposure is that which images show.

    The target is as designed, and corners have errors of 0.3 px. Where the wheels are believed, headings are
    off by 0.17 to 0.35 rad, or a third of the images is not used.
    """
    target = TargetModel.from_scene(careful, careful.docks[0])
    ekf = CornerEkf(target, careful.odometry, corner_sigma_px=0.3)
    drive = Drive(target, seed, SE2(-0.75, 0.05, 0.1), tags=target.port_tags)
    failure, largest = FAILURES[name]
    held, offset, errors, used = None, np.zeros(2), list[np.ndarray](), 0
    while drive.tick < END:
        true, picture = drive.step()
        held = not_none(true if drive.tick <= FAILS else held)
        told = true
        if FAILS < drive.tick <= MENDED:
            told = failure(true, held)
            offset = np.array([told.left - true.left, told.right - true.right])
        elif drive.tick > MENDED:  # an incremental encoder does not catch up on what it has missed
            told = replace(true, left=true.left + float(offset[0]), right=true.right + float(offset[1]))
        ekf.add_odometry(told)
        if picture is None:
            continue
        ekf.add_detections(picture)
        found = ekf.predict(drive.now_ns)
        if drive.tick > FAILS + 50:
            assert found is not None
            used += found.last_seen_ns == drive.now_ns
            errors.append(found.X_DU.as_array() - drive.X_DU.as_array())
    off = np.abs(errors)
    assert off[:, :2].max() < largest
    assert off[:, 2].max() < math.radians(2.0)
    assert used > 0.9 * len(errors)


def test_images_prevail_where_one_of_three_agrees_with_a_failed_encoder(careful: Scene) -> None:
    """A unit backs out of its port, and reads one window of each image: the next one each time.

    Its left encoder stands. The filter took that for a turn, with which one tag of one window agreed, and was
    off by 27 mm when the unit stood still again.
    """
    target = TargetModel.from_scene(careful, careful.docks[0])
    ekf = CornerEkf(target, careful.odometry, corner_sigma_px=0.3)
    drive = Drive(target, 0, SE2(-0.11, 0.0, 0.0), tags=tuple(target.corners_D))
    windows, held, images = ((13,), (11, 16), (12,)), None, 0
    drive.speed = lambda _: (-0.05 if 51 < drive.tick <= 111 else 0.0, 0.0)
    while drive.tick < 200:
        reading, picture = drive.step()
        held = not_none(reading if drive.tick <= 50 else held)
        ekf.add_odometry(replace(reading, left=held.left))
        if picture is not None:
            images += 1
            tags = (tag for tag in picture.tags if tag.tag_id in windows[images % 3])
            ekf.add_detections(picture if images == 1 else replace(picture, tags=tuple(tags)))
    found = not_none(ekf.estimate(drive.now_ns))
    assert found.X_DU.x == pytest.approx(drive.X_DU.x, abs=0.003)
    assert found.X_DU.yaw == pytest.approx(drive.X_DU.yaw, abs=math.radians(1.0))


def test_wheels_that_slip_as_assumed_are_not_doubted(careful: Scene) -> None:
    """Over 5 drives with 0.3 px corners and radii that are off by 1 %, no image is used without the wheels.

    At a gate of 0.9999 per tag three images in a row are outside it by chance once in 1e11 drives.
    """
    target = TargetModel.from_scene(careful, careful.docks[0])
    for seed in range(5):
        ekf = CornerEkf(target, careful.odometry, corner_sigma_px=0.3)
        drive = Drive(target, seed, SE2(-0.75, 0.05, 0.1), tags=target.port_tags, scale_error=0.01)
        while drive.tick < END:
            reading, picture = drive.step()
            ekf.add_odometry(reading)
            if picture is not None:
                ekf.add_detections(picture)
        assert (ekf.exposures.without_wheels, ekf.exposures.rejected) == (0, 0)
        assert ekf.exposures.used == ekf.exposures.total > 20


def test_wheels_are_doubted_for_a_second_after_they_last_disagreed() -> None:
    """From the third measurement in a row on; an image ends it that comes more than 0.25 s after the last."""
    exposure = Exposure("a/onboard", 0, 0)
    pose, picture = PoseMeasurement(exposure, SE2(), np.eye(3), (None, None)), Detections(exposure, (), ())
    trusted = FilterState(2 * NS_PER_S, np.zeros(8), np.eye(8), None, last_seen_ns=0)
    assert [doubts_wheels(trusted, pose, k) for k in (0, 1, 2, 3, 4)] == [False, False, False, True, True]
    for since_ns, doubts in ((0, True), (NS_PER_S, True), (NS_PER_S + 1, False)):
        doubted = trusted._replace(wheels_doubted_ns=trusted.stamp_ns - since_ns)
        assert doubts_wheels(doubted, pose, 0) == doubts
    for since_ns, doubts in ((NS_PER_S // 4, True), (NS_PER_S // 4 + 1, False)):
        seen = trusted._replace(last_seen_ns=trusted.stamp_ns - since_ns)
        assert doubts_wheels(seen, picture, 3) == doubts
