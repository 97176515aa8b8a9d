"""The long-distance phase of the paper's comparison C2: the same paths and patience, another law."""

from __future__ import annotations

from msrr_control.assembler import LongRangeAssembler
from msrr_control.assembly_setup import AssemblySetup
from msrr_control.assembly_tuning import AssemblyParams, WatchSpec
from msrr_control.comparison_long import ComparisonLongLaw, ComparisonLongParams
from msrr_control.route import RouteSpec
from msrr_control.walls import WallSpec
from msrr_scenes.spec import Positive


class ComparisonAssemblyParams(ComparisonLongParams):
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


class ComparisonAssembler(LongRangeAssembler):
    """Leads the unit in front of the port by the law C2."""

    # The machine asks of a law what LongLaw says, and of its state the reference besides; this one has both.
    _law: ComparisonLongLaw  # type: ignore[assignment]

    def __init__(self, params: ComparisonAssemblyParams, setup: AssemblySetup) -> None:
        """Begin before anything is known.

        Raises:
            SceneError: What is asked cannot work wherever things stand.
        """
        super().__init__(params.paths(), setup)
        self._law = ComparisonLongLaw(params, setup.limits, setup.offset)
