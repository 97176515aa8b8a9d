"""Bodies in the holes of a passive port that keep the pins out (the fault ``port_plugged``)."""

from __future__ import annotations

import numpy as np

from msrr_bullet.plant.kinematic_port import PLUG_LENGTH
from msrr_bullet.silent_pybullet import pybullet
from msrr_bullet.simulation.world import BulletWorld
from msrr_scenes.errors import GeometryError
from msrr_scenes.geometry.pin_and_hole import bounds
from msrr_scenes.geometry.se3 import SE3

PLUG_RGBA = (0.2, 0.2, 0.2, 1.0)

#: Motion of the unit above which the plug is placed anew [m, and in the entries of rotation matrices]: where
#: the unit stands the plug stands, so that no contact sees it move.
_MOVED = 1e-4


class PortPlug:
    """Two small bodies at the bottom of the holes of a passive port, which are where the unit takes them.

    The physics takes them for fixed: a pin that pushes them does not push the unit.
    """

    def __init__(self, world: BulletWorld, unit: str, port: str) -> None:
        """Place the bodies by the present pose of the unit, which does not collide with them.

        Raises:
            GeometryError: The port has no holes.
        """
        self._client, self._world, self._unit = world.client, world, unit
        owner = world.unit(unit)
        self._X_WU = X_WU = world.pose3(unit)
        X_UP = owner.geometry.frame(f"port_{port}")
        links = [f"port_{port}_hole_{side}" for side in ("left", "right")]
        holes = [b for link in links if (b := bounds(owner.geometry, link, X_UP.inverse())) is not None]
        if not holes:
            raise GeometryError(f"unit {unit!r}: port {port!r} has no holes to plug")
        self.bodies: list[int] = []
        self._places: list[SE3] = []
        for low, high in holes:
            # The plug stands on the bottom of the hole; x of the port points out of its face.
            _, width, height = high - low
            half = [0.5 * PLUG_LENGTH, 0.5 * width, 0.5 * height]
            middle = 0.5 * (low + high)
            middle[0] = high[0] + 0.5 * PLUG_LENGTH
            X_UG = X_UP @ SE3(p=middle)
            X_WG = X_WU @ X_UG
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
            self._places.append(X_UG)

    def follow(self) -> None:
        """Place the bodies where the unit has moved them."""
        X_WU, before = self._world.pose3(self._unit), self._X_WU
        if max(np.abs(X_WU.p - before.p).max(), np.abs(X_WU.R - before.R).max()) < _MOVED:
            return
        self._X_WU = X_WU
        for body, X_UP in zip(self.bodies, self._places, strict=True):
            X_WP = X_WU @ X_UP
            pybullet.resetBasePositionAndOrientation(
                body, X_WP.p.tolist(), X_WP.quaternion_xyzw().tolist(), physicsClientId=self._client
            )

    def remove(self) -> None:
        """Remove the bodies."""
        while self.bodies:
            pybullet.removeBody(self.bodies.pop(), physicsClientId=self._client)
