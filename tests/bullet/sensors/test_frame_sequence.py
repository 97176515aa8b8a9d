"""Clock, latency and losses of a camera as it was built."""

from __future__ import annotations

import numpy as np
import pytest

from msrr_bullet.robot.interface import CameraReader
from msrr_bullet.sensors.frame_sequence import FrameSequence
from msrr_bullet.sensors.sensor_suite import MountedCamera
from msrr_scenes.as_built import BuiltCamera
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import GlobalPose, SensorMessage
from msrr_scenes.specs.sensors import CameraSpec

SPEC = CameraSpec(latency_ms=40.0, rate_hz=25.0)
PERIOD_NS = 40_000_000


def sequence(clock_ms: float = 0.0, jitter_ms: float = 0.0) -> FrameSequence:
    built = BuiltCamera(SPEC.pinhole, clock_ahead_ns=round(1e6 * clock_ms), jitter_ns=round(1e6 * jitter_ms))
    return FrameSequence("overhead", SPEC, built, seed=1)


def stamp(of: FrameSequence, now_ns: int) -> int:
    exposure = of.expose(now_ns)
    assert exposure is not None
    return exposure.stamp_ns


def lost_frames(probability: float, count: int = 2000) -> list[bool]:
    spec = CameraSpec(dropout=probability)
    frames = FrameSequence("a/onboard", spec, BuiltCamera(spec.pinhole), 5)
    exposures = [frames.expose(k * PERIOD_NS) for k in range(count)]
    assert all(e is None or (e.frame, e.camera) == (k, "a/onboard") for k, e in enumerate(exposures))
    return [e is None for e in exposures]


def test_a_camera_as_designed_tells_the_time_and_its_data_sheet_the_latency() -> None:
    exact = sequence()
    assert [stamp(exact, t) for t in (0, 123_456_789)] == [0, 123_456_789]
    assert {exact.next_latency_ns() for _ in range(50)} == {40_000_000}


def test_a_clock_that_is_ahead_or_behind_is_so_all_the_time_and_begins_at_zero() -> None:
    assert stamp(sequence(clock_ms=50.0), 1_000_000_000) == 1_050_000_000
    assert stamp(sequence(clock_ms=-50.0), 1_000_000_000) == 950_000_000
    assert stamp(sequence(clock_ms=-50.0), 10_000_000) == 0


def test_jitter_delays_every_frame_by_up_to_its_size() -> None:
    """Of 1000 uniform draws none lies outside, and some come within a hundredth of either end."""
    shaky = sequence(jitter_ms=80.0)
    late = np.array([shaky.next_latency_ns() for _ in range(1000)]) * 1e-6 - 40.0
    assert 0.0 <= late.min() < 0.8
    assert 79.2 < late.max() <= 80.0
    assert late.mean() == pytest.approx(40.0, abs=3.0)


class Clockwork:
    """A camera whose frames tell their time of exposure."""

    name, spec = "overhead", SPEC

    def __init__(self, of: FrameSequence, every: int = 1) -> None:
        self.frames, self._every, self._count = of, every, 0

    def capture(self, now_ns: int, reader: CameraReader) -> tuple[SensorMessage, ...]:
        self._count += 1
        lost = self._count % self._every
        return () if lost else (GlobalPose("a", now_ns, SE2(), np.eye(3)),)

    def next_latency_ns(self) -> int:
        return self.frames.next_latency_ns()


class Watcher:
    def uses_camera(self, camera: str) -> bool:
        return True


def test_frames_arrive_in_order_however_late_they_are() -> None:
    camera = MountedCamera(Clockwork(sequence(jitter_ms=300.0)), 0)
    arrived = []
    for tick in range(480):
        now_ns = round(tick * 1e9 / 240)
        arrived += [(now_ns, m.stamp_ns) for m in camera.tick(now_ns, Watcher())]
    stamps = [stamp for _, stamp in arrived]
    assert stamps == sorted(stamps)
    delays = np.array([now - stamp for now, stamp in arrived]) * 1e-9
    assert delays.min() >= 0.04
    assert 0.25 < delays.max() < 0.345


def test_a_frame_that_is_lost_delays_none_after_it() -> None:
    """Of eight frames seven are lost, and the eighth comes as late as it was drawn: 150 ms on average."""
    camera, delays = MountedCamera(Clockwork(sequence(jitter_ms=300.0), every=8), 0), []
    for tick in range(240 * 60):
        now_ns = round(tick * 1e9 / 240)
        delays += [1e-9 * (now_ns - m.stamp_ns) for m in camera.tick(now_ns, Watcher())]
    # Uniform from 40 to 340 ms, and up to a tick more: five standard errors are 5.3 ms and more.
    assert np.mean(delays) == pytest.approx(0.19, abs=5.0 * 0.0866 / np.sqrt(len(delays)) + 0.003)


@pytest.mark.parametrize("probability", [0.0, 0.3, 1.0])
def test_the_share_of_lost_frames_is_the_probability(probability: float) -> None:
    """2000 frames: at 30 % the interval of 5 standard errors is left once in 1.7 million seeds."""
    assert sum(lost_frames(probability)) == pytest.approx(2000 * probability, abs=103 * (0 < probability < 1))


def test_a_higher_probability_loses_the_frames_of_a_lower_one_and_more() -> None:
    few, many = lost_frames(0.1), lost_frames(0.4)
    assert all(m for f, m in zip(few, many, strict=True) if f)
    assert sum(many) > sum(few)
