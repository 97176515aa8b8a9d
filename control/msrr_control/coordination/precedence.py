"""The order in which places can be taken: parents before children, nobody in a lane before its unit."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from graphlib import CycleError, TopologicalSorter
from itertools import pairwise

import numpy as np

from msrr_control.coordination.bodies import Body
from msrr_control.coordination.shape import LEAST_GAP_M, Shape
from msrr_control.planning.route import RouteSpec
from msrr_scenes.arrays import Array
from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.se2 import SE2

#: Distance between the poses of a lane that are compared with other bodies [m].
_SPACING_M = 0.04

#: Length of the straight line before the hand-over that a lane needs, beyond the lead-in [m].
_RUN_UP_M = 0.1


class Lanes:
    """The ground on which a unit approaches its place: straight, from before the hand-over to the port."""

    def __init__(self, body: Body, spec: RouteSpec) -> None:
        """Bind the lanes to the form of the units and of their routes."""
        self.body, self.spec = body, spec
        self.length = spec.handover_m + min(spec.lead_in_m) + 2.0 * _RUN_UP_M
        #: Distance that the controlled point keeps from the middle of another unit outside the dock leg [m].
        self.room = body.radius + body.half_width + spec.unit_margin_m
        back = np.arange(0.0, spec.handover_m + 0.5 * _SPACING_M, _SPACING_M)
        self._dock_leg = np.stack([-back, np.zeros_like(back), np.zeros_like(back)], axis=-1)
        lead_in = np.linspace(spec.handover_m, spec.handover_m + min(spec.lead_in_m), 8)
        self._lead_in = np.stack([body.offset - lead_in, np.zeros_like(lead_in)], axis=-1)

    def end(self, X_WU: SE2) -> SE2:
        """Return the pose of the axle at which the lane of the docked pose ``X_WU`` begins."""
        return X_WU @ SE2(-self.length, 0.0, 0.0)

    def closed_by(self, X_WU: SE2, X_WB: SE2) -> bool:
        """Return whether a body at ``X_WB`` closes the lane of the docked pose ``X_WU``."""
        return bool(self.closes(X_WU, X_WB.as_array()[None])[0])

    def closes(self, X_WU: SE2, bodies: Array) -> Array:
        """Return which bodies, shape (N, 3), close the lane of the docked pose ``X_WU``, shape (N,) bool.

        In the dock leg bodies are compared, because docked neighbours at a corner are nearer than circles
        allow; before it the distance counts by which routes are planned.
        """
        leg = compose(X_WU, self._dock_leg)
        touched = self.body.near(leg[:, None], bodies[None], LEAST_GAP_M).any(axis=0)
        tips = X_WU.act(self._lead_in)
        distance = np.hypot(*np.moveaxis(tips[:, None] - bodies[None, :, :2], -1, 0))
        closed: Array = touched | (distance.min(axis=0) < self.room)
        return closed


def compose(X_WA: SE2, poses: Array) -> Array:
    """Return ``X_WA`` times each of the poses, shape (N, 3)."""
    points = X_WA.act(poses[:, :2])
    return np.concatenate([points, poses[:, 2:] + X_WA.yaw], axis=1)


def precedence(shape: Shape, lanes: Lanes) -> dict[str, tuple[str, ...]]:
    """Return for every place the places that have to be taken before it, in the order of the shape.

    Raises:
        SceneError: The shape cannot be built; the message says why.
    """
    problem = shape.problem(lanes.body)
    if problem is not None:
        raise SceneError(problem)
    poses = shape.poses(SE2(), lanes.body)
    before: dict[str, list[str]] = {p.name: [] if p.parent is None else [p.parent] for p in shape.places}
    for place in shape.places[1:]:
        others = [p.name for p in shape.places if p.name not in (place.name, place.parent)]
        closes = lanes.closes(
            poses[place.name], np.array([poses[o].as_array() for o in others]).reshape(-1, 3)
        )
        for other, does in zip(others, closes, strict=True):
            if does:
                before[other].append(place.name)
    order = topological_order([p.name for p in shape.places], before)
    if isinstance(order, CycleError):
        ring = order.args[1]
        reasons = ", ".join(f"{a} before {b}" for a, b in pairwise(ring))
        raise SceneError(
            f"a lane is closed by what has to be built before it: {reasons} (a parent comes before its "
            "child, and a unit before those that would stand in its lane); dock one of them elsewhere"
        )
    return {name: tuple(dict.fromkeys(before[name])) for name in order}


def topological_order(names: Iterable[str], before: Mapping[str, Iterable[str]]) -> list[str] | CycleError:
    """Return the names in an order in which those ``before`` come first, else in the given order.

    Returns:
        The order, or the error that names a ring, in which each comes before the next.
    """
    listed = list(names)
    rank = {name: k for k, name in enumerate(listed)}
    sorter = TopologicalSorter({name: list(before[name]) for name in listed})
    try:
        sorter.prepare()
    except CycleError as ring:
        return ring
    order: list[str] = []
    ready: list[str] = []
    while sorter.is_active():
        ready = sorted([*ready, *sorter.get_ready()], key=rank.__getitem__)
        first = ready.pop(0)
        order.append(first)
        sorter.done(first)
    return order
