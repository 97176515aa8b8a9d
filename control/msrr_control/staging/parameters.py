"""The parameters of the long-distance phase that a scene gives in ``control.assembly.params``."""

from __future__ import annotations

from pydantic import Field

from msrr_control.path_following.c1 import C1PathFollowingParams
from msrr_control.path_following.c2 import C2PathFollowingParams
from msrr_control.path_following.path import PaceSpec
from msrr_control.path_following.walls import WallSpec
from msrr_control.planning.route import RouteSpec
from msrr_scenes.specs.spec import Duration, Gain, Length, Spec, Time, Tolerance, TurnRate


class WatchSpec(Spec):
    """When the unit waits, plans again or gives up.

    Attributes:
        stale_s: Age of the last sight of the unit from which on it stands still.
        lost_s: Time for which the unit waits for localisation, at the start or on the way.
        spin_after_s: Time without any localisation after which the unit turns on the spot, to show itself.
        spin_radps: Rate of that turn.
        aligned_deg: Heading error at which a turn on the spot ends.
        askew_deg: Heading error at the start of a path up to which no turn on the spot is needed.
        moved_m: Motion of an obstacle's or unit's estimate after which the route is checked against it again.
        target_moved_m: Motion of the end of the path after which another path is planned.
        target_moved_deg: Turn of the end of the path after which another path is planned.
        stuck_s: Time without ``stuck_m`` of progress along the path, or without progress of a turn on the
            spot, after which another path is planned.
        stuck_m: Distance along the path that counts as progress.
        astray_m: Deviation from the reference at which another path is planned.
        there_m: Distance from the end of the path at which the unit has arrived.
        there_deg: Heading error at which the unit has arrived.
        settle_s: Time that the unit is given to come to rest at the end of a path.
        patience_s: Time for which the unit waits for a route if there is none.
        retry_s: Time between two attempts to plan a route.
        paths: Number of paths that are tried in a row.
    """

    stale_s: Duration = 1.0
    lost_s: Duration = 10.0
    spin_after_s: Duration = 2.0
    spin_radps: TurnRate = 0.4
    aligned_deg: Tolerance = 3.0
    askew_deg: Tolerance = 12.0
    moved_m: Length = 0.02
    target_moved_m: Length = 0.06
    target_moved_deg: Tolerance = 6.0
    stuck_s: Duration = 5.0
    stuck_m: Length = 0.04
    astray_m: Length = 0.45
    there_m: Length = 0.05
    there_deg: Tolerance = 12.0
    settle_s: Time = 2.5
    patience_s: Time = 6.0
    retry_s: Duration = 1.0
    paths: int = Field(default=8, ge=1, le=100)


class RouteFollowingParams(Spec):
    """Parameters that every long-distance phase has in common, whatever its law.

    Attributes:
        walls: Walls beside obstacles; under a law without walls they only decide which obstacles a path may
            pass.
        pace: Speed along the path.
        route: Shape of the routes.
        watch: When the unit waits, plans again or gives up.
        widest_obstacle_m: Largest radius of an obstacle that a path can lead around.
        turn_per_s: Gain of the turn on the spot.
    """

    walls: WallSpec = WallSpec()
    pace: PaceSpec = PaceSpec()
    route: RouteSpec = RouteSpec()
    watch: WatchSpec = WatchSpec()
    widest_obstacle_m: Length = 0.5
    turn_per_s: Gain = 2.5


class AssemblyParams(C1PathFollowingParams, RouteFollowingParams):
    """Parameters of the assembler ``c1``: those of its law and those of the routes."""


class C2AssemblyParams(C2PathFollowingParams, RouteFollowingParams):
    """Parameters of the assembler ``c2``: those of its law and those of the routes.

    Attributes:
        watch: When the unit waits, plans again or gives up. A potential pushes the unit further back than
            walls lead it around, so that larger deviations from the path are accepted.
    """

    watch: WatchSpec = WatchSpec(astray_m=1.0)
