"""Routes of the long-distance phase: planning them in what is known, and monitoring them on the way."""

from msrr_control.planning.free_space import Disc, FreeSpace
from msrr_control.planning.route import ArenaMap, Route, RouteSpec
from msrr_control.planning.route_monitor import RouteMonitor
from msrr_control.planning.route_planner import RoutePlanner
from msrr_control.planning.tangents import Goal, shortest_path

__all__ = [
    "ArenaMap",
    "Disc",
    "FreeSpace",
    "Goal",
    "Route",
    "RouteMonitor",
    "RoutePlanner",
    "RouteSpec",
    "shortest_path",
]
