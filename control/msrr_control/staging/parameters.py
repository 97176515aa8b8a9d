"""Parameters of the long-distance phase as a scene gives them."""

from __future__ import annotations

import math

from pydantic import Field

from msrr_control.path_following.baseline import C2PathFollowingParams
from msrr_control.path_following.c1 import C1PathFollowingParams
from msrr_control.path_following.walls import WallSpec
from msrr_control.planning.route import RouteSpec
from msrr_scenes.specs.spec import NonNegative, Positive, Spec


class WatchSpec(Spec):
    """When the unit waits, plans anew or gives up.

    Attributes:
        stale_s: Age of the last sight of the unit from which on it stands still.
        lost_s: Time for which it waits for localisation, at the start or on the way.
        spin_after_s: Time without any localisation after which it turns on the spot, to show itself.
        spin_radps: Rate of that turn.
        aligned_deg: Heading error at which a turn on the spot ends.
        askew_deg: Heading error at the start of a path up to which it needs no turn on the spot.
        moved_m: Motion of an estimate after which what was derived from it is derived again.
        target_moved_m: The same for the end of the path.
        target_moved_deg: The same for its heading.
        stuck_s: Time without ``stuck_m`` of progress along the path after which another is planned.
        stuck_m: See there.
        astray_m: Deviation from the path beyond that of passing obstacles at which another is planned.
        there_m: Distance from the end of the path at which the unit has arrived.
        there_deg: Heading error at which it has arrived.
        settle_s: Time for which it is waited for at the end of a path.
        patience_s: Time for which the unit waits for a way to open.
        retry_s: Time between two looks for one.
        paths: How many paths are tried in a row.
    """

    stale_s: Positive = 1.0
    lost_s: Positive = 10.0
    spin_after_s: Positive = 2.0
    spin_radps: Positive = 0.4
    aligned_deg: Positive = 3.0
    askew_deg: Positive = 12.0
    moved_m: Positive = 0.02
    target_moved_m: Positive = 0.06
    target_moved_deg: Positive = 6.0
    stuck_s: Positive = 5.0
    stuck_m: Positive = 0.04
    astray_m: Positive = 0.45
    there_m: Positive = 0.05
    there_deg: Positive = 12.0
    settle_s: NonNegative = 2.5
    patience_s: NonNegative = 6.0
    retry_s: Positive = 1.0
    paths: int = Field(default=8, ge=1)

    @property
    def aligned(self) -> float:
        """Heading error at which a turn on the spot ends [rad]."""
        return math.radians(self.aligned_deg)

    @property
    def askew(self) -> float:
        """Heading error that needs no turn on the spot [rad]."""
        return math.radians(self.askew_deg)


class AssemblyParams(C1PathFollowingParams):
    """Parameters of the assembler ``c1``: those of its law, its paths and its patience.

    Attributes:
        route: Shape of the paths.
        watch: When it waits, plans anew or gives up.
        widest_obstacle_m: Largest radius of an obstacle that a path can lead around.
        turn_per_s: Gain of the turn on the spot.
    """

    route: RouteSpec = RouteSpec()
    watch: WatchSpec = WatchSpec()
    widest_obstacle_m: Positive = 0.5
    turn_per_s: Positive = 2.5


class C2AssemblyParams(C2PathFollowingParams):
    """Parameters of the assembler ``c2``: those of its law, its paths and its patience.

    Attributes:
        walls: Obstacles that paths lead past; nothing else stands at these walls.
        route: Shape of the paths.
        watch: When it waits, plans anew or gives up. A potential pushes back further than walls lead around,
            so that it is given more room.
        widest_obstacle_m: Largest radius of an obstacle that a path can lead around.
        turn_per_s: Gain of the turn on the spot.
    """

    walls: WallSpec = WallSpec()
    route: RouteSpec = RouteSpec()
    watch: WatchSpec = WatchSpec(astray_m=1.0)
    widest_obstacle_m: Positive = 0.5
    turn_per_s: Positive = 2.5

    def paths(self) -> AssemblyParams:
        """Return what C1 and C2 have in common."""
        return AssemblyParams(
            walls=self.walls,
            route=self.route,
            watch=self.watch,
            pace=self.pace,
            widest_obstacle_m=self.widest_obstacle_m,
            turn_per_s=self.turn_per_s,
        )
