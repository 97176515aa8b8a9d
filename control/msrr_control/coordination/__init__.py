"""Coordination of many units: shapes, the assignment of places, movement authorities, and the coordinator."""

from msrr_control.coordination.authority import MovementAuthority
from msrr_control.coordination.bodies import Body
from msrr_control.coordination.coordinator import Coordinator
from msrr_control.coordination.knowledge import Knowledge
from msrr_control.coordination.mission import Mission, Patience
from msrr_control.coordination.route_finder import RouteParams
from msrr_control.coordination.shape import Shape
from msrr_control.coordination.tasks import plan_tasks, shape_tasks

__all__ = [
    "Body",
    "Coordinator",
    "Knowledge",
    "Mission",
    "MovementAuthority",
    "Patience",
    "RouteParams",
    "Shape",
    "plan_tasks",
    "shape_tasks",
]
