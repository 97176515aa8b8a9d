"""The lock: pins that are caught at the bottom of their holes, a cam, and the pull that proves it.

The cam only does what a cam can do. It takes its time to close, it then says that it is closed, and it holds
something only if the pins were in its reach. What it holds becomes a fixed constraint between the two bodies,
built from their measured relative pose: one built from the ideal pose would snap across the play of the pins.
The lock gives way when the tension in that constraint passes its strength. (A cap on the constraint's own
force would not do: PyBullet caps each axis of the world by itself, so a lock would be up to 1.4 times as
strong in one heading as in another.)
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
import pybullet

from msrr_bullet.plant.lock_actuator import CAM_REACH, PULL_SLACK, SWITCH_TRAVEL, LockActuator, PullResult
from msrr_bullet.simulation.unit_body import ROOT, UnitBody
from msrr_bullet.simulation.world import BulletWorld
from msrr_scenes.arrays import Array
from msrr_scenes.errors import GeometryError
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.messages import LockPosition
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.vehicle import LockSpec

SIDES = ("left", "right")
#: Cap on the constraint's force on each axis [N]: far above any load, so that the strength alone decides.
WELD_FORCE = 1e4
#: Bodies may touch again after unlocking once they overlap by less than this [m].
RELEASE_OVERLAP = 0.0002


class Rig(Protocol):
    """What a pull test needs besides the two bodies: wheels that roll freely, and time that goes on."""

    def step_freewheeling(self) -> None:
        """Advance the plant by one tick with all wheels released."""
        ...


class PinLock:
    """The mechanism between one active port and one passive port in PyBullet."""

    def __init__(self, world: BulletWorld, step: DockStep, spec: LockSpec) -> None:
        """Look up the pins of the docking unit and the holes of the port it docks to.

        Raises:
            GeometryError: A URDF has no pins, or no holes at that port.
        """
        self._world = world
        self.dock_step = step
        self._spec = spec
        self._cam = LockActuator(spec.close_time_s)
        self._unit, self._target = world.unit(step.unit), world.unit(step.target_unit)
        names = [(f"pin_{side}", f"port_{step.target_port}_hole_{side}") for side in SIDES]
        for pin, hole in names:
            if pin not in self._unit.links or hole not in self._target.links:
                raise GeometryError(
                    f"{step.unit} -> {step.to}: the URDFs need the links {pin!r} and {hole!r}"
                )
        self._pairs = tuple((self._unit.link(pin), self._target.link(hole)) for pin, hole in names)
        self._constraint: int | None = None
        self._apart = False

    @property
    def position(self) -> LockPosition:
        """What the cam's encoder says."""
        return self._cam.position

    @property
    def engaged(self) -> bool:
        """Truth: the lock holds the other unit."""
        return self._constraint is not None

    @property
    def settled(self) -> bool:
        """The two units are free of each other: not held, and in contact again wherever they touch."""
        return not self.engaged and not self._apart

    def switches(self) -> tuple[bool, bool]:
        """State of the two seat switches (left, right): is the pin close to the bottom of its hole?"""
        left, right = (self._depth_left(i) <= SWITCH_TRAVEL for i in range(2))
        return left, right

    def pins_touch(self, in_the_holes: Sequence[int] = ()) -> bool:
        """Say whether a pin touches the unit that is docked to: its walls, its face, or a seat switch.

        A pin that is well aligned enters without touching anything before the switch.

        Args:
            in_the_holes: Bodies that stop up the holes and count as part of the port.
        """
        return any(self.switches()) or any(
            contact[8] <= 0.0 or contact[9] > 0.0
            for pin, _ in self._pairs
            for body in (self._target.body, *in_the_holes)
            for contact in pybullet.getContactPoints(
                bodyA=self._unit.body,
                bodyB=body,
                linkIndexA=pin,
                physicsClientId=self._world.client,
            )
        )

    def command(self, close: bool) -> None:
        """Close the cam, or open it and let go."""
        self._cam.command(close)
        if not close:
            self._let_go()

    def tension_n(self) -> float:
        """Return the force with which the lock kept the units together in the last tick [N]; < 0: apart."""
        if self._constraint is None:
            return 0.0
        force = pybullet.getConstraintState(self._constraint, physicsClientId=self._world.client)
        axis, _ = self._axis()
        return float(axis @ np.array(force[:3]))

    def step(self, dt: float) -> None:
        """Advance the cam by ``dt`` [s] after the physics has been stepped; an overloaded lock gives way."""
        if self.tension_n() > self._spec.strength_n:
            self._let_go()
        if self._cam.step(dt) and all(self._depth_left(i) <= CAM_REACH for i in range(2)):
            self._engage()
        # Contact comes back only where it finds nothing to push apart.
        if self._apart and not self.engaged and self._overlap() < RELEASE_OVERLAP:
            self._let_collide(True)

    def pull_test(self, rig: Rig) -> PullResult:
        """Pull the two units apart along the docking axis and measure by how much they come apart.

        The wheels roll freely meanwhile, or the floor would hold what the lock does not.
        """
        spec = self._spec
        hz = self._world.scene.physics_hz
        start = self._gap()
        opened = 0.0
        for _ in range(max(round(spec.pull_time_s * hz), 1)):
            axis, point = self._axis()
            for unit, sign in ((self._unit, -1.0), (self._target, 1.0)):
                self._push(unit, sign * spec.pull_force_n * axis, point)
            rig.step_freewheeling()
            opened = max(opened, self._gap() - start)
            if opened > PULL_SLACK:
                self._let_go()
                break
        return PullResult(spec.pull_force_n, opened, self.engaged)

    def _let_go(self) -> None:
        if self._constraint is not None:
            pybullet.removeConstraint(self._constraint, physicsClientId=self._world.client)
            self._constraint = None

    def _depth_left(self, pair: int) -> float:
        """Distance of a pin's tip to the bottom of its hole [m], infinite beyond the cam's reach."""
        pin, hole = self._pairs[pair]
        points = pybullet.getClosestPoints(
            self._unit.body,
            self._target.body,
            CAM_REACH,
            linkIndexA=pin,
            linkIndexB=hole,
            physicsClientId=self._world.client,
        )
        return min((float(point[8]) for point in points), default=float("inf"))

    def _engage(self) -> None:
        X_WP = SE3.from_se2(self._world.pose(self.dock_step.unit)) @ self._unit.geometry.frame(
            f"port_{self.dock_step.port}"
        )
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
        pybullet.changeConstraint(self._constraint, maxForce=WELD_FORCE, physicsClientId=self._world.client)
        # The weld takes over from the contact: a tenth of a millimetre of overlap would fight it.
        self._let_collide(False)

    def _let_collide(self, collide: bool) -> None:
        for a in self._unit.links.values():
            for b in self._target.links.values():
                pybullet.setCollisionFilterPair(
                    self._unit.body, self._target.body, a, b, int(collide), physicsClientId=self._world.client
                )
        self._apart = not collide

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

    def _axis(self) -> tuple[Array, Array]:
        """Docking axis, into the target, and the middle of its holes, in W; shapes (3,)."""
        target, port = self.dock_step.target_unit, f"port_{self.dock_step.target_port}"
        X_WP = self._world.link_pose(target, port)
        holes = [self._world.link_pose(target, f"{port}_hole_{side}").p for side in SIDES]
        return -X_WP.R[:, 0], np.mean(holes, axis=0)

    def _gap(self) -> float:
        """Distance of the two faces along the docking axis [m]."""
        axis, _ = self._axis()
        own = self._world.link_pose(self.dock_step.unit, f"port_{self.dock_step.port}").p
        other = self._world.link_pose(self.dock_step.target_unit, f"port_{self.dock_step.target_port}").p
        return float(axis @ (other - own))

    def _push(self, unit: UnitBody, force: Array, point: Array) -> None:
        pybullet.applyExternalForce(
            unit.body,
            ROOT,
            force.tolist(),
            point.tolist(),
            pybullet.WORLD_FRAME,
            physicsClientId=self._world.client,
        )
