"""Where a shape is built and by whom, or how the assembly that stands there becomes the shape."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from typing import NamedTuple

from msrr_control.coordination.embedding import embedding
from msrr_control.coordination.ledger import UnitRecord
from msrr_control.coordination.mission import Mission
from msrr_control.coordination.setup import CoordinationSetup
from msrr_control.planning.free_space import EVERYWHERE
from msrr_control.shapes.forms import beside
from msrr_control.shapes.hop_rules import HopRules
from msrr_control.shapes.precedence import Lanes
from msrr_control.shapes.reconfiguration import (
    assembly_ports,
    check_names,
    hops_between,
    reconfiguration_tasks,
    shape_ports,
    tasks_from,
)
from msrr_control.shapes.shape import Shape
from msrr_control.shapes.tasks import Task, plan_tasks, shape_tasks
from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import ObstacleEstimate
from msrr_scenes.messages.coordination import UnitState

#: How often a shape may be placed again.
_MOST_MOVES = 3

#: Distance by which an obstacle is seen elsewhere from which on it has moved [m].
_MOVED_M = 0.03


class Siting:
    """Chooses where the shape of a mission is built and by whom, or the order of the steps of a plan.

    Attributes:
        chosen: Whether that is known.
        moves: How often it had to be chosen again.
    """

    def __init__(self, mission: Mission, setup: CoordinationSetup) -> None:
        """Begin before anything is chosen.

        Raises:
            SceneError: The shape cannot be built, or the plan contradicts itself.
        """
        self._mission, self._setup = mission, setup
        if mission.shape is None:
            self._tasks = plan_tasks(mission.steps, mission.holders, setup.lanes)
        else:
            self._tasks = shape_tasks(mission.shape, setup.lanes)
        self.chosen, self.moves = False, 0
        self._basis: _Basis | None = None

    def choose(
        self, units: Iterable[UnitRecord], obstacles: tuple[ObstacleEstimate, ...]
    ) -> tuple[list[Task], dict[str, str]]:
        """Choose by what is there now: all units as they stand, and obstacles.

        Returns:
            All tasks, also those for which there is no unit; and a unit for every place that can be taken.

        Raises:
            SceneError: The shape cannot be built from what is there; the message says why.
        """
        mission, shape = self._mission, self._mission.shape
        lanes, box = self._setup.lanes, self._setup.finder.box
        self.chosen, units = True, list(units)
        # The first hops are chosen as if everybody could make them.
        self._basis = _Basis.of(() if mission.holders else units, obstacles)
        if shape is None:
            seen = {unit.name: unit.pose for unit in units if unit.X_WU is not None}
            return plan_tasks(mission.steps, mission.holders, lanes, seen), {}
        there = {unit.name: unit.pose for unit in units if unit.X_WU is not None and _may_take_part(unit)}
        if mission.holders:
            root = next(iter(assembly_ports(mission.holders)))
            if root not in there:
                raise SceneError(f"the root {root!r} of the assembly is not seen")
            tasks = reconfiguration_tasks(
                mission.holders, shape, lanes, there[root], box, mission.named, obstacles
            )
            return tasks, {}
        keep_out = [
            (unit.pose.x, unit.pose.y, lanes.body.radius)
            for unit in units
            if unit.X_WU is not None and not _may_take_part(unit)
        ]
        keep_out += [(o.X_WB.x, o.X_WB.y, o.radius) for o in obstacles]
        part = _part(shape, self._tasks, there, mission.named)
        # Those that are not there may come yet.
        later = [*([shape] if len(part.places) < len(shape.places) else ()), *mission.later_shapes]
        fit = partial(embedding, part, there, lanes, travel=self._setup.travel)
        fit = partial(fit, named=mission.named, keep_out=keep_out, later=later)
        found = next((place for box in self._setup.finder.boxes if (place := fit(box=box))), None)
        if found is None:
            raise SceneError("the shape and the lanes to it do not fit into the arena")
        return shape_tasks(shape, lanes, mission.named, found.X_WR), dict(found.units)

    def sees_root(self, units: Iterable[UnitRecord]) -> bool:
        """Return whether a unit was seen that can be the root of the shape; a plan has no root."""
        mission, seen = self._mission, {unit.name for unit in units if unit.X_WU is not None}
        if mission.shape is None:
            return True
        if mission.holders:
            return next(iter(assembly_ports(mission.holders))) in seen
        return mission.shape.root.name in seen if mission.named else bool(seen)

    def choose_again(
        self, units: Iterable[UnitRecord], obstacles: tuple[ObstacleEstimate, ...]
    ) -> tuple[list[Task], bool] | None:
        """Choose other hops by what is there now: from where all stand, by those that can move.

        Units that stand free beside the assembly take the places for which it has too few, the nearest first.
        No unit is under way.

        Returns:
            The tasks that are left, and whether they lead to the whole shape; None if what the choice rests
            on has not changed, or there is no way.
        """
        units, mission, before = list(units), self._mission, self._basis
        if not mission.holders or mission.shape is None or before is None:
            return None
        self._basis = _Basis.of(units, obstacles)
        if self._basis.agrees_with(before):
            return None
        root = next(iter(assembly_ports(mission.holders)))
        out = {unit.name: unit.pose for unit in units if unit.out_of_action and unit.X_WU is not None}
        docks = {unit.name: ".".join(unit.docks[0]) for unit in units if unit.docks}
        X_WR = next(unit.pose for unit in units if unit.name == root)
        loose = [unit for unit in units if unit.X_WU is not None and unit.name not in (root, *docks)]
        loose.sort(key=lambda unit: math.hypot(unit.pose.x - X_WR.x, unit.pose.y - X_WR.y))
        free = {unit.name: beside(unit.name) for unit in loose}
        lanes, box = self._setup.lanes, self._setup.finder.box
        try:
            places = shape_ports(Shape.from_tree({root: "root", **docks})) | free
            return tasks_from(places, mission.shape, lanes, X_WR, box, mission.named, obstacles, out)
        except SceneError:
            return None

    def may_move(self, units: Iterable[UnitRecord]) -> bool:
        """Return whether the shape can still be built elsewhere: nobody moves, and nobody can have docked.

        One that an assembly is to become is built where that stands, even if all have left its root.
        """
        if self._mission.shape is None or self._mission.holders or self.moves >= _MOST_MOVES:
            return False
        return not any(unit.under_way or unit.docks for unit in units)

    def move(self) -> None:
        """Note that the shape has to be built elsewhere."""
        self.chosen, self.moves = False, self.moves + 1


def check_shapes(mission: Mission, lanes: Lanes) -> None:
    """Refuse a shape that cannot be built, or not from the assembly or the shape before it, in any arena.

    Raises:
        SceneError: The message says why.
    """
    if mission.shape is None:
        return  # the steps of a plan may lead from one assembly to another
    form = assembly_ports(mission.holders) if mission.holders else None
    units = None if form is None else list(form)  # those that are locked together, the root first
    stage: Mission | None = mission
    while stage is not None and stage.shape is not None:
        shape_tasks(stage.shape, lanes)
        goal = shape_ports(stage.shape)
        if form is not None:
            if len(form) != len(goal):
                raise SceneError(
                    f"a {stage.name} is not built from an assembly of {len(form)} units: the numbers differ; "
                    "build it of as many"
                )
            if stage.named:
                if units is None:
                    raise SceneError(
                        f"a {stage.name} with named places is built from a shape whose places anybody takes, "
                        "also that of the root, which stays where it is; name the places of that shape, too"
                    )
                check_names(units, list(goal))
            start, end = (dict.fromkeys(ports.values(), "") for ports in (form, goal))
            hops_between(start, end, HopRules(lanes, SE2(), EVERYWHERE))
        if stage.named:
            units = list(goal)
        form, stage = goal, stage.then


class _Basis(NamedTuple):
    """What the choice of hops rests on, apart from where units are: those out of action, known obstacles."""

    out: frozenset[str]
    obstacles: Mapping[str, SE2]

    @classmethod
    def of(cls, units: Iterable[UnitRecord], obstacles: Iterable[ObstacleEstimate]) -> _Basis:
        """Return what is known now."""
        out = frozenset(unit.name for unit in units if unit.out_of_action)
        return cls(out, {obstacle.name: obstacle.X_WB for obstacle in obstacles})

    def agrees_with(self, other: _Basis) -> bool:
        """Return whether nobody has dropped out or come back, and no obstacle has come, gone or moved."""
        if self.out != other.out or self.obstacles.keys() != other.obstacles.keys():
            return False
        return all(
            math.hypot(X.x - other.obstacles[name].x, X.y - other.obstacles[name].y) < _MOVED_M
            for name, X in self.obstacles.items()
        )


def _may_take_part(unit: UnitRecord) -> bool:
    return unit.state in (UnitState.IDLE, UnitState.DOCKED)


def _part(shape: Shape, tasks: Sequence[Task], there: Mapping[str, SE2], named: bool) -> Shape:
    """Return as much of a shape as there are units for.

    Raises:
        SceneError: There is no unit for its root.
    """
    if named:
        names: list[str] = []
        for place in shape.places:
            if place.name in there and (place.parent is None or place.parent in names):
                names.append(place.name)
    else:
        names = [task.name for task in tasks[: len(there)]]
    if not names:
        raise SceneError("no unit is there for the root of the shape")
    return Shape(tuple(place for place in shape.places if place.name in names))
