"""Clock and latency of a camera as it was built."""

from __future__ import annotations

import numpy as np
import pytest

from msrr_bullet.robot.interface import CameraReader
from msrr_bullet.sensors.frame_timing import FrameTiming
from msrr_bullet.sensors.sensor_suite import MountedCamera
from msrr_scenes.as_built import BuiltCamera
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import GlobalPose, SensorMessage
from msrr_scenes.random_streams import stream
from msrr_scenes.specs.sensors import CameraSpec

SPEC = CameraSpec(latency_ms=40.0, rate_hz=25.0)


def timing(clock_ms: float = 0.0, jitter_ms: float = 0.0) -> FrameTiming:
    built = BuiltCamera(SPEC.pinhole, clock_ahead_ns=round(1e6 * clock_ms), jitter_ns=round(1e6 * jitter_ms))
    return FrameTiming(SPEC, built, stream(1, "jitter"))


def test_a_camera_as_designed_tells_the_time_and_its_data_sheet_the_latency() -> None:
    exact = timing()
    assert [exact.stamp(t) for t in (0, 123_456_789)] == [0, 123_456_789]
    assert {exact.next_latency_ns() for _ in range(50)} == {40_000_000}


def test_a_clock_that_is_ahead_or_behind_is_so_all_the_time_and_begins_at_zero() -> None:
    assert timing(clock_ms=50.0).stamp(1_000_000_000) == 1_050_000_000
    assert timing(clock_ms=-50.0).stamp(1_000_000_000) == 950_000_000
    assert timing(clock_ms=-50.0).stamp(10_000_000) == 0


def test_jitter_delays_every_frame_by_up_to_its_size() -> None:
    """Of 1000 uniform draws none lies outside, and some come within a hundredth of either end."""
    shaky = timing(jitter_ms=80.0)
    late = np.array([shaky.next_latency_ns() for _ in range(1000)]) * 1e-6 - 40.0
    assert 0.0 <= late.min() < 0.8
    assert 79.2 < late.max() <= 80.0
    assert late.mean() == pytest.approx(40.0, abs=3.0)


class Clockwork:
    """A camera whose frames tell their time of exposure."""

    name, spec = "overhead", SPEC

    def __init__(self, of: FrameTiming) -> None:
        self.timing = of

    def capture(self, now_ns: int, reader: CameraReader) -> tuple[SensorMessage, ...]:
        return (GlobalPose("a", now_ns, SE2(), np.eye(3)),)

    def next_latency_ns(self) -> int:
        return self.timing.next_latency_ns()


class Watcher:
    def uses_camera(self, camera: str) -> bool:
        return True


def test_frames_arrive_in_order_however_late_they_are() -> None:
    camera = MountedCamera(Clockwork(timing(jitter_ms=300.0)), 0)
    arrived = []
    for tick in range(480):
        now_ns = round(tick * 1e9 / 240)
        arrived += [(now_ns, m.stamp_ns) for m in camera.tick(now_ns, Watcher())]
    stamps = [stamp for _, stamp in arrived]
    assert stamps == sorted(stamps)
    delays = np.array([now - stamp for now, stamp in arrived]) * 1e-9
    assert delays.min() >= 0.04
    assert 0.25 < delays.max() < 0.345
