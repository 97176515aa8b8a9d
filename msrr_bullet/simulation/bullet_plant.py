"""The plant with contact: units, pins and locks in PyBullet."""

from __future__ import annotations

from collections.abc import Sequence

from msrr_bullet.plant.plant import Plant
from msrr_bullet.simulation.pin_lock import PinLock
from msrr_bullet.simulation.port_plug import PortPlug
from msrr_bullet.simulation.wheel_motors import WheelMotors
from msrr_bullet.simulation.world import BulletWorld
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.messages import Twist
from msrr_scenes.specs.plan import DockStep


class BulletPlant(Plant):
    """A plant in which units dock by contact."""

    def __init__(self, world: BulletWorld) -> None:
        """Take over ``world``; :meth:`close` closes it."""
        super().__init__(world.scene)
        self.world = world
        self._motors = {
            name: WheelMotors(world.client, unit, world.scene.motors) for name, unit in world.units.items()
        }
        self._locks: dict[str, PinLock] = {}
        self._parting: list[PinLock] = []
        self._plugs: dict[tuple[str, str], PortPlug] = {}

    def step(self) -> None:
        """Advance by one tick: drives, physics, locks."""
        for name, motors in self._motors.items():
            motors.drive(self._drives[name].step(self._commands[name], self._dt))
        self._advance()

    def step_freewheeling(self) -> None:
        """Advance by one tick with all wheels released."""
        for motors in self._motors.values():
            motors.release()
        self._advance()

    def pose(self, unit: str) -> SE2:
        """Return the true ``X_WU``."""
        return self.world.pose(unit)

    def pose3(self, unit: str) -> SE3:
        """Return the true ``X_WU`` with pitch, roll and height."""
        return self.world.pose3(unit)

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
            self._plugs[key] = PortPlug(self.world, unit, port)
        elif not present and key in self._plugs:
            self._plugs.pop(key).remove()

    def close(self) -> None:
        """Close the world."""
        self.world.close()

    def _build_mechanism(self, step: DockStep) -> PinLock:
        lock = PinLock(self.world, step, self._scene.lock, self)
        if step.unit in self._locks:
            self._parting.append(self._locks[step.unit])
        self._locks[step.unit] = lock
        return lock

    def _advance(self) -> None:
        self.world.step()
        self.tick += 1
        for lock in (*self._locks.values(), *self._parting):
            lock.step(self._dt)
        self._parting = [lock for lock in self._parting if not lock.parted]
        self.world.reveal(self.tick / self._scene.physics_hz)
