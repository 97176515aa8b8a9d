"""A robot without perception and control, and the recording of a trial of it."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from msrr_bullet.log import LogHeader, topics
from msrr_bullet.log.mcap_recorder import McapRecorder
from msrr_bullet.log.records import JUDGE, Event, StepStart, TruePose
from msrr_bullet.replay.recorded_robot import RecordedRobot
from msrr_bullet.robot.interface import Estimates, ObservableRobot
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import (
    Action,
    Belief,
    Detections,
    Exposure,
    Fetch,
    LosObservation,
    LosStatus,
    Phase,
    Pixels,
    PoseEstimate,
    SensorMessage,
    TagDetection,
    Twist,
    WheelOdometry,
)
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.scene import Scene

pair = Scene.model_validate(
    {
        "name": "pair",
        "units": {
            "a": {"number": 0},
            "b": {"number": 1, "pose": {"x_m": 1.0}},
            "c": {"number": 2, "pose": {"frame": "b.left", "x_m": -0.5}},
        },
        "plan": [{"unit": "a", "to": "b.rear"}, {"unit": "c", "to": "b.left"}],
    }
)


class HashRobot:
    """A robot whose every output depends on every bit of every input so far, and on their order."""

    def __init__(self, scene: Scene, step: DockStep) -> None:
        self._state = hashlib.sha256(step.to.encode())
        self.estimates = Estimates()
        self._steps = 0

    def uses_camera(self, camera: str) -> bool:
        return True

    def _number(self) -> float:
        return int.from_bytes(self._state.digest()[:6], "little") / 2**48

    def expose(self, exposure: Exposure, fetch: Fetch) -> Detections | None:
        self._state.update(f"{exposure}".encode())
        windows = []
        for _ in range(1 + int(3 * self._number())):
            window = Window(int(50 * self._number()), 3, 20 + int(9 * self._number()), 15)
            self._state.update(fetch(window).tobytes())
            windows.append(window)
        if self._number() < 0.2:
            return None
        corners = np.full((4, 2), self._number())
        return Detections(exposure, (TagDetection(int(9 * self._number()), corners),), tuple(windows))

    def receive(self, message: SensorMessage) -> None:
        self._state.update(b"got")
        if isinstance(message, Detections):
            self._state.update(message.tags[0].corners.tobytes())
        else:
            self._state.update(repr(message).encode())

    def step(self, now_ns: int) -> Action:
        self._state.update(f"step {now_ns}".encode())
        self._steps += 1
        x = self._number()
        self.estimates = Estimates(belief=Belief(reason=f"{x}"))
        if self._steps > 3:  # no estimates at first
            pose = PoseEstimate(now_ns, SE2(x, 1.0, -x), x * np.eye(3), now_ns)
            los = LosObservation(now_ns, x, -x, 0.1, LosStatus.SEEN)
            self.estimates = self.estimates._replace(pose=pose, los=los)
        return Action(now_ns, Phase.DOCK, 1, Twist(x, 1.0 - x))


def record(
    path: Path, finish: bool = True, factory: Callable[[Scene, DockStep], ObservableRobot] = HashRobot
) -> None:
    """Record two steps of 1 s each, with a camera latency of 40 ms."""
    rng = np.random.default_rng(5)
    recorder = McapRecorder(path / "trial.mcap", LogHeader.of(pair, 5, {}), flush_every_s=0.25)
    now = 0
    for index, step in enumerate(pair.plan):
        start = now = index * 1_000_000_000
        recorder.write(topics.STEPS, now, StepStart(now, index, step.unit))
        robot = RecordedRobot(factory(pair, step), step.unit, recorder, lambda: now)  # noqa: B023 - the time of the loop
        queue: list[tuple[int, Detections]] = []
        for tick in range(100):
            now = start + tick * 10_000_000
            robot.receive(WheelOdometry(step.unit, now, *map(float, rng.normal(size=2))))
            if tick % 4 == 0:
                pixels = rng.integers(0, 256, (100, 100), dtype=np.uint8)

                def fetch(w: Window, frame: Pixels = pixels) -> Pixels:
                    return frame[w.y : w.y_end, w.x : w.x_end]

                detections = robot.expose(Exposure(f"{step.unit}/onboard", tick // 4, now), fetch)
                if detections is not None:
                    queue.append((now + 40_000_000, detections))
            while queue and queue[0][0] <= now:
                robot.receive(queue.pop(0)[1])
            if tick % 2 == 0:
                robot.step(now)
                recorder.write(topics.true_pose("a"), now, TruePose("a", now, SE2(*rng.normal(size=3))))
    if finish:
        recorder.write(topics.EVENTS, now, Event(now, JUDGE, Outcome.TIMEOUT.value))
        recorder.close()
    else:
        recorder._send(flush=True)
        recorder._await_batches(0)


@pytest.fixture(scope="session")
def recorded_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run folder with the log of a trial of :class:`HashRobot`."""
    path = tmp_path_factory.mktemp("run")
    record(path)
    return path
