"""Routes of the long-distance phase: planning them in what is known, and monitoring them on the way."""

from msrr_control.planning.route import ArenaMap, Route, RouteSpec
from msrr_control.planning.route_monitor import RouteMonitor
from msrr_control.planning.route_planner import RoutePlanner

__all__ = ["ArenaMap", "Route", "RouteMonitor", "RoutePlanner", "RouteSpec"]
