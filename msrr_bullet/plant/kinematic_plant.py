"""The plant without contact: units roll exactly as their kinematics say, ports are idealised.

It answers what a law does when nothing but the drive's limits stands in its way. Nothing is solid here but
the mouth of the port that is docked to. All else passes through each other; the clearance judge still sees
that it does.
"""

from __future__ import annotations

from typing import Protocol

from msrr_bullet.plant.kinematic_port import CaptureRange, KinematicPort
from msrr_bullet.plant.limited_drive import LimitedDrive, wheel_speeds
from msrr_bullet.plant.lock_actuator import PullResult
from msrr_bullet.plant.plant import NoDockError, tick_ns
from msrr_scenes.errors import MsrrError, UnknownNameError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.messages import LockPosition, Twist
from msrr_scenes.placement.placement import Placement
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.scene import Scene


class Scenery(Protocol):
    """The bodies that cameras see, such as a PyBullet world that is never stepped."""

    def place(self, name: str, X_WU: SE2, wheels: tuple[float, float]) -> None:
        """Put a unit on the floor at ``X_WU`` with these wheel angles (left, right) [rad]."""
        ...

    def reveal(self, now_s: float) -> None:
        """Put up the obstacles that have appeared by ``now_s`` [s]."""
        ...

    def close(self) -> None:
        """Give back what the bodies own; a second call does nothing."""
        ...


class KinematicPlant:
    """A plant of ideal unicycles behind the drive limits of Zheng et al., eq. 3."""

    def __init__(
        self,
        scene: Scene,
        placement: Placement,
        world: Scenery | None = None,
        *,
        capture: CaptureRange | None = None,
    ) -> None:
        """Place the units.

        Args:
            scene: A checked scene.
            placement: Where the units stand at the start.
            world: Bodies that follow the units, for the cameras to see; None when no camera looks.
            capture: The idealised funnel; None takes that of the shipped unit.
        """
        self.tick = 0
        self._scene = scene
        self._world = world
        self._capture = capture or CaptureRange()
        self._poses = {name: placement.units[name] for name in scene.units}
        self._wheels = dict.fromkeys(scene.units, (0.0, 0.0))
        self._wishes = dict.fromkeys(scene.units, Twist())
        self._moved = dict.fromkeys(scene.units, Twist())
        self._drives = {name: LimitedDrive(scene.limits) for name in scene.units}
        self._docks: dict[str, KinematicPort] = {}
        self._plugs: set[tuple[str, str]] = set()

    def now_ns(self) -> int:
        """Return the time of the present tick."""
        return tick_ns(self.tick, self._scene.physics_hz)

    def step(self) -> None:
        """Advance by one tick: drives, exact integration, ports."""
        dt = 1.0 / self._scene.physics_hz
        before = dict(self._poses)
        for name in self._scene.units:
            self._roll(name, dt)
        settled: set[str] = set()
        for name in self._docks:
            self._settle(name, settled)
        for name, X_WU in self._poses.items():
            turned = (before[name].inverse() @ X_WU).log()
            self._moved[name] = Twist(float(turned[0]) / dt, float(turned[2]) / dt)
            # Wheels roll as far as their unit: their motors are too weak to spin them against a port.
            rates = wheel_speeds(self._moved[name], self._scene.geometry(name))
            left, right = (angle + rate * dt for angle, rate in zip(self._wheels[name], rates, strict=True))
            self._wheels[name] = left, right
        self.tick += 1
        for dock in self._docks.values():
            dock.step_cam(dt)
        if self._world is not None:
            for name, X_WU in self._poses.items():
                self._world.place(name, X_WU, self._wheels[name])
            self._world.reveal(self.tick * dt)

    def command(self, unit: str, twist: Twist) -> None:
        """Ask the drive of ``unit`` for a velocity."""
        self._check(unit)
        self._wishes[unit] = twist

    def set_lock(self, unit: str, close: bool) -> None:
        """Close the lock of ``unit``, or open it."""
        self._dock(unit).command(close)

    def pose(self, unit: str) -> SE2:
        """Return ``X_WU``."""
        self._check(unit)
        return self._poses[unit]

    def pose3(self, unit: str) -> SE3:
        """Return ``X_WU`` on the floor."""
        return SE3.from_se2(self.pose(unit))

    def wheel_angles(self, unit: str) -> tuple[float, float]:
        """Return the angles of the left and the right wheel [rad]."""
        self._check(unit)
        return self._wheels[unit]

    def twist(self, unit: str) -> Twist:
        """Return the velocity with which the unit moved in the last tick."""
        self._check(unit)
        return self._moved[unit]

    def switches(self, unit: str) -> tuple[bool, bool]:
        """Return the true state of the seat switches (left, right)."""
        dock = self._docks.get(unit)
        return dock.switches() if dock else (False, False)

    def lock_position(self, unit: str) -> LockPosition:
        """Return what the cam of ``unit`` says."""
        dock = self._docks.get(unit)
        return dock.position if dock else LockPosition.OPEN

    def lock_engaged(self, unit: str) -> bool:
        """Say whether the lock of ``unit`` holds the other unit."""
        dock = self._docks.get(unit)
        return dock is not None and dock.engaged

    def pins_touch(self, unit: str) -> bool:
        """Say whether the port of ``unit`` is being guided, stopped or seated."""
        dock = self._docks.get(unit)
        return dock is not None and dock.touching

    def begin_dock(self, step: DockStep) -> None:
        """Name the port that the unit's mechanism has to do with from now on.

        Raises:
            MsrrError: The unit's lock still holds another one.
        """
        if self.lock_engaged(step.unit):
            raise MsrrError(f"unit {step.unit!r} is still locked; open its lock before it docks to {step.to}")
        own, target = self._scene.geometry(step.unit), self._scene.geometry(step.target_unit)
        X_TU = self.pose(step.target_unit).inverse() @ self.pose(step.unit)
        dock = KinematicPort(step, own, target, self._scene.lock, self._capture, X_TU)
        dock.plugged = (step.target_unit, step.target_port) in self._plugs
        self._docks[step.unit] = dock

    def pull_test(self, unit: str) -> PullResult:
        """Compare the pull with the lock's strength; takes no time."""
        return self._dock(unit).pull()

    def set_plug(self, unit: str, port: str, present: bool) -> None:
        """Stop up the holes of a passive port, or clear them."""
        self._check(unit)
        (self._plugs.add if present else self._plugs.discard)((unit, port))
        for dock in self._docks.values():
            if (dock.step.target_unit, dock.step.target_port) == (unit, port):
                dock.plugged = present

    def close(self) -> None:
        """Close the world that follows, if there is one."""
        if self._world is not None:
            self._world.close()

    def _roll(self, name: str, dt: float) -> None:
        """Move a unit as its drive would, with nothing in its way."""
        speed = self._drives[name].step(self._wishes[name], dt)
        self._poses[name] = self._poses[name] @ SE2.exp(speed.v * dt, 0.0, speed.w * dt)

    def _settle(self, name: str, settled: set[str]) -> None:
        """Let a unit's port have its say, after that of the unit it docks to."""
        dock = self._docks.get(name)
        if dock is None or name in settled:
            return
        settled.add(name)
        self._settle(dock.step.target_unit, settled)
        self._poses[name] = dock.constrain(self._poses[name], self._poses[dock.step.target_unit])

    def _check(self, unit: str) -> None:
        if unit not in self._poses:
            raise UnknownNameError("unit", unit, self._poses)

    def _dock(self, unit: str) -> KinematicPort:
        self._check(unit)
        try:
            return self._docks[unit]
        except KeyError:
            raise NoDockError(unit) from None
