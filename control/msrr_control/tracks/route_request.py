"""What a track is asked for, and what stands still while it is driven."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import ObstacleEstimate


class Standing(NamedTuple):
    """A body that stands still while a route is driven.

    Attributes:
        name: Name of the unit that stands or will stand there.
        X_WB: Its pose.
        at_port: Whether it is docked there, so that others at ports may come as near as neighbours are.
    """

    name: str
    X_WB: SE2
    at_port: bool


@dataclass(frozen=True)
class RouteRequest:
    """What a track is asked for.

    Attributes:
        X_WU: Where the unit stands.
        X_WE: Where the axle is to be at the end; None only to back out of a port.
        standing: Everything that stands still meanwhile.
        obstacles: Obstacles.
        dock: Whether the end is in a port.
        leaves: Unit in whose port the unit is now, None if it is free.
        enters: Unit in whose port it ends.
        held: Whether the collision monitor of the unit has held it where it stands. Something is nearer to it
            than it seems from above, so that it turns on the spot only where there is all the room for that.
        room: What the route keeps farther from other units than their margin [m].
    """

    X_WU: SE2
    X_WE: SE2 | None
    standing: Sequence[Standing] = ()
    obstacles: tuple[ObstacleEstimate, ...] = ()
    dock: bool = False
    leaves: str | None = None
    enters: str | None = None
    held: bool = False
    room: float = 0.0

    @property
    def others(self) -> list[Standing]:
        """What stands there, without the units of the ports that are left and entered."""
        return [s for s in self.standing if s.name not in (self.leaves, self.enters)]
