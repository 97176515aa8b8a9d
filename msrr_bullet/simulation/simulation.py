"""The simulated world of one trial: the plant, the PyBullet world, and the true poses."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

from msrr_bullet.plant.kinematic_plant import KinematicPlant
from msrr_bullet.plant.plant import Plant
from msrr_bullet.simulation.bullet_plant import BulletPlant
from msrr_bullet.simulation.tagged_bodies import TagVisuals
from msrr_bullet.simulation.world import BulletWorld
from msrr_scenes.as_built import AsBuilt, as_designed
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import seconds
from msrr_scenes.placement.placement import Placement
from msrr_scenes.specs.scene import Scene


@dataclass(frozen=True, eq=False)
class Simulation:
    """The true state of a running trial.

    ``built`` is what is not as the scene says, which no robot is told. ``world`` is None when neither the
    plant nor a camera needs one.
    """

    scene: Scene
    built: AsBuilt
    placement: Placement
    plant: Plant
    world: BulletWorld | None

    def poses(self) -> dict[str, SE2]:
        """Return the true ``X_WB`` of every unit and of every obstacle that has appeared."""
        now_s = seconds(self.plant.now_ns())
        poses = {unit: self.plant.pose(unit) for unit in self.scene.units}
        for name, X_WB in self.placement.obstacles.items():
            if self.scene.obstacles[name].appears_at_s <= now_s:
                poses[name] = X_WB
        return poses


@contextmanager
def open_simulation(scene: Scene, placement: Placement, built: AsBuilt | None = None) -> Iterator[Simulation]:
    """Build the plant of a scene and, if a renderer or the plant needs it, the PyBullet world.

    ``built`` is what is not as the scene says; None if all is.
    """
    built = built or as_designed(scene)
    with ExitStack() as stack:
        world = None
        if scene.plant == "bullet" or scene.perception == "images":
            tags = None
            if scene.perception == "images":
                folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="msrr-"))
                cameras = (scene.cameras.onboard, scene.cameras.overhead)
                # Any other renderer may draw what PyBullet holds.
                others = any(spec is not None and spec.renderer.name != "raster" for spec in cameras)
                tags = TagVisuals(scene, Path(folder), built, pybullet_draws=others)
            world = stack.enter_context(BulletWorld(scene, placement, tags=tags, built=built))
        plant: Plant
        if scene.plant == "bullet":
            assert world is not None, "the bullet plant has a world"
            plant = BulletPlant(world)
        else:
            plant = KinematicPlant(scene, placement, world, built=built)
        for step in scene.assembled_docks:
            plant.assemble(step)
        yield Simulation(scene, built, placement, plant, world)
