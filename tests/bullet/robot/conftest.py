"""An arena with a rendered overhead camera and the localisation of a unit by it; no phases, no judge."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from msrr_bullet.plant.kinematic_plant import KinematicPlant
from msrr_bullet.plant.plant import Plant
from msrr_bullet.render import RenderContext, build_renderer
from msrr_bullet.sensors.camera import Camera
from msrr_bullet.sensors.localisation_error import LocalisationError
from msrr_bullet.sensors.schedule import Delayed, Periodic, duration_ns
from msrr_bullet.sensors.wheel_encoders import WheelEncoders
from msrr_bullet.simulation.bullet_plant import BulletPlant
from msrr_bullet.simulation.tagged_bodies import TagVisuals
from msrr_bullet.simulation.world import BulletWorld
from msrr_perception.detection.detector import PupilDetector
from msrr_perception.detection.overhead_vision import OverheadVision
from msrr_perception.pose.global_pose import overhead_pose
from msrr_perception.pose.overhead_model import OverheadModel
from msrr_perception.pose.target import TargetModel
from msrr_perception.tracking.global_estimator import GlobalEstimator
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import OVERHEAD, ArenaEstimate, Detections, Twist
from msrr_scenes.placement.placement import draw_placement
from msrr_scenes.random_streams import stream
from msrr_scenes.specs.scene import Scene

POST: Mapping[str, Any] = {
    "shape": "cylinder",
    "radius_m": 0.06,
    "height_m": 0.2,
    "tag_id": 500,
    "pose": {"x_m": 0.1, "y_m": 0.3},
}


def _scene(
    overhead: Mapping[str, Any],
    obstacles: Mapping[str, Any],
    plant: str,
    start: SE2,
    target: SE2,
    others: Mapping[str, SE2],
    numbers: Sequence[int],
) -> Scene:
    def pose(X: SE2) -> dict[str, float]:
        return {"x_m": X.x, "y_m": X.y, "yaw_deg": 57.29577951308232 * X.yaw}

    return Scene.model_validate(
        {
            "name": "arena",
            "plant": plant,
            "units": {
                name: {"number": number, "pose": pose(X)}
                for number, (name, X) in zip(
                    numbers, {"a": start, "b": target, **others}.items(), strict=False
                )
            },
            "obstacles": obstacles,
            "cameras": {"overhead": {"samples": 1, **overhead}},
            "plan": [{"unit": "a", "to": "b.rear"}],
        }
    )


@dataclass
class Arena:
    """Plant, camera, vision and estimator in one loop.

    Attributes:
        law: Returns the command of unit a, given the time [s] and the estimate.
        drivers: Other unit -> its command, given the time [s].
        looks: Detections of all exposures, in order.
    """

    scene: Scene
    plant: Plant
    camera: Camera
    vision: OverheadVision
    estimator: GlobalEstimator
    encoders: WheelEncoders
    error: LocalisationError
    law: Callable[[float, ArenaEstimate | None], Twist] = lambda t, known: Twist()
    drivers: Mapping[str, Callable[[float], Twist]] = field(default_factory=dict)
    looks: list[Detections] = field(default_factory=list)

    def __post_init__(self) -> None:
        spec = self.camera.spec
        self._frames, self._readings = Periodic(spec.rate_hz), Periodic(self.scene.odometry.rate_hz)
        self._control = Periodic(self.scene.control.rate_hz)
        self._latency_ns = duration_ns(1e-3 * spec.latency_ms)
        self._queue: Delayed[Detections] = Delayed()

    @property
    def now_s(self) -> float:
        return 1e-9 * self.plant.now_ns()

    @property
    def known(self) -> ArenaEstimate | None:
        return self.estimator.estimate(self.plant.now_ns())

    def run(self, until_s: float, watch: Callable[[], None] = lambda: None) -> None:
        """Run until a time; ``watch`` is called after every control instant."""
        while self.plant.now_ns() < duration_ns(until_s):
            now_ns = self.plant.now_ns()
            if self._readings.due(now_ns):
                self.estimator.add_odometry(self.encoders.read(self.plant.wheel_angles("a"), now_ns))
            if self._frames.due(now_ns) and (exposure := self.camera.expose(now_ns)):
                detections = self.vision.detect(exposure, self.estimator.predict(now_ns), self.camera.fetch)
                self.looks.append(detections)
                self._queue.send(
                    now_ns + self._latency_ns, self.error.apply(detections, self.vision.model, "a")
                )
            for arrived in self._queue.arrived(now_ns):
                self.estimator.add_detections(arrived)
            if self._control.due(now_ns):
                self.plant.command("a", self.law(self.now_s, self.known))
                for name, drive in self.drivers.items():
                    self.plant.command(name, drive(self.now_s))
                watch()
            self.plant.step()

    def pixels(self, looks: list[Detections]) -> list[int]:
        """Pixels fetched for each exposure."""
        return [sum(w.area for w in look.windows) for look in looks]


OpenArena = Callable[..., Arena]


@pytest.fixture
def open_arena() -> Iterator[OpenArena]:
    """Build an arena: ``open_arena(plant="bullet", overhead={"dropout": 0.4}, start=SE2(-1.0, 0.0))``."""
    with ExitStack() as stack:

        def build(
            seed: int = 0,
            plant: str = "unicycle",
            overhead: Mapping[str, Any] | None = None,
            obstacles: Mapping[str, Any] | None = None,
            start: SE2 | None = None,
            target: SE2 | None = None,
            others: Mapping[str, SE2] | None = None,
            numbers: Sequence[int] = range(50),
        ) -> Arena:
            scene = _scene(
                overhead or {},
                {"post": POST} if obstacles is None else obstacles,
                plant,
                start or SE2(-1.0, -0.5),
                target or SE2(1.1, 0.0, math.radians(20.0)),
                others or {},
                numbers,
            )
            folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
            placement = draw_placement(scene, lambda name: stream(seed, name))
            world = stack.enter_context(BulletWorld(scene, placement, tags=TagVisuals(scene, folder)))
            spec = scene.cameras.overhead
            assert spec is not None
            renderer = build_renderer(spec.renderer, RenderContext(world.client, spec.samples))
            model = OverheadModel.from_scene(scene, ("a", "b"))
            estimator = GlobalEstimator(
                model, "a", TargetModel.from_scene(scene, scene.docks[0]), scene.odometry
            )
            estimator.aim("b", scene.geometry("b").dock_frame("rear"))
            return Arena(
                scene,
                BulletPlant(world) if plant == "bullet" else KinematicPlant(scene, placement, world),
                Camera(OVERHEAD, spec, renderer, lambda: overhead_pose(spec), seed),
                OverheadVision(model, ("a", "b"), PupilDetector()),
                estimator,
                WheelEncoders("a", scene.odometry, stream(seed, "unit/a/odometry")),
                LocalisationError(spec.localisation, seed),
            )

        yield build


def locked_pair(**keys: object) -> Scene:
    """Return a scene in which unit b begins in the rear port of unit a and undocks, with further keys."""
    return Scene.model_validate(
        {
            "name": "pair",
            "units": {"a": {"number": 0}, "b": {"number": 1}},
            "assembled": ["b.front-a.rear"],
            "plan": [{"undock": "b"}],
            "cameras": {"overhead": {}},
            **keys,
        }
    )
