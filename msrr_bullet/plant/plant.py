"""What the loop knows of the physics: the one interface behind which every plant stands.

Everything a plant tells is truth. The loop hands it to the sensors' models, the judge and the log, never to
perception or control.
"""

from __future__ import annotations

from typing import Protocol

from msrr_bullet.plant.lock_actuator import PullResult
from msrr_scenes.errors import MsrrError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.messages import NS_PER_S, LockPosition, Twist
from msrr_scenes.specs.plan import DockStep


class Plant(Protocol):
    """Units that move, port mechanisms and locks; time is counted in physics ticks.

    A command stays in force until the next one. A unit that is not commanded brakes. A unit's mechanism
    exists from its first :meth:`begin_dock` on; before that its switches are open and its lock holds nothing.
    """

    @property
    def tick(self) -> int:
        """Number of ticks since the start."""
        ...

    def now_ns(self) -> int:
        """Return the time of the present tick."""
        ...

    def step(self) -> None:
        """Advance by one tick."""
        ...

    def command(self, unit: str, twist: Twist) -> None:
        """Ask the drive of ``unit`` for a velocity."""
        ...

    def set_lock(self, unit: str, close: bool) -> None:
        """Close the lock of ``unit``, or open it."""
        ...

    def pose(self, unit: str) -> SE2:
        """Return ``X_WU``."""
        ...

    def pose3(self, unit: str) -> SE3:
        """Return ``X_WU`` with pitch, roll and height."""
        ...

    def wheel_angles(self, unit: str) -> tuple[float, float]:
        """Return the angles of the left and the right wheel [rad]."""
        ...

    def twist(self, unit: str) -> Twist:
        """Return the velocity of U, seen from U."""
        ...

    def switches(self, unit: str) -> tuple[bool, bool]:
        """Return the true state of the seat switches (left, right) of the port ``unit`` docks to."""
        ...

    def lock_position(self, unit: str) -> LockPosition:
        """Return what the cam of ``unit`` says."""
        ...

    def lock_engaged(self, unit: str) -> bool:
        """Say whether the lock of ``unit`` holds the other unit."""
        ...

    def pins_touch(self, unit: str) -> bool:
        """Say whether a pin of ``unit`` touches the unit it docks to."""
        ...

    def begin_dock(self, step: DockStep) -> None:
        """Name the port that the unit's pins, switches and lock have to do with from now on."""
        ...

    def pull_test(self, unit: str) -> PullResult:
        """Pull at the lock of ``unit``; time goes on meanwhile, and the units may come apart."""
        ...

    def set_plug(self, unit: str, port: str, present: bool) -> None:
        """Stop up the holes of a passive port, or clear them."""
        ...

    def close(self) -> None:
        """Give back what the plant owns."""
        ...


def tick_ns(tick: int, physics_hz: float) -> int:
    """Return the time of a physics tick, rounded to the nanosecond."""
    return round(tick * NS_PER_S / physics_hz)


class NoDockError(MsrrError):
    """A unit's mechanism is asked for something before the unit has begun to dock."""

    def __init__(self, unit: str) -> None:
        """Name the unit."""
        super().__init__(f"unit {unit!r} has no docking target yet; call begin_dock first")
