"""Windows, search and recovery of the overhead localisation, on rendered images."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pytest

from msrr_bullet.robot.overhead_localizer import NEAR_HALF_M, OverheadLocalizer, OverheadReader
from msrr_perception.detection.detector import PupilDetector
from msrr_perception.pose.overhead_model import OverheadModel
from msrr_perception.pose.target import TargetModel
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import (
    NS_PER_S,
    ArenaEstimate,
    Detections,
    Exposure,
    Fetch,
    GlobalPose,
    ObstacleEstimate,
    Twist,
    WheelOdometry,
)
from tests.conftest import not_none

FULL = 1280 * 960
POST = {"shape": "cylinder", "radius_m": 0.06, "height_m": 0.2, "tag_id": 500}


def curve(t: float, known: ArenaEstimate | None) -> Twist:
    return Twist(0.22, 0.5 * math.sin(t))


def error(pose: GlobalPose | ObstacleEstimate, true: SE2) -> np.ndarray:
    e = pose.X_WB.as_array() - true.as_array()
    e[2] = math.remainder(e[2], 2.0 * math.pi)
    return e


def ids(look: Detections) -> list[int]:
    return [t.tag_id for t in look.tags]


def test_a_drive_is_localised_from_few_pixels(open_arena: Callable) -> None:
    """All bodies are found in the first frame; then a full frame per second and small windows suffice."""
    arena = open_arena(plant="bullet", start=SE2(-1.2, -0.5, 0.3))
    arena.law = curve
    squares: list[float] = []
    errors: list[np.ndarray] = []

    def watch() -> None:
        if arena.now_s > 1.0:
            own = arena.known.own
            e = error(own, arena.plant.pose("a"))
            errors.append(e)
            squares.append(float(e @ np.linalg.solve(own.covariance, e)))

    arena.run(5.0, watch)
    assert ids(arena.looks[0]) == [0, 10, 500]
    assert all(0 in ids(look) for look in arena.looks)
    pixels = arena.pixels(arena.looks)
    whole = [p for p in pixels if p >= FULL]
    assert len(whole) == 1, "nothing is searched for while every tag is read where it is expected"
    assert max(p for p in pixels if p < FULL) < 50_000
    assert np.median(pixels) < 12_000
    frame = arena.camera.pinhole.frame
    for window in (w for look in arena.looks for w in look.windows):
        assert frame.contains(window)
        assert window.x % 4 == window.y % 4 == 0
    rms = np.sqrt(np.mean(np.square(errors), axis=0))
    assert rms[:2].max() < 0.0008
    assert rms[2] < math.radians(0.15)
    # Consecutive errors are not independent, so this is a bound on overconfidence, not a chi-square test.
    assert np.mean(squares) < 3.0
    known = not_none(arena.known)
    assert np.abs(error(known.target, arena.plant.pose("b"))[:2]).max() < 0.001
    assert np.abs(error(known.obstacles[0], SE2(0.1, 0.3))[:2]).max() < 0.001


def test_an_obstacle_that_appears_is_found_within_a_second(open_arena: Callable) -> None:
    late = {**POST, "appears_at_s": 1.25, "pose": {"x_m": 0.4, "y_m": -0.7, "yaw_deg": 50}}
    arena = open_arena(obstacles={"late": late})
    arena.run(1.25)
    assert arena.known is not None
    assert arena.known.obstacles == ()
    # A second for the search, a tenth until the next frame, and the latency.
    arena.run(1.25 + 1.0 + 0.1 + 0.06 + 0.02)
    assert [o.name for o in arena.known.obstacles] == ["late"]
    found = arena.known.obstacles[0]
    assert found.radius == pytest.approx(0.06)
    assert found.X_WB.x == pytest.approx(0.4, abs=1e-3)
    # From then on the obstacle has its own window.
    assert 500 in ids(arena.looks[-1]) or 500 in ids(arena.looks[-2])


def test_a_unit_that_is_moved_by_hand_is_found_again(open_arena: Callable) -> None:
    arena = open_arena()
    arena.run(1.0)
    arena.plant._poses["a"] = SE2(0.3, -0.9, 2.0)
    arena.run(2.2)
    assert arena.known is not None
    assert np.abs(error(arena.known.own, SE2(0.3, -0.9, 2.0))[:2]).max() < 0.002


def test_out_of_view_the_odometry_goes_on_and_the_search_stays_cheap(open_arena: Callable) -> None:
    """The unit leaves the image to the left and backs in again."""
    arena = open_arena(start=SE2(-1.65, 0.0, math.pi))
    arena.law = lambda t, known: Twist(0.22 if t < 1.5 else -0.22)
    arena.run(2.0)
    without_unit = [look for look in arena.looks if 0 not in ids(look)]
    assert len(without_unit) >= 5
    assert arena.known is not None
    out = np.hypot(*error(arena.known.own, arena.plant.pose("a"))[:2])
    assert out < 0.03
    seconds = 1e-9 * (without_unit[-1].exposure.stamp_ns - without_unit[0].exposure.stamp_ns)
    assert sum(arena.pixels(without_unit)) < FULL * (2.0 + seconds / 0.3)
    arena.run(4.0)
    assert np.hypot(*error(arena.known.own, arena.plant.pose("a"))[:2]) < 0.002


def test_a_biased_localisation_loses_no_tag(open_arena: Callable) -> None:
    """Poses have errors of 3 cm, 2 deg and noise; the windows follow the tag in the image."""
    wrong = {"bias_x_m": 0.03, "bias_yaw_deg": 2.0, "noise_m": 0.005, "noise_yaw_deg": 0.5, "dropout": 0.2}
    arena = open_arena(overhead={"localisation": wrong}, start=SE2(-1.2, -0.5, 0.3))
    arena.law = curve
    arena.run(4.0)
    assert all(0 in ids(look) for look in arena.looks)
    assert sum(p >= FULL for p in arena.pixels(arena.looks)) <= 6
    known = not_none(arena.known)
    off = error(known.own, arena.plant.pose("a"))
    np.testing.assert_allclose(off[:2], [0.03, 0.0], atol=0.02)  # the odometry contradicts the yaw
    assert np.hypot(*error(known.target, arena.plant.pose("b"))[:2]) < 0.006


def test_lost_frames_are_bridged(open_arena: Callable) -> None:
    arena = open_arena(overhead={"dropout": 0.4, "noise_grey": 6.0, "blur_px": 0.8}, seed=3)
    arena.law = curve
    worst = 0.0

    def watch() -> None:
        nonlocal worst
        if arena.now_s > 1.0:
            worst = max(worst, float(np.hypot(*error(arena.known.own, arena.plant.pose("a"))[:2])))

    arena.run(4.0, watch)
    assert len(arena.looks) < 35
    assert 0.0 < worst < 0.006


def test_detection_near_a_place_finds_what_is_near_and_changes_no_later_detection(
    open_arena: Callable,
) -> None:
    arenas = [open_arena(plant="bullet") for _ in range(2)]
    for arena in arenas:
        arena.run(1.05)
    checked = arenas[0]
    exposure = checked.looks[-1].exposure
    known = checked.estimator.predict(exposure.stamp_ns)
    detected = {}
    for name, middle, others in (
        ("near", SE2(0.3, 0.4), ()),
        ("far", SE2(-0.6, 0.3), ()),
        ("far, and others", SE2(-0.6, 0.3), ("b", "post")),
        ("outside", SE2(9.0, 9.0), ()),
    ):
        predictions = {body: known[body] for body in others}
        look = checked.vision.detect_near(
            exposure, middle.translation, NEAR_HALF_M, checked.camera.fetch, predictions
        )
        detected[name] = ids(look)
        assert sum(w.area for w in look.windows) < FULL / 6
    # No unit is near one of the places, and the post is near the first.
    assert detected == {"near": [500], "far": [], "far, and others": [10, 500], "outside": []}
    for arena in arenas:
        arena.run(1.5)
    for one, other in zip(*(a.looks for a in arenas), strict=True):
        assert one.windows == other.windows
        for tag, same in zip(one.tags, other.tags, strict=True):
            np.testing.assert_array_equal(tag.corners, same.corners)


@pytest.mark.parametrize("twist", [Twist(0.1), Twist(0.0, 0.5)], ids=["ahead", "on the spot"])
def test_a_parked_unit_is_read_in_every_fourth_frame_and_one_that_drives_in_each(
    open_arena: Callable, twist: Twist
) -> None:
    arena = open_arena(others={"c": SE2(-0.2, -0.8, 0.4)})
    arena.drivers = {"c": lambda t: twist if 1.85 <= t < 3.0 else Twist()}
    arena.run(4.6)

    def frames_with_c(start_s: float, end_s: float) -> list[bool]:
        within = (look for look in arena.looks if start_s <= 1e-9 * look.exposure.stamp_ns < end_s)
        return [20 in ids(look) for look in within if sum(w.area for w in look.windows) < FULL]

    assert sum(frames_with_c(0.95, 1.85)) <= 3
    assert all(frames_with_c(2.25, 3.0))
    assert sum(frames_with_c(3.75, 4.55)) <= 3
    off = error(arena.known.others[0], arena.plant.pose("c"))
    assert np.abs(off[:2]).max() < 1e-4


@dataclass
class _Docking:
    """Stands for vision and estimator of an arena: the reader of a unit that checks from some time on."""

    reader: OverheadReader
    model: OverheadModel
    checks_from_ns: int
    checks: dict[float, list[int]] = field(default_factory=dict)  # time [s] -> ids of the tags read

    def detect(self, exposure: Exposure, predictions: object, fetch: Fetch) -> Detections:
        if exposure.stamp_ns < self.checks_from_ns:
            return self.reader.detect(exposure, fetch)
        if not self.reader.check_is_due(exposure.stamp_ns):
            return Detections(exposure, (), ())
        found = self.reader.check(exposure, SE2(-1.0, -0.5), fetch)
        self.checks[1e-9 * exposure.stamp_ns] = ids(found)
        return found

    def predict(self, stamp_ns: int) -> dict[str, GlobalPose]:
        return {}

    def estimate(self, now_ns: int) -> ArenaEstimate | None:
        return self.reader.estimate(now_ns, None)

    def add_odometry(self, reading: WheelOdometry) -> None:
        self.reader.receive(reading)

    def add_detections(self, detections: Detections) -> None:
        if detections.windows:
            self.reader.receive(detections)


@pytest.mark.parametrize("corrects", [True, False], ids=["corrected", "by its own camera alone"])
def test_checks_show_a_unit_that_drives_in_every_frame_until_it_is_seen_to_stand(
    open_arena: Callable, corrects: bool
) -> None:
    """Of one that drives and is not seen, soon nothing is known: it would hold a unit that docks.

    Once a second the pair is read as well, where that corrects what the onboard camera tells of it.
    """
    arena = open_arena(others={"c": SE2(-0.2, -0.8, 0.4)})
    arena.drivers = {"c": lambda t: Twist(0.1, 0.2) if 0.7 <= t < 2.0 else Twist()}
    control = arena.scene.control.model_copy(update={"overhead_correction": corrects})
    scene = arena.scene.model_copy(update={"control": control})
    step = scene.docks[0]
    reader = OverheadReader(scene, step, TargetModel.from_scene(scene, step), PupilDetector())
    arena.vision = arena.estimator = docking = _Docking(
        reader, arena.vision.model, checks_from_ns=1_050_000_000
    )
    worst = 0.0

    def watch() -> None:
        nonlocal worst
        if arena.now_s > 0.5:
            worst = max(worst, float(np.abs(error(arena.known.others[0], arena.plant.pose("c"))[:2]).max()))

    arena.run(5.0, watch)
    assert worst < 0.02
    driving = [found for t, found in docking.checks.items() if t < 2.0]
    assert len(driving) == 9
    assert all(20 in found for found in driving)
    assert [found for t, found in docking.checks.items() if t > 2.9] == 2 * [[0, 10] if corrects else []]
    known = not_none(arena.known)
    assert math.sqrt(known.others[0].covariance[2, 2]) < math.radians(0.5)


def test_a_target_may_be_pushed_while_another_unit_moves_beside_it(shipped: Callable) -> None:
    scene = shipped("bystander", {"as_built": "perfect"}).told()
    step = scene.docks[0]
    localizer = OverheadLocalizer(scene, step.unit, TargetModel.from_scene(scene, step), step)
    pushed = []
    for frame in range(100):
        stamp_ns = frame * NS_PER_S // 10
        way = 0.01 * min(max(frame - 30, 0), 48)  # from 0.7 m to 0.22 m, where it stops
        for name, X_WB in ((step.target_unit, SE2()), ("c", SE2(0.0, 0.7 - way, -1.57))):
            localizer.receive(GlobalPose(name, stamp_ns, X_WB, np.diag([1e-7, 1e-7, 1e-6])))
        pushed.append(localizer.target_may_be_pushed())
    assert not any(pushed[25:74])
    assert all(pushed[76:79])
    assert not any(pushed[88:])
    localizer.aim(None)
    assert not localizer.target_may_be_pushed()
