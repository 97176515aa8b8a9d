"""The floor: a plane that bodies stand on, with friction, slope and ridges as it was built."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager

from msrr_bullet.silent_pybullet import pybullet
from msrr_bullet.simulation.unit_body import ROOT
from msrr_scenes.as_built import JOINT_SPACING_M, BuiltFloor
from msrr_scenes.specs.bodies import ArenaSpec

GRAVITY_MPS2 = 9.80665
#: Friction of the floor; PyBullet multiplies it with that of the other body.
FLOOR_FRICTION = 1.0
#: Width of a ridge [m]: that of a joint between two boards.
RIDGE_WIDTH_M = 0.006


def gravity(floor: BuiltFloor) -> tuple[float, float, float]:
    """Return the gravity in W [m/s^2]. The floor is the plane z = 0 of W: where it slopes, gravity leans."""
    x, y = (math.tan(angle) for angle in floor.slope)
    length = math.sqrt(1.0 + x * x + y * y)
    return -GRAVITY_MPS2 * x / length, -GRAVITY_MPS2 * y / length, -GRAVITY_MPS2 / length


@contextmanager
def levelled(client: int) -> Iterator[None]:
    """Keep the floor of a client from sloping within the block: gravity acts at right angles to it."""
    engine = pybullet.getPhysicsEngineParameters(physicsClientId=client)
    x, y, z = (engine[f"gravityAcceleration{axis}"] for axis in "XYZ")
    pybullet.setGravity(0.0, 0.0, z, physicsClientId=client)
    try:
        yield
    finally:
        pybullet.setGravity(x, y, z, physicsClientId=client)


def add_floor(client: int, floor: BuiltFloor, arena: ArenaSpec) -> int:
    """Add the floor to a client and return the id of its plane. No camera sees it: renderers have a floor.

    Ridges, if it has any, are in the rectangle of the arena.
    """
    plane = pybullet.createCollisionShape(
        pybullet.GEOM_PLANE, planeNormal=[0.0, 0.0, 1.0], physicsClientId=client
    )
    body = _add(client, plane, [0.0, 0.0, 0.0], floor)
    if floor.ridge_m > 0.0:
        for axis in (0, 1):
            _add_ridges(client, floor, arena, axis)
    return body


def _add_ridges(client: int, floor: BuiltFloor, arena: ArenaSpec, axis: int) -> None:
    """Add a bar at every joint of the floor along an axis of the world, 0 for x and 1 for y."""
    extents, along = (arena.x_m, arena.y_m), 1 - axis
    half, middle = [0.5 * RIDGE_WIDTH_M, 0.5 * RIDGE_WIDTH_M, floor.ridge_m], [0.0, 0.0, 0.0]
    half[along] = 0.5 * (extents[along][1] - extents[along][0])
    middle[along] = 0.5 * (extents[along][0] + extents[along][1])
    bar = pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=half, physicsClientId=client)
    low, high = extents[axis]
    joint = floor.first_joint[axis]
    for k in range(
        math.ceil((low - joint) / JOINT_SPACING_M), math.floor((high - joint) / JOINT_SPACING_M) + 1
    ):
        middle[axis] = joint + k * JOINT_SPACING_M
        _add(client, bar, middle, floor)


def _add(client: int, shape: int, position: list[float], floor: BuiltFloor) -> int:
    # Without a visual shape PyBullet would draw the collision shape; this one is too small to be seen.
    invisible = pybullet.createVisualShape(
        pybullet.GEOM_SPHERE,
        radius=1e-6,
        visualFramePosition=[0.0, 0.0, -1.0],
        physicsClientId=client,
    )
    body: int = pybullet.createMultiBody(
        baseMass=0.0,
        baseCollisionShapeIndex=shape,
        baseVisualShapeIndex=invisible,
        basePosition=position,
        physicsClientId=client,
    )
    friction = floor.friction_scale * FLOOR_FRICTION
    pybullet.changeDynamics(body, ROOT, lateralFriction=friction, physicsClientId=client)
    # PyBullet leaves out the contacts of two bodies that sleep, so of units that sleep on a sleeping floor.
    for state in (pybullet.ACTIVATION_STATE_ENABLE_SLEEPING, pybullet.ACTIVATION_STATE_SLEEP):
        pybullet.changeDynamics(body, ROOT, activationState=state, physicsClientId=client)
    return body
