"""The sensors of a docking unit in a running simulation: rates, latencies, faults, unused cameras."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest

from msrr_bullet.profiler import NullProfiler
from msrr_bullet.sensors.sensor_suite import MountedCamera, SensorSuite
from msrr_bullet.trial.environment import Environment, open_environment
from msrr_perception.detection.detector import PupilDetector
from msrr_scenes.messages import (
    Detections,
    Exposure,
    Fetch,
    LockFeedback,
    LockPosition,
    PoseMeasurement,
    SeatSwitches,
    SensorMessage,
    TagDetection,
    Twist,
    WheelOdometry,
)
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.sensors import CameraSpec


class Listener:
    """A robot that keeps what it receives, and when; it detects all tags in the full frame."""

    def __init__(self, scene: Scene, *, uses: bool = True) -> None:
        self.messages: list[tuple[int, SensorMessage]] = []
        self.exposures: list[Exposure] = []
        self.now_ns = 0
        self._frame = scene.cameras.onboard.pinhole.frame
        self._uses = uses

    def uses_camera(self, camera: str) -> bool:
        return self._uses

    def expose(self, exposure: Exposure, fetch: Fetch) -> Detections:
        self.exposures.append(exposure)
        tags = PupilDetector().detect(fetch(self._frame), self._frame)
        return Detections(exposure, tags, (self._frame,))

    def receive(self, message: SensorMessage) -> None:
        self.messages.append((self.now_ns, message))

    def of(self, kind: type) -> list[tuple[int, Any]]:
        return [(now_ns, m) for now_ns, m in self.messages if isinstance(m, kind)]


def scene(**keys: Any) -> Scene:
    return Scene.model_validate(
        {
            "name": "sensed",
            "plant": "unicycle",
            "perception": "parametric",
            "units": {
                "b": {"number": 1, "pose": {"x_m": 0.4}},
                "a": {"number": 0, "pose": {"frame": "b.rear", "x_m": -0.3}},
            },
            "plan": [{"unit": "a", "to": "b.rear"}],
            **keys,
        }
    )


class Frames:
    """A camera of which each frame shows the same tags, and is under way for a time of its own."""

    def __init__(self, name: str, tags: Collection[int] = (), latencies_ms: Iterable[int] = ()) -> None:
        self.name, self.spec, self.frames = name, CameraSpec(rate_hz=25.0), self
        self._tags = tuple(TagDetection(tag, np.zeros((4, 2))) for tag in tags)
        self._latencies_ms, self._frame = iter(latencies_ms), 0

    def capture(self, now_ns: int, reader: object) -> tuple[SensorMessage, ...]:
        self._frame += 1
        return (Detections(Exposure(self.name, self._frame, now_ns), self._tags, ()),)

    def next_latency_ns(self) -> int:
        return 1_000_000 * next(self._latencies_ms, 0)


@contextmanager
def suite(of: Scene) -> Iterator[tuple[Environment, SensorSuite]]:
    with open_environment(of, 3) as environment:
        step, plant = of.plan[0], environment.simulation.plant
        plant.begin_dock(step)
        X_WD = plant.pose("b") @ of.geometry("b").dock_frame("rear")
        cameras = environment.devices.cameras(step, lambda: X_WD.inverse() @ plant.pose("a"), NullProfiler())
        encoders = environment.devices.encoders["a"]
        yield environment, SensorSuite(of, step.unit, step, plant, encoders, cameras, NullProfiler())


def run(environment: Environment, sensors: SensorSuite, robot: Listener, time_s: float) -> None:
    plant = environment.simulation.plant
    end_ns = plant.now_ns() + round(1e9 * time_s)
    while plant.now_ns() < end_ns:
        robot.now_ns = plant.now_ns()
        sensors.tick(robot.now_ns, robot)
        plant.step()


@pytest.mark.parametrize("latency_ms", [0.0, 35.0, 90.0])
def test_measurements_arrive_at_their_rate_after_the_latency(latency_ms: float) -> None:
    of = scene(cameras={"onboard": {"latency_ms": latency_ms, "rate_hz": 25.0}}, odometry={"rate_hz": 60.0})
    robot, tick_ns = Listener(of), 1e9 / of.physics_hz
    with suite(of) as (environment, sensors):
        run(environment, sensors, robot, 1.0)
    assert len(robot.of(WheelOdometry)) == 60
    measurements = robot.of(PoseMeasurement)
    assert len(measurements) == pytest.approx(25 - 0.025 * latency_ms, abs=1)
    for arrival_ns, message in measurements:
        assert 0.0 <= arrival_ns - message.exposure.stamp_ns - 1e6 * latency_ms < tick_ns + 1
    stamps = np.array([message.exposure.stamp_ns for _, message in measurements])
    np.testing.assert_allclose(np.diff(stamps), 40_000_000, atol=tick_ns + 1)


def test_a_camera_that_the_robot_does_not_use_exposes_no_frame() -> None:
    of = scene()
    with suite(of) as (environment, sensors):
        unused, used = Listener(of, uses=False), Listener(of)
        run(environment, sensors, unused, 0.5)
        assert unused.of(PoseMeasurement) == []
        assert not sensors.ever_detected
        run(environment, sensors, used, 0.5)
        assert used.of(PoseMeasurement)[0][1].exposure.frame == 0
        assert sensors.ever_detected


def test_switches_and_lock_report_changes_only() -> None:
    of = scene(lock={"close_time_s": 0.3})
    robot = Listener(of)
    with suite(of) as (environment, sensors):
        run(environment, sensors, robot, 0.2)
        environment.simulation.plant.set_lock("a", True)
        run(environment, sensors, robot, 0.8)
    assert [message for _, message in robot.of(SeatSwitches)] == [SeatSwitches("a", 0, False, False)]
    assert all((m.unit, m.stamp_ns) == ("a", now_ns) for now_ns, m in robot.of(LockFeedback))
    positions = [m.position for _, m in robot.of(LockFeedback)]
    assert positions == [LockPosition.OPEN, LockPosition.CLOSING, LockPosition.CLOSED]


@pytest.mark.parametrize("value", ["open", "closed"])
def test_a_stuck_seat_switch_hides_the_true_state(value: str) -> None:
    """That of the target; the unit reads no switch of its own ports."""
    own = {"open": "closed", "closed": "open"}[value]
    faults = [{"kind": "seat_switch_stuck", "unit": u, "value": v} for u, v in (("b", value), ("a", own))]
    of = scene(faults=faults)
    robot = Listener(of)
    with suite(of) as (environment, sensors):
        run(environment, sensors, robot, 0.2)
        assert environment.simulation.plant.switches("a") == (False, False)
    stuck = value == "closed"
    assert [(m.left, m.right) for _, m in robot.of(SeatSwitches)] == [(stuck, stuck)]


@pytest.mark.parametrize("hidden", [False, True])
def test_only_tags_of_the_target_count_as_detected(hidden: bool) -> None:
    """Rendered images of two units, of which the target may have blank plates."""
    of = scene(
        perception="images",
        units={
            "b": {"number": 1, "pose": {"x_m": 0.4}},
            "a": {"number": 0, "pose": {"frame": "b.rear", "x_m": -0.4}},
            "c": {"number": 2, "pose": {"x_m": 0.9, "y_m": 0.25}},
        },
        cameras={"onboard": {"renderer": "raster", "samples": 1, "latency_ms": 20.0}},
        faults=[{"kind": "marker_hidden", "unit": "b"}] if hidden else [],
    )
    robot = Listener(of)
    with suite(of) as (environment, sensors):
        run(environment, sensors, robot, 0.2)
        assert sensors.ever_detected is not hidden
    detections = [m for _, m in robot.of(Detections)]
    assert [m.exposure for m in detections] == robot.exposures[: len(detections)]
    ids = {tag.tag_id for m in detections for tag in m.tags}
    assert ids & set(of.tag_ids("c").values())
    assert (not ids & set(of.tag_ids("b").values())) is hidden


@pytest.mark.parametrize("camera", ["a/onboard", "overhead"])
@pytest.mark.parametrize("shown", ["b", "a"])
def test_only_the_own_camera_detects_the_target(camera: str, shown: str) -> None:
    of = scene()
    with open_environment(of, 3) as environment:
        plant, encoders = environment.simulation.plant, environment.devices.encoders["a"]
        for step, target in ((of.docks[0], "b"), (None, None)):
            camera_of_tags = Frames(camera, of.tag_ids(shown).values())
            sensors = SensorSuite(of, "a", step, plant, encoders, [camera_of_tags], NullProfiler())
            assert not sensors.ever_detected
            robot = Listener(of)
            sensors.tick(plant.now_ns(), robot)
            assert len(robot.of(Detections)) == 1
            assert sensors.ever_detected is (camera == "a/onboard" and shown == target)


def test_no_frame_overtakes_the_one_before() -> None:
    """Of 100, 10 and 30 ms the second arrives with the first one, and the third at its own time."""
    camera, reader, arrived = MountedCamera(Frames("overhead", (), (100, 10, 30)), 0), Listener(scene()), []
    for now in range(0, 119, 5):
        arrived += [(now, m.exposure.frame) for m in camera.tick(now * 1_000_000, reader)]
    assert arrived == [(100, 1), (100, 2), (110, 3)]


def test_a_suite_has_nothing_to_do_before_the_time_that_it_gives() -> None:
    of = scene(cameras={"onboard": {"latency_ms": 35.0, "rate_hz": 25.0}}, odometry={"rate_hz": 60.0})
    robot = Listener(of)
    with suite(of) as (_, sensors):
        arrivals = 0
        while (next_ns := sensors.next_ns) < 1e9:
            assert isinstance(next_ns, int)
            sensors.tick(next_ns - 1, robot)
            assert (len(robot.messages), sensors.next_ns) == (arrivals, next_ns)
            sensors.tick(next_ns, robot)
            assert sensors.next_ns > next_ns
            arrivals = len(robot.messages)
    assert len(robot.of(WheelOdometry)) == 60
    assert len(robot.of(PoseMeasurement)) == 25


def test_odometry_follows_the_wheels() -> None:
    of = scene(odometry={"scale_error": 0.0, "noise_rad": 0.0, "ticks_per_turn": 100_000})
    robot = Listener(of)
    with suite(of) as (environment, sensors):
        plant = environment.simulation.plant
        start = np.array(plant.wheel_angles("a"))
        plant.command("a", Twist(-0.2, 0.3))
        run(environment, sensors, robot, 0.5)
        turned = np.array(plant.wheel_angles("a")) - start
    last = robot.of(WheelOdometry)[-1][1]
    assert (last.left, last.right) == pytest.approx(turned, abs=0.1)
    assert abs(last.right - last.left) > 0.1
