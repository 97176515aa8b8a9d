"""The check that robots fit together when they dock, by the shapes that the physics has of them."""

from __future__ import annotations

from msrr_bullet.silent_pybullet import pybullet
from msrr_bullet.simulation.world import BulletWorld
from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.specs.scene import Scene

#: Largest depth by which shapes of a seated pair may overlap [m]. With a bar 1 mm ahead of the face robots
#: docked, and with one of 2 mm they did not.
_DEEPEST_M = 1.2e-3

#: Distances of the two faces that are looked at [m]: the seat, then the straight way to it.
_GAPS_M = (0.0, *(1e-3 * k for k in range(150, 0, -1)))


def check_seats(scene: Scene, world: BulletWorld) -> None:
    """Refuse robots whose shapes would overlap in the seat, or on the straight way to it; it moves them.

    Raises:
        SceneError: The message names the pair, and where it meets.
    """
    for dock in scene.possible_docks:
        unit, target = dock.unit, dock.target_unit
        X_TD, X_UP = scene.dock_frame(dock), scene.geometry(unit).port(dock.port)
        world.place(target, SE2(), (0.0, 0.0))
        for gap in _GAPS_M:
            world.place(unit, X_TD @ SE2(-gap) @ X_UP.inverse(), (0.0, 0.0))
            touching = pybullet.getClosestPoints(
                world.unit(unit).body, world.unit(target).body, 0.0, physicsClientId=world.client
            )
            depth, place = max(((-point[8], point[6]) for point in touching), default=(0.0, None))
            if place is not None and depth > _DEEPEST_M:
                at = X_TD.inverse().act([place[:2]])[0]
                where = f"{1e3 * gap:.0f} mm before the seat" if gap else "seated"
                side = f"{1e3 * abs(at[1]):.0f} mm {'left' if at[1] > 0.0 else 'right'} of the axis"
                raise SceneError(
                    f"{unit} at {dock.to}: {where} they would overlap by "
                    f"{1e3 * depth:.1f} mm, {1e3 * at[0]:z.0f} mm behind the face of {target}, {side} and "
                    f"{1e3 * place[2]:.0f} mm up. Move that collision shape out of the way, or the frames of "
                    "the ports forward"
                )
