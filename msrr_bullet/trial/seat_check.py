"""The check that robots fit together when they are docked, by the shapes that the physics has of them."""

from __future__ import annotations

from msrr_bullet.silent_pybullet import pybullet
from msrr_bullet.simulation.world import BulletWorld
from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.loading.mechanism_checks import docking_pairs
from msrr_scenes.specs.scene import Scene

#: Largest depth by which shapes of a seated pair may overlap [m]. With a bar 1 mm ahead of the face robots
#: docked, and with one of 2 mm they did not.
_DEEPEST_M = 1.2e-3


def check_seats(scene: Scene, world: BulletWorld) -> None:
    """Refuse robots whose shapes would overlap in the seat; it moves them.

    Raises:
        SceneError: The message names the pair, and where it meets.
    """
    for unit, port, target, target_port in docking_pairs(scene):
        X_TD = scene.geometry(target).dock_frame(target_port)
        X_TU = X_TD @ scene.geometry(unit).port(port).inverse()
        world.place(target, SE2(), (0.0, 0.0))
        world.place(unit, X_TU, (0.0, 0.0))
        touching = pybullet.getClosestPoints(
            world.unit(unit).body, world.unit(target).body, 0.0, physicsClientId=world.client
        )
        depth, place = max(((-point[8], point[6]) for point in touching), default=(0.0, None))
        if place is not None and depth > _DEEPEST_M:
            at = X_TD.inverse().act([place[:2]])[0]
            side = f"{1e3 * abs(at[1]):.0f} mm {'left' if at[1] > 0.0 else 'right'} of the axis"
            raise SceneError(
                f"{unit} at {target}.{target_port}: seated they would overlap by {1e3 * depth:.1f} mm, "
                f"{1e3 * at[0]:z.0f} mm behind the face of {target}, {side} and {1e3 * place[2]:.0f} mm up. "
                "Move that collision shape back, or the frames of the ports forward"
            )
