"""Messages between the base station that coordinates many units and the units, over a radio.

Both sides repeat their whole state a few times a second, so that a report acknowledges an authority and a
lost message costs time and nothing else. Arc lengths along a route are those of the controlled point: a turn
on the spot by an angle a counts l |a|, and a way backwards counts as a way forwards.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class LegKind(Enum):
    """The kinds of legs of a route."""

    BACK = "back"
    """Backwards out of a port, straight."""
    REVERSE = "reverse"
    """Backwards in the open, straight."""
    TURN = "turn"
    """On the spot."""
    PATH = "path"
    """Forwards, with the controlled point on a path."""
    DOCK = "dock"
    """Forwards into the port, straight, under the unit's own perception."""


@dataclass(frozen=True, slots=True)
class RouteLeg:
    """One leg of a route.

    Attributes:
        kind: What the unit does.
        start: Pose (x, y, yaw) of the axle at the beginning of the leg in W [m, m, rad]. Forwards it is the
            beginning of the controlled point's path, with the direction of that path.
        curvature: Curvature of each piece of that path [1/m]; empty for a leg backwards or on the spot.
        lengths: Length of each piece of that path, which begins at the axle [m]; empty likewise.
        turn: Angle of a turn on the spot, counter-clockwise positive [rad].
        end: Arc length of the route at which the leg ends [m].
    """

    kind: LegKind
    start: tuple[float, float, float]
    curvature: tuple[float, ...]
    lengths: tuple[float, ...]
    turn: float
    end: float


@dataclass(frozen=True, slots=True)
class Intent:
    """Where a unit that drives would still come if it stopped now.

    Attributes:
        unit: Name of the unit.
        stamp_ns: Time at which it would begin to stop.
        poses: Poses (x, y, yaw) of the axle in W, the last one at rest [m, m, rad].
    """

    unit: str
    stamp_ns: int
    poses: tuple[tuple[float, float, float], ...]


@dataclass(frozen=True, slots=True)
class Authority:
    """The permission to drive along a route up to a limit, repeated until the next one.

    Attributes:
        unit: Unit that may drive.
        route: Number of the route, counted up for each unit from 1; 0 is no route: stand still.
        seq: Number of the message, counted up for each unit.
        stamp_ns: Time at which it was sent.
        expires_ns: Time at which it ends unless another one arrives, except in the dock leg.
        limit: Arc length up to which the unit may drive [m]; it never shrinks within a route. Negative: the
            unit may not move at all.
        legs: The legs of the route.
        to: Port ``<unit>.<port>`` at which the route ends, None if it ends in the open.
        unlock: Whether the unit is to open its lock before it moves.
        joints: Active and passive port of each two other units that are locked together, as they have
            reported, or will be at the ends of their routes.
        intents: Intents of the units nearby that go first, out of whose way this one keeps.
    """

    unit: str
    route: int
    seq: int
    stamp_ns: int
    expires_ns: int
    limit: float
    legs: tuple[RouteLeg, ...]
    to: str | None
    unlock: bool
    joints: tuple[tuple[str, str], ...] = ()
    intents: tuple[Intent, ...] = ()


class UnitMode(Enum):
    """What a unit says that it is doing."""

    STANDING = "standing"
    """It stands and waits."""
    DRIVING = "driving"
    """It drives along a route."""
    DOCKING = "docking"
    """It is on its way into a port, or in it and not locked yet."""
    DOCKED = "docked"
    """It is locked into a port."""
    LOST = "lost"
    """It stands, because it was not localised for too long, and waits for another route."""
    FAILED = "failed"
    """It cannot go on with its route."""


@dataclass(frozen=True, slots=True)
class UnitReport:
    """The state of a unit, as the unit itself knows it.

    Attributes:
        unit: Unit that reports.
        stamp_ns: Time of the state.
        seq: Number of the newest authority that the unit has received, 0 before the first.
        route: Number of the route that the unit follows or has followed.
        progress: Arc length of that route that the unit has covered [m].
        mode: What the unit does.
        docked_to: Port ``<unit>.<port>`` into which the unit believes that it is locked, or which it is
            still leaving: one that fails on the way out tells it, too. None if it is free.
        stopping: Poses (x, y, yaw) of the axle in W that the unit would still pass if it stopped now, the
            last one at rest [m, m, rad]; empty while it stands.
        reason: Why the unit is in this mode, in words.
    """

    unit: str
    stamp_ns: int
    seq: int
    route: int
    progress: float
    mode: UnitMode
    docked_to: str | None
    stopping: tuple[tuple[float, float, float], ...] = ()
    reason: str = ""


class UnitState(Enum):
    """What the coordinator holds a unit for."""

    IDLE = "idle"
    """Stands without a route."""
    UNDER_WAY = "under_way"
    """Has a route."""
    DOCKED = "docked"
    """Is locked into a port."""
    LOST = "lost"
    """Was not localised or not heard for too long, and is given no task until it is."""
    FAILED = "failed"
    """Is given no further task."""


@dataclass(frozen=True, slots=True)
class UnitStatus:
    """What the coordinator knows about a unit.

    Attributes:
        unit: Name of the unit.
        state: What it counts as.
        task: Task that the unit has or had last, None before the first.
        route: Number of its route, 0 before the first.
        order: Place of its route in the order of the routes: a later one keeps out of what an earlier one
            still has to drive.
        progress: Arc length that was reported or seen [m].
        limit: Arc length up to which it may drive [m].
        length: Arc length of the whole route [m].
        blocked_by: Unit for which it waits, None if it waits for nobody.
        reason: Why it is so, in words.
    """

    unit: str
    state: UnitState
    task: str | None
    route: int
    order: int
    progress: float
    limit: float
    length: float
    blocked_by: str | None
    reason: str


class MissionState(Enum):
    """How a mission stands."""

    RUNNING = "running"
    """Some task is not done yet."""
    COMPLETE = "complete"
    """All tasks are done."""
    INCOMPLETE = "incomplete"
    """A part of the mission was given up, and nothing else is left to do."""


@dataclass(frozen=True, slots=True)
class MissionStatus:
    """What the coordinator knows about the mission.

    Attributes:
        stamp_ns: Time of the status.
        state: How the mission stands.
        shape: Name of the shape that is being built, of several the present one; empty without one.
        done: Names of the tasks that are done, in the order of the tasks, of all shapes so far.
        given_up: Names of the tasks that were given up, in the order of the tasks.
        units: Every unit, in the order in which the coordinator was given them.
        replans: Number of routes that were planned because an earlier one could not be driven to its end.
        reason: Why it is so, in words.
    """

    stamp_ns: int
    state: MissionState
    shape: str
    done: tuple[str, ...]
    given_up: tuple[str, ...]
    units: tuple[UnitStatus, ...]
    replans: int
    reason: str
