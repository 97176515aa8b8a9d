"""What the coordinator works with and what does not change during a mission."""

from __future__ import annotations

from dataclasses import dataclass

from msrr_control.coordination.embedding import Travel
from msrr_control.coordination.goal_tolerance import DEFAULT_TOLERANCE, GoalTolerance
from msrr_control.planning.free_space import Bounds
from msrr_control.planning.route import ARENA_BORDER
from msrr_control.shapes.bodies import Body
from msrr_control.shapes.precedence import Lanes
from msrr_control.tracks.route_finder import RouteFinder
from msrr_control.tracks.route_params import RouteParams
from msrr_scenes.geometry.unit_geometry import UnitGeometry


@dataclass(frozen=True)
class CoordinationSetup:
    """What the coordinator works with; none of it changes during a mission.

    Attributes:
        lanes: Lanes of the units.
        finder: Finds tracks.
        travel: Assumed speeds.
        retreat_m: Distance before the end of a dock leg to which a failed attempt leads back [m].
        tolerance: How near the end of a move a unit has to be seen.
    """

    lanes: Lanes
    finder: RouteFinder
    travel: Travel
    retreat_m: float
    tolerance: GoalTolerance = DEFAULT_TOLERANCE

    @classmethod
    def of(
        cls,
        geometry: UnitGeometry,
        params: RouteParams,
        box: Bounds,
        retreat_m: float = 0.5,
        border: str = ARENA_BORDER,
        distance_error: float = 0.0,
        tolerance: GoalTolerance = DEFAULT_TOLERANCE,
        inner: Bounds | None = None,
    ) -> CoordinationSetup:
        """Return what follows from the units' geometry and the parameters of their routes.

        All units are alike. Two that are beside each other may be nearer than they seem by
        ``distance_error`` [m]. ``box``, ``border`` and ``inner`` are as for
        :class:`~msrr_control.tracks.route_finder.RouteFinder`, and the rest are attributes.
        """
        body = Body.of(geometry, distance_error)
        params = params.with_room(body.extra_gap)
        travel = Travel.of(params.pace, params.route.turn_radps)
        finder = RouteFinder(body, params, box, border, inner)
        return cls(Lanes(body, params.route), finder, travel, retreat_m, tolerance)
