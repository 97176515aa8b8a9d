"""What all steps of one trial share: the plant, the world its cameras see, encoders, command links."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path

import numpy as np

from msrr_bullet.collision.clearance_model import ClearanceModel, Pair
from msrr_bullet.plant.kinematic_plant import KinematicPlant
from msrr_bullet.plant.plant import Plant
from msrr_bullet.render.renderer import RenderContext, Renderer, build_renderer
from msrr_bullet.sensors.camera import Camera
from msrr_bullet.sensors.command_link import CommandLink
from msrr_bullet.sensors.localisation_error import LocalisationError
from msrr_bullet.sensors.wheel_encoders import WheelEncoders
from msrr_bullet.simulation.bullet_plant import BulletPlant
from msrr_bullet.simulation.tagged_bodies import TagVisuals
from msrr_bullet.simulation.world import BulletWorld
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.messages import seconds
from msrr_scenes.placement.placement import Placement
from msrr_scenes.random_streams import stream
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.sensors import CameraSpec


@dataclass
class Stage:
    """The running world of a trial.

    Attributes:
        scene: What is run.
        seed: The trial's seed.
        plant: Moves the units.
        world: What the cameras see; None when nobody looks.
        placement: Where everything was set down.
        clearance: Shapes of everything.
        encoders: Of every unit; they go on counting from step to step.
        links: Command link of every unit.
        bonds: Pairs that are locked together, or may touch for another good reason.
        locked: Units whose locks have to hold from now on: those that earlier steps docked.
        cameras: Cameras that have looked so far, by name; a step of the plan finds those of the steps before
            it, so that frames are counted, and their luck drawn, through the whole trial.
        localisation: The same of what global localisation gets wrong; its drift goes on.
    """

    scene: Scene
    seed: int
    plant: Plant
    world: BulletWorld | None
    placement: Placement
    clearance: ClearanceModel
    encoders: dict[str, WheelEncoders]
    links: dict[str, CommandLink]
    bonds: set[Pair] = field(default_factory=set)
    locked: list[str] = field(default_factory=list)
    cameras: dict[str, Camera] = field(default_factory=dict)
    localisation: LocalisationError | None = None
    _streams: dict[str, np.random.Generator] = field(default_factory=dict)
    _frames: dict[str, Iterator[int]] = field(default_factory=dict)

    def stream(self, name: str) -> np.random.Generator:
        """Return the one generator that the trial has of this name; whoever asks again goes on drawing."""
        return self._streams.setdefault(name, stream(self.seed, name))

    def frames(self, camera: str) -> Iterator[int]:
        """Return the numbers of the frames to come of a camera that is a model."""
        return self._frames.setdefault(camera, count())

    def camera(self, name: str, spec: CameraSpec, pose: Callable[[], SE3]) -> Camera:
        """Return the rendered camera of this name, new or as earlier steps left it.

        Args:
            name: ``overhead`` or ``<unit>/onboard``.
            spec: Its optics, noise, blur, dropout.
            pose: Gives the true ``X_WC``.
        """
        if name not in self.cameras:
            self.cameras[name] = Camera(name, spec, self._renderer(spec), pose, self.seed, self.scene.faults)
        return self.cameras[name]

    def locks_hold(self) -> bool:
        """Say whether all units that were docked by earlier steps still are."""
        return all(self.plant.lock_engaged(unit) for unit in self.locked)

    def poses(self) -> dict[str, SE2]:
        """Return the true pose of everything that is there now, by name."""
        now_s = seconds(self.plant.now_ns())
        poses = {unit: self.plant.pose(unit) for unit in self.scene.units}
        for name, X_WB in self.placement.obstacles.items():
            if self.scene.obstacles[name].appears_at_s <= now_s:
                poses[name] = X_WB
        return poses

    def _renderer(self, camera: CameraSpec) -> Renderer:
        """Build the renderer that a camera asks for."""
        assert self.world is not None, "a trial with images has a world"
        return build_renderer(camera.renderer, RenderContext(self.world.client, camera.samples))


@contextmanager
def open_stage(scene: Scene, seed: int, placement: Placement) -> Iterator[Stage]:
    """Build the plant a scene asks for, and the world that its cameras see."""
    with ExitStack() as stack:
        world = None
        if scene.plant == "bullet" or scene.perception == "images":
            dressing = None
            if scene.perception == "images":
                folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="msrr-"))
                dressing = TagVisuals(scene, Path(folder))
            world = stack.enter_context(BulletWorld(scene, placement, dressing=dressing))
        plant: Plant
        if scene.plant == "bullet":
            assert world is not None
            plant = BulletPlant(world)
        else:
            plant = KinematicPlant(scene, placement, world)
        yield Stage(
            scene=scene,
            seed=seed,
            plant=plant,
            world=world,
            placement=placement,
            clearance=ClearanceModel(scene),
            encoders={
                unit: WheelEncoders(unit, scene.odometry, stream(seed, f"unit/{unit}/odometry"))
                for unit in scene.units
            },
            links={unit: CommandLink(scene.link, stream(seed, f"unit/{unit}/link")) for unit in scene.units},
        )
