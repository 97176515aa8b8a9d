"""Shared by the tests of msrr_bullet: a drive made up by hand, two short runs, and a bench for ports."""

from __future__ import annotations

import math
import signal
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pybullet
import pybullet_data
import pytest

from msrr_bullet.collision.clearance_model import ClearanceModel
from msrr_bullet.log import LOG_NAME, Log, LogHeader, read_log
from msrr_bullet.log.mcap_recorder import McapRecorder
from msrr_bullet.plant.kinematic_plant import KinematicPlant
from msrr_bullet.plant.plant import Plant
from msrr_bullet.run_folder import PICTURE_NAME, REPLAY_NAME
from msrr_bullet.simulation.bullet_plant import BulletPlant
from msrr_bullet.simulation.world import BulletWorld
from msrr_bullet.timeline.log_snapshots import read_snapshots
from msrr_bullet.timeline.snapshot import Snapshot, StepSnapshot
from msrr_bullet.trial.trial import Trial
from msrr_scenes.as_built import draw_as_built
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.loading.load import load_scene
from msrr_scenes.messages import LosObservation, LosStatus, Phase, Twist
from msrr_scenes.outcome import Outcome
from msrr_scenes.placement.placement import Placement
from msrr_scenes.specs.scene import Scene

PHASES = (
    (0.06, Phase.HAND_OVER),
    (0.75, Phase.DOCK),
    (0.85, Phase.LOCK),
    (0.95, Phase.VERIFY),
    (2.0, Phase.DONE),
)


@dataclass(frozen=True)
class Drive:
    """A scene and the snapshots of an invented trial in it."""

    scene: Scene
    snapshots: tuple[Snapshot, ...]


class InlineExecutor:
    """Runs everything at once, in the main thread of this process."""

    def submit(self, fn: Callable[..., Any], /, *args: Any) -> Future[Any]:
        future: Future[Any] = Future()
        try:
            future.set_result(fn(*args))
        except Exception as error:  # noqa: BLE001 - as every executor does
            future.set_exception(error)
        return future


@pytest.fixture
def interruptible() -> Iterator[None]:
    """Take interrupts, which a shell switches off for what it starts in the background of a script."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


#: An executor for sweeps without other processes.
inline = InlineExecutor()


@pytest.fixture
def undrawn_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    """Page and picture of runs are empty files: drawing them takes longer than a short trial."""

    def leave_empty(out: Path, result: object) -> None:
        for name in (REPLAY_NAME, PICTURE_NAME):
            (out / name).touch()

    monkeypatch.setattr("msrr_bullet.run._draw_run", leave_empty)


@pytest.fixture
def client() -> Iterator[int]:
    """An empty client that finds PyBullet's own models."""
    client = pybullet.connect(pybullet.DIRECT)
    pybullet.setAdditionalSearchPath(pybullet_data.getDataPath(), physicsClientId=client)
    yield client
    pybullet.disconnect(client)


def with_step(snapshot: Snapshot, **changes: Any) -> Snapshot:
    """Return a snapshot with changes in its first step."""
    return replace(snapshot, steps=(replace(snapshot.steps[0], **changes), *snapshot.steps[1:]))


@pytest.fixture(scope="session")
def drive(shipped: Callable[..., Scene]) -> Drive:
    """Unit a of scene ``bystander`` drives to the rear of b in 8 s; its estimate is up to 12 mm off."""
    scene = shipped("bystander")
    step, los = scene.plan[0], scene.los
    bystanders = {name: scene.units[name].pose.nominal for name in ("b", "c")}
    posts = {name: spec.pose.nominal for name, spec in scene.obstacles.items()}
    model = ClearanceModel.from_scene(scene)
    X_WD = bystanders["b"] @ scene.geometry("b").dock_frame("rear")
    snapshots = []
    count = 200
    for i in range(count):
        done = i / (count - 1)
        left = max(0.0, 1.0 - done / 0.75)
        X_WU = X_WD @ SE2(-0.1 - 0.7 * left, 0.12 * left**2, -0.3 * left)
        X_UD = X_WU.inverse() @ X_WD
        edges = [X_UD.act([los.setback_m, side * los.half_width_m]) for side in (1.0, -1.0)]
        angles = [math.atan2(p[1], p[0]) for p in edges]
        status = LosStatus.SEEN if i % 20 < 16 else LosStatus.PREDICTED
        stamp_ns = round(8e9 * done)
        units = {"a": X_WU, **bystanders}
        snapshots.append(
            Snapshot(
                stamp_ns=stamp_ns,
                units=units,
                obstacles=posts,
                clearance=model.minimum({**units, **posts}, {frozenset("ab")} if done >= 0.06 else ()),
                steps=(
                    StepSnapshot(
                        unit=step.unit,
                        step=step,
                        estimate=X_WU @ SE2(0.0, 0.012 * left) if i > 5 else None,
                        phase=next(phase for until, phase in PHASES if done < until),
                        attempt=1,
                        los=LosObservation(stamp_ns, angles[0], angles[1], 0.2, status) if i > 5 else None,
                    ),
                ),
            )
        )
    return Drive(scene, tuple(snapshots))


@pytest.fixture(scope="session")
def short_run(shipped: Callable[..., Scene], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Run folder with the log of 10 s, seen by both cameras, which ends half-way through docking."""
    scene = shipped(
        "two_units",
        {
            "plant": "unicycle",
            "time_limit_s": "10",
            "units.a.pose.x_m": "-0.1",
            "units.a.pose.y_m": "0.05",
            "units.a.pose.yaw_deg": "20",
            "obstacles.post.pose.x_m": "0.1",
            "obstacles.post.pose.y_m": "-0.45",
        },
    )
    folder = tmp_path_factory.mktemp("short_run")
    with McapRecorder(folder / LOG_NAME, LogHeader.of(scene, 3, {})) as recorder:
        Trial(scene, 3, recorder=recorder).run()
    return folder


@pytest.fixture(scope="session")
def short_log(short_run: Path) -> Log:
    """Log of ``short_run``."""
    return read_log(short_run)


@pytest.fixture(scope="session")
def short_snapshots(short_log: Log) -> list[Snapshot]:
    """Snapshots of ``short_run``."""
    return read_snapshots(short_log)


@pytest.fixture(scope="session")
def blind_run(shipped: Callable[..., Scene], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Run folder with the log of a trial with parametric perception, without any pixels."""
    scene = shipped("close_range", blind=True)
    folder = tmp_path_factory.mktemp("blind_run")
    with McapRecorder(folder / LOG_NAME, LogHeader.of(scene, 1, {})) as recorder:
        Trial(scene, 1, recorder=recorder).run()
    return folder


#: Four units that a base station leads: one drives into the open, one falls silent on its way, some wait.
MISSION = """
description: Four units assemble into a tee.
plant: unicycle
time_limit_s: 60
arena: {x_m: [-1.6, 1.6], y_m: [-1.3, 1.3]}
units:
  a: {number: 0, pose: {x_m: -0.9, y_m: -0.7, yaw_deg: 30}}
  b: {number: 1, pose: {x_m: 0.7, y_m: -0.6, yaw_deg: 100}}
  c: {number: 2, pose: {x_m: -0.8, y_m: 0.7, yaw_deg: -60}}
  d: {number: 3, pose: {x_m: 0.8, y_m: 0.6, yaw_deg: 200}}
cameras:
  onboard: {samples: 1}
  overhead: {height_m: 3.0, samples: 1}
radio:
  silences: [{from_s: 2, until_s: 5, units: [c]}]
shape: {tee: 4}
"""


@dataclass
class MissionRun:
    """A mission of a base station that has run: its log, and the snapshots that a live view got."""

    folder: Path
    log: Log
    live: list[Snapshot]
    snapshots: list[Snapshot]

    @property
    def waiting(self) -> Snapshot:
        """An instant at which units wait, amid all such instants."""
        found = [s for s in self.snapshots if s.mission and any(map(s.mission.waits_for, s.units))]
        return found[len(found) // 2]


def record_mission(folder: Path, **overrides: str) -> MissionRun:
    (folder / "tee.yaml").write_text(MISSION)
    scene = load_scene(folder / "tee.yaml", overrides)
    viewer = KeepingViewer()
    with McapRecorder(folder / LOG_NAME, LogHeader.of(scene, 1, {})) as recorder:
        Trial(scene, 1, recorder=recorder, viewer=viewer).run()
    log = read_log(folder)
    return MissionRun(folder, log, viewer.snapshots, read_snapshots(log))


@pytest.fixture(scope="session")
def mission_run(tmp_path_factory: pytest.TempPathFactory) -> MissionRun:
    """A mission of four units without any pixels, watched while it runs and read from its log."""
    return record_mission(tmp_path_factory.mktemp("mission_run"), perception="parametric")


@pytest.fixture(scope="session")
def mission_by_images(tmp_path_factory: pytest.TempPathFactory) -> MissionRun:
    """The same mission, seen by the cameras."""
    return record_mission(tmp_path_factory.mktemp("mission_by_images"))


class KeepingViewer:
    """A viewer that keeps the snapshots."""

    def __init__(self) -> None:
        self.snapshots: list[Snapshot] = []

    def update(self, snapshot: Snapshot) -> None:
        self.snapshots.append(snapshot)

    def close(self) -> None:
        """Nothing to release."""


#: Where the unit docked to stands: in a heading that is no axis of the world.
X_WB = SE2(0.1, -0.2, 0.4)


class Bench:
    """A plant with ``a`` before a port of ``b``."""

    def __init__(self, scene: Scene, plant: Plant) -> None:
        self.scene = scene
        self.plant = plant
        self.dt = 1.0 / scene.physics_hz
        plant.begin_dock(scene.plan[0])

    def X_DP(self) -> SE2:
        """The front port of ``a`` in the dock frame of its target."""
        step = self.scene.plan[0]
        X_WD = self.plant.pose("b") @ self.scene.geometry("b").dock_frame(step.target_port)
        return X_WD.inverse() @ self.plant.pose("a") @ self.scene.geometry("a").port(step.port)

    @property
    def gap(self) -> float:
        """Distance of the faces [m]."""
        return -self.X_DP().x

    def drive(self, v: float, time_s: float, *, until_seated: bool = False) -> None:
        """Drive ``a`` straight at ``v`` for a time, or until both seat switches close."""
        self.plant.command("a", Twist(v, 0.0))
        for k in range(round(time_s / self.dt)):
            self.plant.step()
            if until_seated and k % 8 == 0 and all(self.plant.switches("a")):
                return

    def dock(self, v: float = 0.05, time_s: float = 3.0) -> None:
        """Drive in until seated, then close the lock while pressing."""
        self.drive(v, time_s, until_seated=True)
        self.plant.set_lock("a", True)
        self.drive(v, self.scene.lock.close_time_s + 0.1)
        self.plant.command("a", Twist())


def two_units(port: str = "rear", **keys: Any) -> Scene:
    """A scene of two units, ``a`` docking to ``b``; ``keys`` are top-level keys of the scene."""
    return Scene.model_validate(
        {
            "name": "bench",
            "units": {"a": {"number": 1}, "b": {"number": 2}},
            "plan": [{"unit": "a", "to": f"b.{port}"}],
            **keys,
        }
    )


def before_port(scene: Scene, X_DP: SE2) -> Placement:
    """Place ``a`` so that its front port stands at ``X_DP`` in the dock frame of its target.

    Units that are assembled with ``b`` stand in their seats.
    """
    step = scene.plan[0]
    X_WD = X_WB @ scene.geometry("b").dock_frame(step.target_port)
    poses = {"a": X_WD @ X_DP @ scene.geometry("a").port(step.port).inverse(), "b": X_WB}
    for seat in scene.assembled_docks:
        X_WS = poses[seat.target_unit] @ scene.geometry(seat.target_unit).dock_frame(seat.target_port)
        poses[seat.unit] = X_WS @ scene.geometry(seat.unit).port(seat.port).inverse()
    return Placement(poses, {})


@contextmanager
def bench(kind: str, X_DP: SE2, port: str = "rear", **keys: Any) -> Iterator[Bench]:
    """Set up a plant of a kind (``bullet`` or ``unicycle``) and close it afterwards."""
    scene = two_units(port, **keys)
    placement = before_port(scene, X_DP)
    if kind == "bullet":
        with BulletWorld(scene, placement, built=draw_as_built(scene, 0)) as world:
            yield Bench(scene, BulletPlant(world))
    else:
        yield Bench(scene, KinematicPlant(scene, placement))


@pytest.fixture(scope="session")
def line_of_three(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Scene file of three units, without contact and pixels, that a base station leads into a line."""
    file = tmp_path_factory.mktemp("scene") / "line_of_three.yaml"
    file.write_text(
        """
plant: unicycle
perception: parametric
time_limit_s: 60
arena: {x_m: [-1.6, 1.6], y_m: [-1.3, 1.3]}
units:
  a: {number: 0, pose: {x_m: -0.8, y_m: -0.5, spread: {x_m: 0.2, y_m: 0.2, yaw_deg: 180}}}
  b: {number: 1, pose: {x_m: 0.0, y_m: 0.5, spread: {x_m: 0.2, y_m: 0.2, yaw_deg: 180}}}
  c: {number: 2, pose: {x_m: 0.8, y_m: -0.5, spread: {x_m: 0.2, y_m: 0.2, yaw_deg: 180}}}
cameras: {overhead: {height_m: 3.0}}
shape: {line: 3}
radio: {loss: 0.2, jitter_ms: 300}
"""
    )
    return file


@pytest.fixture(scope="session")
def line_run(line_of_three: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Run folder with the log of a whole mission of ``line_of_three``, by a radio that loses messages."""
    folder, scene = tmp_path_factory.mktemp("mission"), load_scene(line_of_three)
    with McapRecorder(folder / LOG_NAME, LogHeader.of(scene, 1, {})) as recorder:
        assert Trial(scene, 1, recorder=recorder).run().outcome is Outcome.COMPLETE
    return folder


@pytest.fixture(scope="session")
def line_log(line_run: Path) -> Log:
    """Log of ``line_run``."""
    return read_log(line_run)
