"""The order in which ports can be docked to: nobody stands in a lane before the unit that needs it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from graphlib import TopologicalSorter
from typing import NamedTuple

import numpy as np

from msrr_control.planning.lane import LANE_GAP_M, in_lane
from msrr_control.planning.route import RouteSpec
from msrr_control.shapes.bodies import Body
from msrr_control.shapes.shape import LEAST_GAP_M
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import ObstacleEstimate

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

    def obstacle_in(
        self, X_WU: SE2, obstacles: Iterable[ObstacleEstimate], roomy: bool = False
    ) -> str | None:
        """Return the obstacle in the dock leg of the docked pose ``X_WU``; None if there is none.

        If ``roomy``, those count as well that are in the rest of the lane, or as near to it as routes come to
        other units.
        """
        X_WD = X_WU @ SE2(self.body.offset, 0.0, 0.0)
        length, gap = (self.length, self.spec.unit_margin_m) if roomy else (self.spec.handover_m, LANE_GAP_M)
        return in_lane(X_WD, length, self.body.half_width, obstacles, gap)

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


class Stay(NamedTuple):
    """Where a unit stands from the end of one of its tasks to the beginning of the next.

    Attributes:
        unit: The unit; the place, in a shape.
        frame: Frame of the pose. Poses in two frames cannot be compared.
        pose: Pose of the axle in that frame.
        begins: Task that ends here; None for where the unit stands at the start.
        ends: Task that begins here; None if the unit stays.
        port: Port ``<unit>.<port>`` in which it is; empty in the open.
        may_make_way: Whether the unit can be sent out of the way.
        carrier: Unit that stands free and carries this one, maybe through others, with the task by which it
            came there; None for one that stands free itself.
    """

    unit: str
    frame: str
    pose: SE2
    begins: str | None = None
    ends: str | None = None
    port: str = ""
    may_make_way: bool = False
    carrier: tuple[str, str | None] | None = None

    @property
    def base(self) -> tuple[str, str | None]:
        """The carrier of a unit that docks to this one."""
        return self.carrier or (self.unit, self.begins)


def precede(before: dict[str, list[str]], stays: Sequence[Stay], lanes: Lanes) -> list[tuple[Stay, str]]:
    """Put tasks that need a lane before those whose units would stand in it, or behind those that free it.

    A task that docks needs the lane of its port, and one that leaves a port needs that port's. What is in
    ``before`` holds: an order that contradicts it is not added.

    Returns:
        Who stands in the lane of a docking in every order that is left, and the docking.
    """
    conflicts = []
    docked = [stay for stay in stays if stay.port]
    needs = [(stay, stay.begins) for stay in docked] + [(stay, stay.ends) for stay in docked]
    for stay, task in needs:
        if task is None:
            continue
        holder = stay.port.partition(".")[0]
        others = [o for o in stays if o.frame == stay.frame and o.unit not in (stay.unit, holder)]
        closes = lanes.closes(stay.pose, np.array([o.pose.as_array() for o in others]).reshape(-1, 3))
        for other in (o for o, does in zip(others, closes, strict=True) if does):
            carries = (other.unit, other.begins) == stay.carrier  # it cannot drive away from below
            if other.begins is not None and other.begins not in _ancestors(before, task):
                before[other.begins].append(task)
            elif other.may_make_way and not carries:
                continue
            elif other.ends is not None and not carries and task not in _ancestors(before, other.ends):
                before[task].append(other.ends)
            elif task == stay.begins and other.port != stay.port:  # whose port it is shows when one is in it
                conflicts.append((other, task))
    return conflicts


def _ancestors(before: Mapping[str, Iterable[str]], task: str) -> set[str]:
    """Return a task and all that come before it."""
    known, pending = {task}, [task]
    while pending:
        new = [earlier for earlier in before[pending.pop()] if earlier not in known]
        known.update(new)
        pending += new
    return known


def topological_order(names: Iterable[str], before: Mapping[str, Iterable[str]]) -> list[str]:
    """Return the names in an order in which those ``before`` come first, else in the given order.

    Raises:
        CycleError: There is none; its second argument is a ring of names, each before the next.
    """
    listed = list(names)
    rank = {name: k for k, name in enumerate(listed)}
    sorter = TopologicalSorter({name: list(before[name]) for name in listed})
    sorter.prepare()
    order: list[str] = []
    ready: list[str] = []
    while sorter.is_active():
        ready = sorted([*ready, *sorter.get_ready()], key=rank.__getitem__)
        first = ready.pop(0)
        order.append(first)
        sorter.done(first)
    return order
