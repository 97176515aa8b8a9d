"""The plant with contact: units, pins and locks in PyBullet."""

from __future__ import annotations

from msrr_bullet.plant.limited_drive import LimitedDrive
from msrr_bullet.plant.lock_actuator import PullResult
from msrr_bullet.plant.plant import NoDockError, tick_ns
from msrr_bullet.simulation.pin_lock import PinLock
from msrr_bullet.simulation.port_plug import PortPlug
from msrr_bullet.simulation.wheel_motors import WheelMotors
from msrr_bullet.simulation.world import BulletWorld
from msrr_scenes.errors import MsrrError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.messages import LockPosition, Twist
from msrr_scenes.specs.plan import DockStep


class BulletPlant:
    """A :class:`msrr_bullet.plant.plant.Plant` whose docking is real contact."""

    def __init__(self, world: BulletWorld) -> None:
        """Take over ``world``; :meth:`close` closes it."""
        scene = world.scene
        self.world = world
        self.tick = 0
        self._hz = scene.physics_hz
        self._wishes = dict.fromkeys(world.units, Twist())
        self._drives = {name: LimitedDrive(scene.limits) for name in world.units}
        self._motors = {
            name: WheelMotors(world.client, unit, scene.motors) for name, unit in world.units.items()
        }
        self._locks: dict[str, PinLock] = {}
        self._parting: list[PinLock] = []
        self._plugs: dict[tuple[str, str], PortPlug] = {}

    def now_ns(self) -> int:
        """Return the time of the present tick."""
        return tick_ns(self.tick, self._hz)

    def step(self) -> None:
        """Advance by one tick: drives, physics, locks."""
        for name, motors in self._motors.items():
            motors.drive(self._drives[name].step(self._wishes[name], 1.0 / self._hz))
        self._advance()

    def step_freewheeling(self) -> None:
        """Advance by one tick with all wheels released."""
        for motors in self._motors.values():
            motors.release()
        self._advance()

    def command(self, unit: str, twist: Twist) -> None:
        """Ask the drive of ``unit`` for a velocity."""
        self.world.unit(unit)
        self._wishes[unit] = twist

    def set_lock(self, unit: str, close: bool) -> None:
        """Close the lock of ``unit``, or open it."""
        self._lock(unit).command(close)

    def pose(self, unit: str) -> SE2:
        """Return ``X_WU``."""
        return self.world.pose(unit)

    def pose3(self, unit: str) -> SE3:
        """Return ``X_WU`` with pitch, roll and height."""
        return self.world.pose3(unit)

    def wheel_angles(self, unit: str) -> tuple[float, float]:
        """Return the angles of the left and the right wheel [rad]."""
        return self.world.wheel_angles(unit)

    def twist(self, unit: str) -> Twist:
        """Return the velocity of U, seen from U."""
        return self.world.twist(unit)

    def switches(self, unit: str) -> tuple[bool, bool]:
        """Return the true state of the seat switches (left, right)."""
        lock = self._locks.get(unit)
        return lock.switches() if lock else (False, False)

    def lock_position(self, unit: str) -> LockPosition:
        """Return what the cam of ``unit`` says."""
        lock = self._locks.get(unit)
        return lock.position if lock else LockPosition.OPEN

    def lock_engaged(self, unit: str) -> bool:
        """Say whether the lock of ``unit`` holds the other unit."""
        lock = self._locks.get(unit)
        return lock is not None and lock.engaged

    def pins_touch(self, unit: str) -> bool:
        """Say whether a pin of ``unit`` touches the unit it docks to."""
        lock = self._locks.get(unit)
        if lock is None:
            return False
        plug = self._plugs.get((lock.dock_step.target_unit, lock.dock_step.target_port))
        return lock.pins_touch(plug.bodies if plug else ())

    def begin_dock(self, step: DockStep) -> None:
        """Name the port that the unit's mechanism has to do with from now on.

        Raises:
            MsrrError: The unit's lock still holds another one.
        """
        if self.lock_engaged(step.unit):
            raise MsrrError(f"unit {step.unit!r} is still locked; open its lock before it docks to {step.to}")
        lock = PinLock(self.world, step, self.world.scene.lock)
        if step.unit in self._locks:
            self._parting.append(self._locks[step.unit])
        self._locks[step.unit] = lock

    def pull_test(self, unit: str) -> PullResult:
        """Pull at the lock of ``unit``; time goes on meanwhile."""
        return self._lock(unit).pull_test(self)

    def set_plug(self, unit: str, port: str, present: bool) -> None:
        """Stop up the holes of a passive port, or clear them."""
        key = (unit, port)
        if present and key not in self._plugs:
            self._plugs[key] = PortPlug(self.world, unit, port)
        elif not present and key in self._plugs:
            self._plugs.pop(key).remove()

    def close(self) -> None:
        """Close the world."""
        self.world.close()

    def _advance(self) -> None:
        self.world.step()
        self.tick += 1
        for lock in (*self._locks.values(), *self._parting):
            lock.step(1.0 / self._hz)
        self._parting = [lock for lock in self._parting if not lock.settled]
        self.world.reveal(self.tick / self._hz)

    def _lock(self, unit: str) -> PinLock:
        self.world.unit(unit)
        try:
            return self._locks[unit]
        except KeyError:
            raise NoDockError(unit) from None
