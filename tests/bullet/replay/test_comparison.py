"""A replay finds every difference, and only differences; it runs where the simulator cannot be imported."""

from __future__ import annotations

import hashlib
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from msrr_bullet.log import LogError, LogHeader, McapRecorder, read_log, topics
from msrr_bullet.log.records import TruePose
from msrr_bullet.replay import replay, replay_isolated
from msrr_bullet.replay.comparison import ReplayError, ReplayReport
from msrr_bullet.replay.recorded_robot import RecordedRobot, Robot
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import (
    Action,
    ArenaEstimate,
    AssemblyPath,
    AssemblyProgress,
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
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.scene import Scene

SCENE = Scene.model_validate(
    {
        "name": "pair",
        "units": {"a": {"number": 0}, "b": {"number": 1, "pose": {"x_m": 1.0}}},
        "plan": [{"unit": "a", "to": "b.rear"}, {"unit": "b", "to": "a.rear"}],
    }
)


class HashRobot:
    """A robot whose every output depends on every bit of every input so far, and on their order."""

    def __init__(self, scene: Scene, step: DockStep) -> None:
        self._state = hashlib.sha256(step.to.encode())
        self.estimate: PoseEstimate | None = None
        self.los: LosObservation | None = None
        self.belief = Belief()
        self.situation: ArenaEstimate | None = None
        self.assembly: AssemblyProgress | None = None
        self.path: AssemblyPath | None = None
        self._steps = 0

    def wants(self, camera: str) -> bool:
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
        if self._steps > 3:  # no belief at first
            self.estimate = PoseEstimate(now_ns, SE2(x, 1.0, -x), x * np.eye(3), now_ns)
            self.los = LosObservation(now_ns, x, -x, 0.1, LosStatus.SEEN)
        self.belief = Belief(reason=f"{x}")
        return Action(now_ns, Phase.DOCK, 1, Twist(x, 1.0 - x))


def trial(path: Path, finish: bool = True, wrap: Callable[[Robot], Robot] = lambda robot: robot) -> None:
    """Two steps of a made-up trial of 1 s, with detections under way for 40 ms."""
    rng = np.random.default_rng(5)
    recorder = McapRecorder(path / "trial.mcap", LogHeader.of(SCENE, 5, {}), flush_every_s=0.25)
    now = 0
    for index, step in enumerate(SCENE.plan):
        start = now = index * 1_000_000_000
        recorded = wrap(HashRobot(SCENE, step))
        robot = RecordedRobot(recorded, step.unit, recorder, index, lambda: now)  # noqa: B023 - the clock
        under_way: list[tuple[int, Detections]] = []
        for tick in range(100):
            now = start + tick * 10_000_000

            def fetch(window: Window) -> Pixels:
                return rng.integers(0, 256, (window.height, window.width), dtype=np.uint8)

            robot.receive(WheelOdometry(step.unit, now, *map(float, rng.normal(size=2))))
            if tick % 4 == 0:
                found = robot.expose(Exposure(f"{step.unit}/onboard", tick // 4, now), fetch)
                if found is not None:
                    under_way.append((now + 40_000_000, found))
            while under_way and under_way[0][0] <= now:
                robot.receive(under_way.pop(0)[1])
            if tick % 2 == 0:
                robot.step(now)
                recorder.write(topics.true_pose("a"), now, TruePose("a", now, SE2(*rng.normal(size=3))))
    if finish:
        recorder.close()
    else:
        recorder._send(flush=True)
        recorder._await_batches(0)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("run")
    trial(path)
    return path


def test_the_same_robot_does_the_same(run: Path) -> None:
    report = replay(run, HashRobot)
    assert report.mismatches == ()
    assert report.identical
    assert report.complete
    assert (report.steps, report.commands, report.sensor_messages) == (2, 100, 200)
    assert report.estimates == 2 * (47 + 47 + 50)
    assert report.windows == sum(1 for r in read_log(run).records("/camera/*/window"))
    assert report.detections > 20
    assert ReplayReport.model_validate_json(report.model_dump_json()) == report


class Skewed(HashRobot):
    """Differs from the robot of the trial in one respect, from step 10 on."""

    what = ""

    def step(self, now_ns: int) -> Action:
        action = super().step(now_ns)
        if self._steps < 10:
            return action
        if self.what == "command":
            return Action(
                now_ns, action.phase, 1, Twist(float(np.nextafter(action.twist.v, 2.0)), action.twist.w)
            )
        if self.what == "estimate" and self.estimate:
            covariance = self.estimate.covariance.copy()
            covariance[2, 0] = -0.0
            self.estimate = PoseEstimate(now_ns, self.estimate.X_DU, covariance, now_ns)
        if self.what == "los":
            self.los = None
        if self.what == "belief":
            self.belief = Belief(reason="other")
        return action

    def expose(self, exposure: Exposure, fetch: Fetch) -> Detections | None:
        if self._steps < 10:
            return super().expose(exposure, fetch)
        if self.what == "window":
            return super().expose(exposure, lambda w: fetch(Window(w.x + 1, w.y, w.width, w.height)))
        if self.what == "too few":
            return None
        found = super().expose(exposure, fetch)
        if self.what == "too many":
            fetch(Window(0, 0, 5, 5))
        if self.what == "detections" and found is not None:
            return Detections(exposure, (), found.windows)
        return found


@pytest.mark.parametrize(
    ("what", "found"),
    [
        ("command", "command"),
        ("estimate", "estimate"),
        ("los", "los"),
        ("belief", "belief"),
        ("window", "window"),
        ("too few", "window"),
        ("too many", "window"),
        ("detections", "detections"),
    ],
)
def test_every_kind_of_difference_is_found_where_it_begins(run: Path, what: str, found: str) -> None:
    factory = type("Skewed", (Skewed,), {"what": what})
    report = replay(run, factory)
    assert not report.identical
    assert report.mismatches[0].what == found
    assert 0.17 < report.mismatches[0].time_s < 0.33
    assert len(report.mismatches) <= 20


def test_a_robot_that_peeks_is_caught(tmp_path: Path) -> None:
    """A robot that is told more than the log says (here: how often it was tapped) decides differently."""
    secret = iter(np.random.default_rng(0).normal(size=1_000))

    class Peeking(HashRobot):
        def step(self, now_ns: int) -> Action:
            self._state.update(f"{next(secret)}".encode())
            return super().step(now_ns)

    trial(tmp_path, wrap=lambda robot: Peeking(SCENE, SCENE.plan[0]))
    assert not replay(tmp_path, HashRobot).identical


def test_a_trial_that_was_killed_is_compared_as_far_as_it_goes(tmp_path: Path, run: Path) -> None:
    trial(tmp_path, finish=False)
    report = replay(tmp_path, HashRobot)
    assert not report.complete
    assert report.identical
    content = (run / "trial.mcap").read_bytes()
    compared = set()
    for size in range(len(content) // 3, len(content), len(content) // 9):
        (tmp_path / "trial.mcap").write_bytes(content[:size])
        report = replay(tmp_path, HashRobot)
        assert report.identical
        compared.add(report.commands)
    assert len(compared) > 2


def test_a_log_without_a_step_is_refused(tmp_path: Path) -> None:
    with McapRecorder(tmp_path / "trial.mcap", LogHeader.of(SCENE, 0, {})):
        pass
    with pytest.raises(ReplayError, match="nothing to replay"):
        replay(tmp_path, HashRobot)
    with McapRecorder(tmp_path / "trial.mcap", LogHeader.of(SCENE, 0, {})) as recorder:
        recorder.write(topics.sensor("a", m := WheelOdometry("a", 0, 0.0, 0.0)), 0, m)
    with pytest.raises(ReplayError, match="before the first step"):
        replay(tmp_path, HashRobot)


def test_an_isolated_replay_says_what_went_wrong(tmp_path: Path) -> None:
    with pytest.raises(ReplayError, match="cannot read the log"):
        replay_isolated(tmp_path / "gone")
    with pytest.raises(LogError, match="cannot read the log"):
        replay(tmp_path / "gone", HashRobot)


def test_the_barrier_stops_the_simulator_at_any_depth(tmp_path: Path) -> None:
    (tmp_path / "sly.py").write_text("def peek():\n    import pybullet\n")
    code = """
import sys
from msrr_bullet.replay.isolation import SimulatorBarrier
assert not [m for m in sys.modules if m.startswith("pybullet")], "importing replay imports the simulator"
SimulatorBarrier.install()
import sly
import importlib
names = ("pybullet_data", "pybullet_utils.bullet_client")
for attempt in (sly.peek, *(lambda name=name: importlib.import_module(name) for name in names)):
    try:
        attempt()
    except ImportError as error:
        assert "without the simulator" in str(error)
    else:
        raise AssertionError("imported")
"""
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    code = """
import pybullet
from msrr_bullet.replay.isolation import SimulatorBarrier
SimulatorBarrier.install()
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert "ReplayError: pybullet was imported before" in done.stderr
