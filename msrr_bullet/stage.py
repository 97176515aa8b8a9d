"""What all steps of one trial share: the plant, the world its cameras see, encoders, command links."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from msrr_bullet.bullet_plant import BulletPlant
from msrr_bullet.clearance import ClearanceModel, Pair
from msrr_bullet.link import CommandLink
from msrr_bullet.odometry import WheelEncoders
from msrr_bullet.plant import Plant
from msrr_bullet.render.renderer import RenderContext, Renderer, build_renderer
from msrr_bullet.streams import stream
from msrr_bullet.tag_dressing import TagDressing
from msrr_bullet.unicycle_plant import UnicyclePlant
from msrr_bullet.world import BulletWorld
from msrr_scenes.messages import seconds
from msrr_scenes.placement import Placement
from msrr_scenes.scene import Scene
from msrr_scenes.se2 import SE2
from msrr_scenes.sensors import CameraSpec


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

    def poses(self) -> dict[str, SE2]:
        """Return the true pose of everything that is there now, by name."""
        now_s = seconds(self.plant.now_ns())
        poses = {unit: self.plant.pose(unit) for unit in self.scene.units}
        for name, X_WB in self.placement.obstacles.items():
            if self.scene.obstacles[name].appears_at_s <= now_s:
                poses[name] = X_WB
        return poses

    def renderer(self, camera: CameraSpec) -> Renderer:
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
                dressing = TagDressing(scene, Path(folder))
            world = stack.enter_context(BulletWorld(scene, placement, dressing=dressing))
        plant: Plant
        if scene.plant == "bullet":
            assert world is not None
            plant = BulletPlant(world)
        else:
            plant = UnicyclePlant(scene, placement, world)
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
