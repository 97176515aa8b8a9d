"""Everything that steps PyBullet: the world, its bodies, the pin lock, the motors, the plant with contact."""

from msrr_bullet.simulation.bullet_plant import BulletPlant
from msrr_bullet.simulation.camera_mount import camera_pose
from msrr_bullet.simulation.simulation import Simulation, open_simulation
from msrr_bullet.simulation.tagged_bodies import TagVisuals
from msrr_bullet.simulation.world import BulletWorld

__all__ = [
    "BulletPlant",
    "BulletWorld",
    "Simulation",
    "TagVisuals",
    "camera_pose",
    "open_simulation",
]
