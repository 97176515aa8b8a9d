"""Parameters of the routes that the coordinator plans."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from msrr_control.path_following.path import PaceSpec
from msrr_control.path_following.walls import WallSpec
from msrr_control.planning.route import RouteSpec


@dataclass(frozen=True)
class RouteParams:
    """Parameters of the routes, those of the long-distance phase."""

    route: RouteSpec = field(default_factory=RouteSpec)
    walls: WallSpec = field(default_factory=WallSpec)
    pace: PaceSpec = field(default_factory=PaceSpec)

    def with_room(self, extra: float) -> RouteParams:
        """Return parameters of routes that keep farther from units and obstacles, by ``extra`` [m]."""
        return replace(
            self,
            route=self.route.model_copy(update={"unit_margin_m": self.route.unit_margin_m + extra}),
            walls=self.walls.model_copy(update={"margin_m": self.walls.margin_m + extra}),
        )
