"""The check that robots stand still while their wheels are braked, as the physics has them."""

from __future__ import annotations

import math

from msrr_bullet.silent_pybullet import pybullet
from msrr_bullet.simulation.floor import levelled
from msrr_bullet.simulation.unit_body import UnitBody
from msrr_bullet.simulation.world import BulletWorld
from msrr_scenes.errors import SceneError

#: Time for which the robots stand [s], and how far one may move and tilt in it [m, rad]. Of 245 robots those
#: that stood moved by less than 0.1 mm; those with a joint that PyBullet cannot simulate, by more than 20 mm.
_TIME_S, _MOVED_M, _TILT_RAD = 0.25, 1e-3, math.radians(2.0)


def check_stance(world: BulletWorld) -> None:
    """Refuse robots that do not stand still where they are; simulated time passes in the world.

    The floor is level for that time. On one with ridges nothing is checked: there any robot may slip off one.

    Raises:
        SceneError: The message names the unit, how it moved, and the joints that it may be due to.
    """
    if world.built.floor.ridge_m > 0.0:
        return
    before = {name: world.pose(name) for name in world.units}
    with levelled(world.client):
        for _ in range(round(_TIME_S * world.scene.physics_hz)):
            world.step()
    for name, unit in world.units.items():
        X_WU = world.pose3(name)
        moved = math.dist(X_WU.p[:2], (before[name].x, before[name].y))
        tilt = math.acos(min(max(float(X_WU.R[2, 2]), -1.0), 1.0))
        if moved <= _MOVED_M and tilt <= _TILT_RAD:
            continue
        joints = ", ".join(_moving_joints(world, unit)) or "none here"
        raise SceneError(
            f"{unit.geometry.urdf}: {name} does not stand still; in {_TIME_S:g} s with its wheels braked it "
            f"moved by {1e3 * moved:.0f} mm and tilted by {math.degrees(tilt):.0f} deg. Either it tips over, "
            "or PyBullet cannot simulate a joint whose damping is large for the inertia that it carries "
            f"({joints}): lower the damping, or make the joint fixed"
        )


def _moving_joints(world: BulletWorld, unit: UnitBody) -> list[str]:
    """Return the names of the joints of a unit that are neither fixed nor those of the driven wheels."""
    about = (
        pybullet.getJointInfo(unit.body, joint, physicsClientId=world.client)
        for joint in range(pybullet.getNumJoints(unit.body, physicsClientId=world.client))
    )
    return [
        info[1].decode() for info in about if info[2] != pybullet.JOINT_FIXED and info[0] not in unit.wheels
    ]
