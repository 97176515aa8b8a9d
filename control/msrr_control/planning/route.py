"""A route of the long-distance phase: its parameters, the map in which it is planned, and the result."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple

from pydantic import Field

from msrr_control.path_following.path import Path
from msrr_control.planning.free_space import Disc
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import ObstacleEstimate
from msrr_scenes.specs.spec import Distance, Length, Spec, TurnRate

#: What bounds the routes of a unit that is seen in all of the arena, in words.
ARENA_BORDER = "the border of the arena"


class RouteSpec(Spec):
    """The shape of routes to the place in front of the port.

    Attributes:
        handover_m: Distance between the faces at which the path ends.
        lead_in_m: Lengths of the straight line before that end, in the order in which they are tried.
        short_lead_in_m: Lengths of that line that are tried where no route has room for one of the above.
        least_radius_m: Smallest radius of the large arc.
        most_sweep_deg: Largest angle of the large arc.
        turn_radius_m: Radii of the last arc of a path around obstacles, in the order in which they are tried.
        stage_m: Distances before the end of the path at which the unit may stop and turn on the spot.
        unit_margin_m: Distance kept from other units, beyond both bodies.
        around_margin_m: Distance kept from an obstacle that is driven around, beyond that of a wall, for each
            time that the unit was stopped on an earlier route.
        border_m: Least distance of the controlled point from the border of the arena. It is larger where the
            unit's place is known less well.
        least_run_m: Smallest distance along the path to an obstacle that can still be left to a wall.
        turn_radps: Turn rate that is assumed for turns on the spot.
    """

    handover_m: Length = 0.70
    lead_in_m: tuple[Length, ...] = Field(default=(0.3, 0.5, 0.8, 1.2, 0.2), min_length=1, max_length=20)
    short_lead_in_m: tuple[Length, ...] = Field(default=(0.1, 0.05), max_length=20)
    least_radius_m: Length = 0.5
    most_sweep_deg: float = Field(default=200.0, gt=0.0, lt=360.0)
    turn_radius_m: tuple[Length, ...] = Field(default=(0.6, 0.4, 0.25), min_length=1, max_length=20)
    stage_m: tuple[Length, ...] = Field(default=(0.5, 0.75, 1.0, 0.3, 0.2), min_length=1, max_length=20)
    unit_margin_m: Distance = 0.08
    around_margin_m: Distance = 0.02
    border_m: Distance = 0.10
    least_run_m: Length = 0.45
    turn_radps: TurnRate = 0.8

    def handover(self, X_WD: SE2) -> SE2:
        """Return the end of the path: the place of the controlled point, and the heading."""
        return X_WD @ SE2(-self.handover_m, 0.0, 0.0)


class ArenaMap(NamedTuple):
    """The estimates in which a route is planned, all in the world frame.

    Attributes:
        X_WU: Pose of the unit.
        X_WD: Dock frame of the target port.
        units: Middle and radius of every other unit, the target among them.
        obstacles: All known obstacles.
        turns_at_end: Whether the unit may turn on the spot at the end, for there is no port in front of it.
    """

    X_WU: SE2
    X_WD: SE2
    units: tuple[Disc, ...]
    obstacles: tuple[ObstacleEstimate, ...]
    turns_at_end: bool = False

    def without_one(self, target: tuple[Disc, ...]) -> Iterator[tuple[str, ArenaMap]]:
        """Yield the name of each body but the target with the map of all others; a body may be many discs."""
        for name in dict.fromkeys(unit.name for unit in self.units if unit not in target):
            yield name, self._replace(units=tuple(u for u in self.units if u.name != name))
        for obstacle in self.obstacles:
            others = tuple(o for o in self.obstacles if o is not obstacle)
            yield obstacle.name, self._replace(obstacles=others)


@dataclass(frozen=True, eq=False)
class Route:
    """A path, and how it passes the obstacles on it.

    Attributes:
        path: Path of the controlled point; it begins in the middle of the axle.
        shape: ``arc``: one circle and the lead-in; ``around``: lines and arcs around obstacles; ``staged``:
            to a place from which the rest is planned again, after a turn on the spot; ``turned``: to the
            end on whatever heading, and a turn on the spot there; ``granted``: the path of a leg that a base
            station has granted.
        sides: Side on which each obstacle that is left to a wall is passed, -1 right, +1 left, by name.
        seconds: Expected duration [s].
    """

    path: Path
    shape: str
    sides: Mapping[str, float]
    seconds: float

    @property
    def final(self) -> bool:
        """Whether the path ends in front of the port."""
        return self.shape != "staged"
