"""The plant with contact: units, pins and locks in PyBullet."""

from __future__ import annotations

from collections.abc import Sequence

from msrr_bullet.plant.plant import Plant, Vector
from msrr_bullet.simulation.pin_lock import PinLock
from msrr_bullet.simulation.port_plug import PortPlug
from msrr_bullet.simulation.sleeping import SleepingUnits
from msrr_bullet.simulation.wheel_motors import WheelMotors, is_standstill
from msrr_bullet.simulation.world import BulletWorld
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.messages import LockPosition, Twist, seconds
from msrr_scenes.specs.plan import DockStep


class BulletPlant(Plant):
    """A plant in which units dock by contact."""

    def __init__(self, world: BulletWorld) -> None:
        """Move the units of ``world``, which whoever made it closes."""
        super().__init__(world.scene, world.built)
        self.world = world
        self._motors = {
            name: WheelMotors(world.client, unit, world.scene.motors) for name, unit in world.units.items()
        }
        self._locks: dict[str, PinLock] = {}
        self._parting: list[PinLock] = []
        self._plugs: dict[tuple[str, str], PortPlug] = {}
        self._sleeping = SleepingUnits(world)
        self._engaged: list[PinLock] = []

    def step(self) -> None:
        """Advance by one tick: drives, physics, locks."""
        self._sleeping.step(self._is_driven)
        for name in self._sleeping.awake:
            velocity, drivetrain = self._drive(name), self._drivetrains[name]
            speeds = drivetrain.step(velocity, self._dt)
            self._motors[name].drive(speeds, held=is_standstill(velocity) and drivetrain.at_rest)
        self._advance()

    def step_freewheeling(self) -> None:
        """Advance by one tick with all wheels released."""
        self._sleeping.watch()
        for name in self._sleeping.awake:
            self._motors[name].release()
        self._advance()

    def command(self, unit: str, twist: Twist) -> None:
        """Command a velocity to the drive of ``unit``, and wake it if it is to move."""
        super().command(unit, twist)
        if twist.v or twist.w:
            self._sleeping.rouse(unit)

    def set_lock(self, unit: str, close: bool) -> None:
        """Close the lock of ``unit``, or open it, and wake the units that it may hold."""
        lock = self._mechanism(unit)
        if lock.position is not (LockPosition.CLOSED if close else LockPosition.OPEN):
            self.rouse(unit, lock.dock_step.target_unit)
        lock.command(close)

    def rouse(self, *units: str) -> None:
        """Wake units, and all that are locked to them, before a force or a constraint acts on them."""
        for unit in units:
            self._sleeping.rouse(unit)

    def is_asleep(self, unit: str) -> bool:
        """Return whether a unit stands still and is left out of the physics until something may move it."""
        return self._sleeping.is_asleep(unit)

    def pose(self, unit: str) -> SE2:
        """Return the true ``X_WU``."""
        return self.world.pose(unit)

    def pose3(self, unit: str) -> SE3:
        """Return the true ``X_WU`` with pitch, roll and height."""
        return self.world.pose3(unit)

    def frame(self, unit: str, X_UF: SE3) -> tuple[Vector, Vector, Vector]:
        """Return origin [m], x axis and y axis in W of a frame that is fixed to a unit."""
        return self.world.frame(unit, X_UF)

    def wheel_angles(self, unit: str) -> tuple[float, float]:
        """Return the true angles of the left and the right wheel [rad]."""
        return self.world.wheel_angles(unit)

    def twist(self, unit: str) -> Twist:
        """Return the velocity of frame U, expressed in U."""
        return self.world.twist(unit)

    def plug_bodies(self, unit: str, port: str) -> Sequence[int]:
        """Return the PyBullet ids of the bodies that plug a passive port."""
        plug = self._plugs.get((unit, port))
        return plug.bodies if plug else ()

    def set_plug(self, unit: str, port: str, present: bool) -> None:
        """Plug the holes of a passive port, or clear them."""
        key = (unit, port)
        if present and key not in self._plugs:
            self.rouse(unit)
            self._plugs[key] = PortPlug(self.world, unit, port)
        elif not present and key in self._plugs:
            self.rouse(unit)
            self._plugs.pop(key).remove()

    def is_plugged(self, unit: str, port: str) -> bool:
        """Return whether something plugs the holes of a passive port now."""
        return (unit, port) in self._plugs

    def _build_mechanism(self, step: DockStep) -> PinLock:
        lock = PinLock(self.world, step, self._scene.lock, self, self._switch_travel(step))
        if step.unit in self._locks:
            self._parting.append(self._locks[step.unit])
        self._locks[step.unit] = lock
        return lock

    def _take_plugs_along(self) -> None:
        for (unit, _), plug in self._plugs.items():
            if not self.is_asleep(unit):
                plug.follow()

    def _advance(self) -> None:
        if self._plugs:
            self._take_plugs_along()
        self.world.step()
        self.tick += 1
        engaged = []
        for lock in self._locks.values():
            lock.step(self._dt)
            if lock.engaged:
                engaged.append(lock)
        for lock in self._parting:
            lock.step(self._dt)
        if engaged != self._engaged:
            self._engaged = engaged
            self._sleeping.join((lock.dock_step.unit, lock.dock_step.target_unit) for lock in engaged)
        if self._parting:
            self._parting = [lock for lock in self._parting if not lock.parted]
        self.world.reveal(seconds(self.now_ns()))

    def _is_driven(self, unit: str) -> bool:
        """Return whether the drive of a unit is commanded to move or has not come to rest."""
        command = self._commands[unit]
        if command.v or command.w or not is_standstill(self._drives[unit].velocity):
            return True
        return not self._drivetrains[unit].at_rest
