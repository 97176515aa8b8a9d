"""What a unit takes in of the overhead camera: from whom, how new it is, and of which bodies it tells."""

from __future__ import annotations

import numpy as np
import pytest

from msrr_bullet.robot.overhead_localizer import OverheadLocalizer, OverheadReader
from msrr_control.shapes.bodies import ACTIVE_PORT
from msrr_perception.detection.detector import PupilDetector
from msrr_perception.pose.overhead_model import OverheadModel
from msrr_perception.pose.target import TargetModel
from msrr_perception.tracking.seen_pose import SeenPose, SeenPoses
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import (
    OVERHEAD,
    Detections,
    Exposure,
    GlobalPose,
    Localisation,
    Pixels,
    SeatSwitches,
    SensorMessage,
    TagDetection,
    WheelOdometry,
)
from msrr_scenes.specs.scene import Scene
from tests.conftest import not_none, pose_error

POSES = {"a": SE2(-0.5, 0.1, 0.3), "b": SE2(0.6, 0.0, -1.0), "c": SE2(0.0, 1.0, 2.0)}


@pytest.fixture(scope="module")
def scene() -> Scene:
    return Scene.model_validate(
        {
            "name": "arena",
            "units": {"a": {"number": 0}, "b": {"number": 1}, "c": {"number": 2}},
            "cameras": {"overhead": {}},
            "plan": [{"unit": "a", "to": "b.rear"}],
        }
    )


@pytest.fixture
def localizer(scene: Scene) -> OverheadLocalizer:
    return OverheadLocalizer(scene, "a", TargetModel.without_target(scene, "a", ACTIVE_PORT))


def _pose(name: str, stamp_ns: int) -> GlobalPose:
    return GlobalPose(name, stamp_ns, POSES[name], 1e-6 * np.eye(3))


def _empty(camera: str, stamp_ns: int) -> Detections:
    return Detections(Exposure(camera, 0, stamp_ns), (), ())


def test_the_newest_exposure_is_told_whatever_the_order_of_arrival(localizer: OverheadLocalizer) -> None:
    messages: list[tuple[SensorMessage, int | None]] = [
        (WheelOdometry("a", 90, 0.0, 0.0), None),
        (_empty("a/onboard", 95), None),
        (SeatSwitches("a", 96, left=False, right=False), None),
        (_empty(OVERHEAD, 30), 30),
        (_empty(OVERHEAD, 20), 30),
        (Localisation(_empty(OVERHEAD, 40)), 40),
        (Localisation(_empty(OVERHEAD, 35)), 40),
        (_pose("b", 50), 50),
        (_pose("c", 45), 50),
    ]
    assert localizer.newest_ns is None
    for message, newest_ns in messages:
        localizer.receive(message)
        assert localizer.newest_ns == newest_ns
    for stamp_ns, newest_ns in ((49, 50), (60, 60)):
        localizer.see(SeenPoses(stamp_ns, ()))
        assert localizer.newest_ns == newest_ns


def test_what_a_base_station_has_read_is_as_good_as_a_first_message(localizer: OverheadLocalizer) -> None:
    localizer.see(SeenPoses(7, (SeenPose(_pose("a", 7), np.zeros((3, 3))),)))
    assert localizer.newest_ns == 7
    arena = not_none(localizer.estimate(7, None))
    assert (arena.own.X_WB, arena.target, arena.others) == (POSES["a"], None, ())


def test_another_target_is_another_one_of_the_bodies_that_are_known(
    scene: Scene, localizer: OverheadLocalizer
) -> None:
    """Nothing that was seen is forgotten, and without its target a unit has no estimate."""
    (step,) = scene.docks
    localizer.receive(_pose("a", 0))
    for aim, knows in ((None, True), (step, False), (None, True)):
        localizer.aim(aim)
        assert (localizer.estimate(1, None) is not None) is knows
    localizer.receive(_pose("b", 0))
    localizer.receive(_pose("c", 0))
    for aim, target, others in ((step, "b", ["c"]), (None, None, ["b", "c"])):
        localizer.aim(aim)
        arena = not_none(localizer.estimate(1, None))
        assert (None if arena.target is None else arena.target.name) == target
        assert sorted(body.name for body in arena.others) == others
        assert (arena.own.name, arena.own.X_WB) == ("a", POSES["a"])


@pytest.mark.parametrize("service", [False, True])
def test_tags_and_wheels_tell_where_a_unit_is(
    scene: Scene, localizer: OverheadLocalizer, service: bool
) -> None:
    """Its tag as the overhead camera or a service of localisation shows it, and 5 cm straight on."""
    model = OverheadModel.from_scene(scene, ("a",))
    pixels = model.localizer().pixels(model.tags[model.tag_of["a"]], POSES["a"])
    detections = Detections(Exposure(OVERHEAD, 0, 0), (TagDetection(model.tag_of["a"], pixels),), ())
    localizer.receive(WheelOdometry("a", 0, 0.0, 0.0))
    localizer.receive(Localisation(detections) if service else detections)
    angle = 0.05 / scene.geometry("a").wheel_radius
    localizer.receive(WheelOdometry("a", 200_000_000, angle, angle))
    for now_ns, way in ((0, 0.0), (200_000_000, 0.05)):
        arena = not_none(localizer.estimate(now_ns, None))
        assert pose_error(arena.own.X_WB, POSES["a"] @ SE2(way)) == pytest.approx(np.zeros(3), abs=1e-3)


def test_a_unit_on_its_own_reckons_anew_where_its_target_stands_whenever_it_asks(scene: Scene) -> None:
    """One of a mission, in which many bodies stand, every tenth of a second; both aim from the start."""
    (step,) = scene.docks
    drive = TargetModel.from_scene(scene, step)
    alone = OverheadReader(scene, step, drive, PupilDetector())
    for localizer, told_ms in ((alone, 250), (OverheadLocalizer(scene, "a", drive, step), 200)):
        localizer.receive(_pose("a", 0))
        assert localizer.estimate(1, None) is None, "it has not seen its target"
        localizer.receive(_pose("b", 0))
        arena = not_none(localizer.estimate(250_000_000, None))
        assert arena.target is not None
        assert arena.target.stamp_ns == told_ms * 1_000_000


def test_surroundings_are_checked_a_second_after_they_were_seen(scene: Scene) -> None:
    (step,) = scene.docks
    drive = TargetModel.from_scene(scene, step)
    reader = OverheadReader(scene, step, drive, PupilDetector())

    def due_ns() -> int:
        due = [k for k in range(0, 4000, 100) if reader.check_is_due(k * 1_000_000)]
        assert not reader.check_is_due(due[0] * 1_000_000 - 1)
        return due[0]

    assert due_ns() == 1000
    for stamp_ms, due_ms in ((500, 1500), (300, 1500), (700, 1700)):
        reader.receive(_pose("b", stamp_ms * 1_000_000))
        assert due_ns() == due_ms
    reader.receive(WheelOdometry("a", 900_000_000, 0.0, 0.0))
    reader.receive(_empty(OVERHEAD, 900_000_000))  # it was read already: that was the check
    assert due_ns() == 1700
    assert scene.cameras.overhead is not None
    frame = scene.cameras.overhead.pinhole.frame
    blank = np.full((frame.height, frame.width), 120, dtype=np.uint8)

    def fetch(window: Window) -> Pixels:
        return blank[window.y : window.y + window.height, window.x : window.x + window.width]

    reader.check(Exposure(OVERHEAD, 0, 800_000_000), SE2(), fetch)
    assert due_ns() == 1800
    reader.detect(Exposure(OVERHEAD, 1, 1_000_000_000), fetch)
    assert due_ns() == 2000
