"""Header of a small scene, an invented trial, and the comparison of messages bit by bit."""

from __future__ import annotations

import dataclasses
import typing

import numpy as np
import pytest

from msrr_bullet.log import LogHeader, MemoryRecorder, TruePose, topics
from msrr_bullet.log.mcap_recorder import McapRecorder
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import (
    Action,
    Detections,
    Exposure,
    Phase,
    PoseEstimate,
    TagDetection,
    Twist,
    WheelOdometry,
)
from msrr_scenes.specs.scene import Scene


def bits(value: typing.Any) -> typing.Any:
    """Return what identifies a value down to the bit."""
    if isinstance(value, np.ndarray):
        # The one NaN of the log stands for all of them.
        clean = np.where(np.isnan(value), np.nan, value) if value.dtype == np.float64 else value
        return (str(value.dtype), value.shape, clean.tobytes())
    if dataclasses.is_dataclass(value):
        return (type(value), *(bits(getattr(value, f.name)) for f in dataclasses.fields(value)))
    if isinstance(value, tuple):
        return tuple(bits(v) for v in value)
    if isinstance(value, dict):
        return tuple((k, bits(v)) for k, v in value.items())
    return (float, value.hex()) if isinstance(value, float) else (type(value), value)


def record_trial(recorder: McapRecorder | MemoryRecorder, seconds: float, seed: int = 0) -> None:
    """Record an invented trial: 100 Hz odometry, 25 Hz windows, 50 Hz decisions, topics of one time mixed."""
    rng = np.random.default_rng(seed)
    buffer = np.empty((480, 640), dtype=np.uint8)
    for tick in range(round(seconds * 100)):
        now = tick * 10_000_000
        recorder.write("/sensors/a/odometry", now, WheelOdometry("a", now, *rng.normal(size=2)))
        if tick % 2 == 0:
            recorder.write(
                topics.action("a"),
                now,
                Action(now, Phase.DOCK, 1, Twist(*rng.normal(size=2)), reason="straight on"),
            )
            pose = PoseEstimate(now, SE2(*rng.normal(size=3)), rng.normal(size=(3, 3)), now)
            recorder.write(topics.estimate("a"), now, pose)
            recorder.write(topics.true_pose("a"), now, TruePose("a", now, SE2(*rng.normal(size=3))))
        if tick % 4 == 0:
            exposure = Exposure("a/onboard", tick // 4, now)
            recorder.write(topics.exposure("a/onboard"), now, exposure)
            window = Window(tick % 90, 5, 60, 40)
            view = buffer[5:45, window.x : window.x_end]  # not contiguous, and overwritten the next time
            view[...] = rng.integers(0, 256, view.shape, dtype=np.uint8)
            recorder.window(exposure, window, view)
            tag = TagDetection(11, rng.normal(size=(4, 2)), 50.0, 0, rng.uniform(size=4))
            recorder.write(topics.sensor("a", d := Detections(exposure, (tag,), (window,))), now, d)


@pytest.fixture(scope="module")
def scene() -> Scene:
    return Scene.model_validate(
        {
            "name": "pair",
            "units": {"b": {"number": 1, "pose": {"x_m": 1.0, "yaw_deg": 0.1}}, "a": {"number": 0}},
            "plan": [{"unit": "a", "to": "b.rear"}],
            "limits": {"setting": "tight", "v_max_mps": 0.1 + 0.2},
        }
    )


@pytest.fixture(scope="module")
def header(scene: Scene) -> LogHeader:
    return LogHeader.of(scene, 17, {"python": "3.11", "numpy": "2"})
