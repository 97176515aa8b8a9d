"""The port mechanism with contact: pins, seat switches, a lock, and the pull test.

The lock takes time to close, and it holds the other unit only if both pins are in reach when it becomes
closed. A lock that holds is a fixed constraint between the two bodies, built from their measured relative
pose: one built from the ideal pose would make the units jump by the play of the pins. The lock fails when the
tension in the constraint exceeds its strength. (A limit on the force of the constraint would not do: PyBullet
limits each axis of the world separately, so the strength would depend on the heading by a factor of 1.4.)
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from msrr_bullet.plant.lock_actuator import LOCK_REACH
from msrr_bullet.plant.plant import PortMechanism
from msrr_bullet.silent_pybullet import pybullet
from msrr_bullet.simulation.floor import levelled
from msrr_bullet.simulation.pin_depth import SIDES, PinDepths
from msrr_bullet.simulation.solver import exact_forces
from msrr_bullet.simulation.unit_body import ROOT, UnitBody
from msrr_bullet.simulation.world import BulletWorld
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.pin_and_hole import bounds
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.vehicle import LockSpec

if TYPE_CHECKING:  # it imports this module
    from msrr_bullet.simulation.bullet_plant import BulletPlant

#: Largest force of the constraint on each axis [N]: far above any load, so that the strength alone decides.
MAX_CONSTRAINT_FORCE = 1e4
#: A lock whose units come apart by this much under the pull has failed [m].
MAX_PULL_DISPLACEMENT = 0.002
#: After unlocking, contact between the units is restored once they overlap by less than this [m].
RELEASE_OVERLAP = 0.0002


class PinLock(PortMechanism):
    """The mechanism between an active port and a passive port in PyBullet."""

    def __init__(
        self, world: BulletWorld, step: DockStep, spec: LockSpec, plant: BulletPlant, switch_travel: float
    ) -> None:
        """Look up the pins of the docking unit and the holes of the port that it docks to.

        The seat switches close at the distance ``switch_travel`` from the bottom of the hole [m].

        Raises:
            GeometryError: A URDF has no pins, or no holes at the passive port.
        """
        super().__init__(step, spec, switch_travel)
        self._world = world
        self._plant = plant
        self._unit, self._target = world.unit(step.unit), world.unit(step.target_unit)
        self._depths = PinDepths(world, step, max(LOCK_REACH, switch_travel))
        self._X_UP = self._unit.geometry.frame(f"port_{step.port}")
        port = f"port_{step.target_port}"
        self._X_TP = self._target.geometry.frame(port)
        holes = [bounds(self._target.geometry, f"{port}_hole_{side}", SE3()) for side in SIDES]
        drawn = [hole.mean(axis=0) for hole in holes if hole is not None]
        self._X_TH = SE3(self._X_TP.R, np.mean(drawn, axis=0).round(9))  # in the middle of the holes
        self._constraint: int | None = None
        self._contact_disabled = False

    @property
    def engaged(self) -> bool:
        """Whether the lock holds the other unit."""
        return self._constraint is not None

    @property
    def parted(self) -> bool:
        """Whether the lock holds nothing and contact between the two units is restored."""
        return not self.engaged and not self._contact_disabled

    @property
    def in_reach(self) -> bool:
        """Whether the lock would hold the other unit if it became closed now: both pins are in its reach."""
        return all(depth <= LOCK_REACH for depth in self._depths.left())

    def switches(self) -> tuple[bool, bool]:
        """Return whether the seat switches (left, right) are closed: pins near the bottom of the holes."""
        left, right = (depth <= self._switch_travel for depth in self._depths.left())
        return left, right

    def pins_touch(self) -> bool:
        """Return whether a pin touches the other unit (walls, face, seat switch) or a plug in the port.

        A well-aligned pin enters the hole without touching anything before the switch.
        """
        plugs = self._plant.plug_bodies(self.dock_step.target_unit, self.dock_step.target_port)
        return any(self.switches()) or any(
            contact[8] <= 0.0 or contact[9] > 0.0
            for pin in self._depths.pins
            for body in (self._target.body, *plugs)
            for contact in pybullet.getContactPoints(
                bodyA=self._unit.body,
                bodyB=body,
                linkIndexA=pin,
                physicsClientId=self._world.client,
            )
        )

    def tension_n(self) -> float:
        """Return the force with which the lock pulled the units together in the last tick [N].

        It is negative when the lock pushed them apart, and 0 when it holds nothing.
        """
        if self._constraint is None:
            return 0.0
        axis, _ = self._docking_axis()
        return float(axis @ np.array(self._force(self._constraint)))

    def _force(self, constraint: int) -> tuple[float, float, float]:
        """Return the force of the constraint in the last tick, in W [N]."""
        force = pybullet.getConstraintState(constraint, physicsClientId=self._world.client)
        return force[0], force[1], force[2]

    def _is_overloaded(self, constraint: int) -> bool:
        x, y, z = self._force(constraint)
        # No component is larger than the force itself, which nearly always decides without the axis.
        if x * x + y * y + z * z <= self._spec.strength_n**2:
            return False
        return self.tension_n() > self._spec.strength_n

    def step(self, dt: float) -> None:
        """Advance the lock by ``dt`` [s] after the physics has been stepped; an overloaded lock fails."""
        if self._constraint is not None and self._is_overloaded(self._constraint):
            self._release()
        if self._actuator.step(dt):
            self._catch()
        # Units that still overlap would be thrown apart by the contact.
        if self._contact_disabled and not self.engaged and self._overlap() < RELEASE_OVERLAP:
            self._set_contact(True)

    def pull_test(self) -> bool:
        """Pull the two units apart along the docking axis, until they come apart or the time is over.

        The wheels roll freely during the test; otherwise the floor could hold units that the lock does not.
        Where the floor slopes, whoever pulls keeps the units from rolling down.
        """
        spec = self._spec
        hz = self._world.scene.physics_hz
        start = self._gap()
        client = self._world.client
        with levelled(client), exact_forces(client):
            for _ in range(max(round(spec.pull_time_s * hz), 1)):
                self._plant.rouse(self.dock_step.unit, self.dock_step.target_unit)
                axis, point = self._docking_axis()
                for unit, sign in ((self._unit, -1.0), (self._target, 1.0)):
                    self._push(unit, sign * spec.pull_force_n * axis, point)
                self._plant.step_freewheeling()
                if self._gap() - start > MAX_PULL_DISPLACEMENT:
                    self._release()
                    break
        return self.engaged

    def _release(self) -> None:
        if self._constraint is not None:
            pybullet.removeConstraint(self._constraint, physicsClientId=self._world.client)
            self._constraint = None

    def _catch(self) -> None:
        if not self.in_reach:
            return
        X_WP = SE3.from_se2(self._world.pose(self.dock_step.unit)) @ self._X_UP
        parent, child = (self._root_pose(unit).inverse() @ X_WP for unit in (self._unit, self._target))
        self._constraint = pybullet.createConstraint(
            self._unit.body,
            ROOT,
            self._target.body,
            ROOT,
            pybullet.JOINT_FIXED,
            [0.0, 0.0, 0.0],
            parent.p.tolist(),
            child.p.tolist(),
            parent.quaternion_xyzw().tolist(),
            child.quaternion_xyzw().tolist(),
            physicsClientId=self._world.client,
        )
        pybullet.changeConstraint(
            self._constraint, maxForce=MAX_CONSTRAINT_FORCE, physicsClientId=self._world.client
        )
        # Contact is disabled, because an overlap of 0.1 mm would work against the constraint.
        self._set_contact(False)

    def _set_contact(self, enabled: bool) -> None:
        for a in self._unit.links.values():
            for b in self._target.links.values():
                pybullet.setCollisionFilterPair(
                    self._unit.body, self._target.body, a, b, int(enabled), physicsClientId=self._world.client
                )
        self._contact_disabled = not enabled

    def _overlap(self) -> float:
        points = pybullet.getClosestPoints(
            self._unit.body, self._target.body, 0.0, physicsClientId=self._world.client
        )
        return max((-float(point[8]) for point in points), default=0.0)

    def _root_pose(self, unit: UnitBody) -> SE3:
        position, quaternion = pybullet.getBasePositionAndOrientation(
            unit.body, physicsClientId=self._world.client
        )
        return SE3.from_quaternion_xyzw(position, quaternion)

    def _docking_axis(self) -> tuple[Array, Array]:
        """Return the docking axis into the target and the middle of the holes [m], in W, shapes (3,)."""
        middle, out, _ = self._world.frame(self.dock_step.target_unit, self._X_TH)
        return -np.array(out), np.array(middle)

    def _gap(self) -> float:
        """Return the distance between the two faces along the docking axis [m]."""
        own, _, _ = self._world.frame(self.dock_step.unit, self._X_UP)
        face, out, _ = self._world.frame(self.dock_step.target_unit, self._X_TP)
        return sum(axis * (a - b) for axis, a, b in zip(out, own, face, strict=True))

    def _push(self, unit: UnitBody, force: Array, point: Array) -> None:
        pybullet.applyExternalForce(
            unit.body,
            ROOT,
            force.tolist(),
            point.tolist(),
            pybullet.WORLD_FRAME,
            physicsClientId=self._world.client,
        )
