"""A path of the long-distance phase: what it has to look like, what it is planned in, and what comes out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

from pydantic import Field

from msrr_control.path_following.path import Path
from msrr_control.planning.free_space import Disc
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import ObstacleEstimate
from msrr_scenes.specs.spec import NonNegative, Positive, Spec


class RouteSpec(Spec):
    """What a path to the place in front of the port looks like.

    Attributes:
        handover_m: Distance between the faces at which the path ends.
        lead_in_m: Lengths of the straight line before that end, in the order in which they are tried.
        least_radius_m: Of the large arc.
        most_sweep_deg: Of the large arc.
        turn_radius_m: Radii of the last arc of a way around things, tried in this order.
        stage_m: Distances before the end of the path at which the unit may stop and turn on the spot.
        unit_margin_m: Kept from other units, beyond both bodies.
        around_margin_m: Kept from an obstacle that is driven around, beyond what a wall beside it keeps.
        border_m: Kept by the controlled point from the border of the arena.
        least_run_m: An obstacle nearer along the path than this cannot be left to a wall any more.
        turn_radps: Rate at which a turn on the spot is reckoned.
    """

    handover_m: Positive = 0.70
    lead_in_m: tuple[Positive, ...] = Field(default=(0.3, 0.5, 0.8, 1.2, 0.2), min_length=1)
    least_radius_m: Positive = 0.5
    most_sweep_deg: float = Field(default=200.0, gt=0.0, lt=360.0)
    turn_radius_m: tuple[Positive, ...] = Field(default=(0.6, 0.4), min_length=1)
    stage_m: tuple[Positive, ...] = Field(default=(0.5, 0.75, 1.0, 0.3, 0.2), min_length=1)
    unit_margin_m: NonNegative = 0.08
    around_margin_m: NonNegative = 0.02
    border_m: NonNegative = 0.10
    least_run_m: Positive = 0.45
    turn_radps: Positive = 0.8


class Surroundings(NamedTuple):
    """What a path is planned in; everything in the world frame.

    Attributes:
        X_WU: The unit.
        X_WD: Dock frame of the target port.
        units: Middle and radius of every other unit, the target among them.
        obstacles: Every obstacle that is known.
    """

    X_WU: SE2
    X_WD: SE2
    units: tuple[Disc, ...]
    obstacles: tuple[ObstacleEstimate, ...]


@dataclass(frozen=True, eq=False)
class Route:
    """A path and how it passes what stands on it.

    Attributes:
        path: Of the controlled point; it begins in the middle of the axle.
        shape: ``arc``: one circle and the lead-in; ``around``: lines and arcs around things; ``staged``: to a
            place from which the rest is planned anew, after a turn on the spot.
        sides: Obstacles on the path that are left to walls: the side they are passed on, -1 right, +1 left.
        seconds: Time it should take [s].
    """

    path: Path
    shape: str
    sides: Mapping[str, float]
    seconds: float

    @property
    def final(self) -> bool:
        """The path ends in front of the port."""
        return self.shape != "staged"
