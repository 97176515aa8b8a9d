"""Bodies in the holes of a passive port that keep the pins out (the fault ``port_plugged``)."""

from __future__ import annotations

import numpy as np

from msrr_bullet.plant.kinematic_port import PLUG_LENGTH
from msrr_bullet.silent_pybullet import pybullet
from msrr_bullet.simulation.world import BulletWorld
from msrr_scenes.errors import GeometryError
from msrr_scenes.geometry.se3 import SE3

PLUG_RGBA = (0.2, 0.2, 0.2, 1.0)


class PortPlug:
    """Two small fixed bodies at the bottom of the holes of a passive port."""

    def __init__(self, world: BulletWorld, unit: str, port: str) -> None:
        """Place the bodies by the present pose of the unit, which does not collide with them.

        Raises:
            GeometryError: The port has no holes.
        """
        self._client = world.client
        owner = world.unit(unit)
        holes = [s for s in owner.geometry.solids if s.link.startswith(f"port_{port}_hole_")]
        if not holes:
            raise GeometryError(f"unit {unit!r}: port {port!r} has no holes to plug")
        self.bodies: list[int] = []
        for hole in holes:
            # The bottom of a hole is a box whose x axis points out of the face; the plug stands on it.
            thickness, width, height = hole.size
            half = [0.5 * PLUG_LENGTH, 0.5 * width, 0.5 * height]
            X_WH = world.pose3(unit) @ hole.X_UG
            X_WG = X_WH @ SE3(p=np.array([0.5 * (thickness + PLUG_LENGTH), 0.0, 0.0]))
            body: int = pybullet.createMultiBody(
                baseMass=0.0,
                baseCollisionShapeIndex=pybullet.createCollisionShape(
                    pybullet.GEOM_BOX, halfExtents=half, physicsClientId=self._client
                ),
                baseVisualShapeIndex=pybullet.createVisualShape(
                    pybullet.GEOM_BOX, halfExtents=half, rgbaColor=PLUG_RGBA, physicsClientId=self._client
                ),
                basePosition=X_WG.p.tolist(),
                baseOrientation=X_WG.quaternion_xyzw().tolist(),
                physicsClientId=self._client,
            )
            for link in owner.links.values():
                pybullet.setCollisionFilterPair(owner.body, body, link, -1, 0, physicsClientId=self._client)
            self.bodies.append(body)

    def remove(self) -> None:
        """Remove the bodies."""
        while self.bodies:
            pybullet.removeBody(self.bodies.pop(), physicsClientId=self._client)
