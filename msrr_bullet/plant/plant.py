"""The interface of the physics, and what every plant has in common: time, commands, locks.

A plant returns the truth. The trial passes it to the models of the sensors, the judge and the log, never to
perception or control.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import lru_cache

from msrr_bullet.plant.drivetrain import Drivetrain
from msrr_bullet.plant.limited_drive import LimitedDrive
from msrr_bullet.plant.lock_actuator import SWITCH_TRAVEL, LockActuator
from msrr_scenes.as_built import AsBuilt
from msrr_scenes.errors import MsrrError, UnknownNameError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.messages import NS_PER_S, LockPosition, Twist
from msrr_scenes.specs.faults import LockJammed, UnitSeized
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.vehicle import LockSpec

Vector = tuple[float, float, float]


class PortMechanism(ABC):
    """The pins, the seat switches and the lock of an active port that docks to a passive port.

    A lock that ``jams`` does not open any more once it is closed.
    """

    def __init__(self, dock_step: DockStep, spec: LockSpec, switch_travel: float) -> None:
        """Start with an open lock.

        The seat switches close at the distance ``switch_travel`` from the bottom of the hole [m].
        """
        self.dock_step = dock_step
        self._spec = spec
        self._switch_travel = switch_travel
        self._actuator = LockActuator(spec.close_time_s)
        self.jams = False

    @property
    def position(self) -> LockPosition:
        """Position that the lock actuator reports."""
        return self._actuator.position

    @property
    @abstractmethod
    def engaged(self) -> bool:
        """Whether the lock holds the other unit."""

    @property
    @abstractmethod
    def in_reach(self) -> bool:
        """Whether the lock would hold the other unit if it became closed now: both pins are in its reach."""

    @abstractmethod
    def switches(self) -> tuple[bool, bool]:
        """Return whether the seat switches (left, right) are closed."""

    @abstractmethod
    def pins_touch(self) -> bool:
        """Return whether a pin touches the other unit or what plugs the port."""

    @abstractmethod
    def pull_test(self) -> bool:
        """Pull the two units apart, and return whether the lock still holds; simulated time may pass."""

    def command(self, close: bool) -> None:
        """Close the lock, or open it and release the other unit, unless it jams."""
        if self.jams and self.position is LockPosition.CLOSED:
            return
        self._actuator.command(close)
        if not close:
            self._release()

    def close_at_once(self) -> None:
        """Close the lock without the time that this takes."""
        self._actuator.position = LockPosition.CLOSED
        self._catch()

    @abstractmethod
    def _catch(self) -> None:
        """Hold the other unit if both pins are in reach of the lock, which has just become closed."""

    @abstractmethod
    def _release(self) -> None: ...


class Plant(ABC):
    """Units that move, with port mechanisms and locks; time is counted in physics ticks.

    A command stays in force until the next one. A unit without a command brakes. The port mechanism of a unit
    exists from the first :meth:`begin_dock` on; before that the switches are open and the lock holds nothing.
    ``tick`` is the number of physics ticks since the start.
    """

    def __init__(self, scene: Scene, built: AsBuilt) -> None:
        """Start with all drives at rest and no port mechanism."""
        self.tick = 0
        self._scene = scene
        self._built = built
        self._dt = 1.0 / scene.physics_hz
        self._commands = dict.fromkeys(scene.units, Twist())
        self._drives = {name: LimitedDrive(scene.limits, self._dt) for name in scene.units}
        self._drivetrains = {
            name: Drivetrain(scene.geometry(name), unit.drive) for name, unit in built.units.items()
        }
        self._mechanisms: dict[str, PortMechanism] = {}
        seized = (fault for fault in scene.faults if isinstance(fault, UnitSeized))
        self._seized_tick = {fault.unit: fault.from_s * scene.physics_hz for fault in seized}
        self._jamming = {fault.unit for fault in scene.faults if isinstance(fault, LockJammed)}

    def now_ns(self) -> int:
        """Return the time of the present tick [ns]."""
        return tick_ns(self.tick, self._scene.physics_hz)

    @abstractmethod
    def step(self) -> None:
        """Advance by one tick."""

    def advance(self, until_ns: float, observe: Callable[[], None] | None = None) -> None:
        """Advance to the first tick at or after a time [ns], at least by one; call ``observe`` after each."""
        while True:
            self.step()
            if observe is not None:
                observe()
            if self.now_ns() >= until_ns:
                return

    def command(self, unit: str, twist: Twist) -> None:
        """Command a velocity to the drive of ``unit``."""
        self._check_unit(unit)
        self._commands[unit] = twist

    @abstractmethod
    def pose(self, unit: str) -> SE2:
        """Return the true ``X_WU``."""

    @abstractmethod
    def pose3(self, unit: str) -> SE3:
        """Return the true ``X_WU`` with pitch, roll and height."""

    def frame(self, unit: str, X_UF: SE3) -> tuple[Vector, Vector, Vector]:
        """Return origin [m], x axis and y axis in W of a frame that is fixed to a unit.

        ``X_UF``, the pose of the frame in the unit, is the same object in every call.
        """
        X_WF = self.pose3(unit) @ X_UF
        origin, x_axis, y_axis = (tuple(v.tolist()) for v in (X_WF.p, X_WF.R[:, 0], X_WF.R[:, 1]))
        return origin, x_axis, y_axis

    @abstractmethod
    def wheel_angles(self, unit: str) -> tuple[float, float]:
        """Return the true angles of the left and the right wheel [rad]."""

    def motor_angles(self, unit: str) -> tuple[float, float]:
        """Return the true angles of the left and the right motor behind its gear [rad].

        They are what encoders measure: angles of the wheels but for the play of the gear.
        """
        (left, right), drivetrain = self.wheel_angles(unit), self._drivetrains[unit]
        if drivetrain.ideal:
            return left, right
        return left + drivetrain.play[0], right + drivetrain.play[1]

    @abstractmethod
    def twist(self, unit: str) -> Twist:
        """Return the true velocity of frame U, expressed in U."""

    def begin_dock(self, step: DockStep) -> None:
        """Assign the target port of ``step`` to the port mechanism of the docking unit.

        Raises:
            MsrrError: The lock of the unit still holds another unit.
        """
        if self.lock_engaged(step.unit):
            raise MsrrError(f"unit {step.unit!r} is still locked; open its lock before it docks to {step.to}")
        self._mechanisms[step.unit] = self._build_mechanism(step)
        self._mechanisms[step.unit].jams = step.unit in self._jamming

    def assemble(self, step: DockStep) -> None:
        """Lock a unit that stands in its seat when the trial begins.

        Raises:
            MsrrError: The pins of the unit are not in reach of the lock.
        """
        self.begin_dock(step)
        self._mechanisms[step.unit].close_at_once()
        if not self.lock_engaged(step.unit):
            raise MsrrError(
                f"unit {step.unit!r} does not stand in its seat at {step.to}, so its lock holds nothing"
            )

    def set_lock(self, unit: str, close: bool) -> None:
        """Close the lock of ``unit``, or open it."""
        self._mechanism(unit).command(close)

    def switches(self, unit: str) -> tuple[bool, bool]:
        """Return whether the seat switches (left, right) of the port that ``unit`` docks to are closed."""
        mechanism = self._mechanisms.get(unit)
        return mechanism.switches() if mechanism else (False, False)

    def lock_position(self, unit: str) -> LockPosition:
        """Return the position that the lock of ``unit`` reports."""
        mechanism = self._mechanisms.get(unit)
        return mechanism.position if mechanism else LockPosition.OPEN

    def lock_engaged(self, unit: str) -> bool:
        """Return whether the lock of ``unit`` holds the other unit."""
        mechanism = self._mechanisms.get(unit)
        return mechanism is not None and mechanism.engaged

    def lock_in_reach(self, unit: str) -> bool:
        """Return whether the lock of ``unit`` holds the other unit, or would if it became closed now."""
        mechanism = self._mechanisms.get(unit)
        return mechanism is not None and (mechanism.engaged or mechanism.in_reach)

    def pins_touch(self, unit: str) -> bool:
        """Return whether a pin of ``unit`` touches the unit that it docks to."""
        mechanism = self._mechanisms.get(unit)
        return mechanism is not None and mechanism.pins_touch()

    def pull_test(self, unit: str) -> bool:
        """Pull at the lock of ``unit``, and return whether it still holds; simulated time may pass."""
        return self._mechanism(unit).pull_test()

    @abstractmethod
    def set_plug(self, unit: str, port: str, present: bool) -> None:
        """Plug the holes of a passive port, or clear them."""

    @abstractmethod
    def is_plugged(self, unit: str, port: str) -> bool:
        """Return whether something plugs the holes of a passive port now."""

    @abstractmethod
    def _build_mechanism(self, step: DockStep) -> PortMechanism: ...

    def _drive(self, unit: str) -> Twist:
        """Advance the drive of a unit by one tick; return its velocity, which is zero once it has seized."""
        drive = self._drives[unit]
        if self._seized_tick and self.tick >= self._seized_tick.get(unit, math.inf):
            drive.velocity = Twist()
            return drive.velocity
        return drive.step(self._commands[unit])

    def _switch_travel(self, step: DockStep) -> float:
        """Return the true travel of the seat switches of the port that a step docks to [m]."""
        return max(SWITCH_TRAVEL + self._built.units[step.target_unit].switch_travel_error_m, 0.0)

    def _check_unit(self, unit: str) -> None:
        if unit not in self._commands:
            raise UnknownNameError("unit", unit, self._commands)

    def _mechanism(self, unit: str) -> PortMechanism:
        self._check_unit(unit)
        try:
            return self._mechanisms[unit]
        except KeyError:
            raise MsrrError(f"unit {unit!r} has no docking target yet; call begin_dock first") from None


@lru_cache(maxsize=16)  # asked for several times a tick
def tick_ns(tick: int, physics_hz: float) -> int:
    """Return the time of a physics tick, rounded to a nanosecond."""
    return round(tick * NS_PER_S / physics_hz)
