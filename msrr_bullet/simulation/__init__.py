"""The simulation in PyBullet: world, units, obstacles, tags, pin lock, and the plant with contact."""

from msrr_bullet.simulation.bullet_plant import BulletPlant
from msrr_bullet.simulation.simulation import Simulation, open_simulation
from msrr_bullet.simulation.tagged_bodies import TagVisuals
from msrr_bullet.simulation.world import BulletWorld

__all__ = [
    "BulletPlant",
    "BulletWorld",
    "Simulation",
    "TagVisuals",
    "open_simulation",
]
