"""Where a unit that stands free has to stand, so that others can reach its ports.

A shape is built where it fits. A plan names the ports, and its units stand wherever they are: in front of a
port there may be the border of the arena, or an obstacle.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from msrr_control.coordination.embedding import embedding, grandchildren_fit
from msrr_control.coordination.ledger import UnitRecord
from msrr_control.coordination.setup import CoordinationSetup
from msrr_control.shapes.shape import Place, Shape
from msrr_control.shapes.tasks import Task, TaskKind
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import ObstacleEstimate


def place_of_target(
    target: UnitRecord,
    tasks: Sequence[Task],
    units: Mapping[str, UnitRecord],
    setup: CoordinationSetup,
    obstacles: Sequence[ObstacleEstimate],
) -> SE2 | None:
    """Return where the target of some tasks has to stand; None if that is where it is, or nowhere.

    Where others are to drive by the plan is left free for them if there is such a place. The target carries
    nobody, the tasks are open, and the obstacles have been seen.
    """
    shape = _tree(target.name, tasks)
    there = {place.name: units[place.name] for place in shape.places}
    if any(unit.X_WU is None for unit in there.values()):
        return None
    lanes = setup.lanes
    keep_out = _keep_out([unit for name, unit in units.items() if name not in there], obstacles, setup)
    ends = [t.pose for t in tasks if t.kind is TaskKind.MOVE and t.pose is not None and t.unit != target.name]
    poses = {name: unit.pose for name, unit in there.items()}
    found = None
    for also in ([(X.x, X.y, lanes.body.radius) for X in ends], []):
        for box in setup.finder.boxes:
            out = keep_out + also
            found = found or embedding(shape, poses, lanes, box, setup.travel, named=True, keep_out=out)
    if found is None:
        return None
    # A place that the target would be taken to have reached from where it stands is not worth a move.
    stays = setup.tolerance.doubled().holds(found.X_WR.inverse() @ target.pose)
    return None if stays else found.X_WR


def later_ones_fit(
    target: UnitRecord,
    tasks: Sequence[Task],
    units: Mapping[str, UnitRecord],
    setup: CoordinationSetup,
    obstacles: Sequence[ObstacleEstimate],
) -> bool:
    """Return whether those that are to dock to what docks to a target can do so where the target stands.

    Nobody can ask for a route to them yet, and once the first unit has docked to the target it stays there.
    The arguments are those of :func:`place_of_target`.
    """
    shape = _tree(target.name, tasks)
    stay = [u for u in units.values() if u.name not in shape.by_name and (u.docks or u.out_of_action)]
    keep_out = _keep_out(stay, obstacles, setup)
    return grandchildren_fit(shape, target.pose, setup.lanes, setup.finder.box, keep_out)


def _keep_out(
    units: Iterable[UnitRecord], obstacles: Iterable[ObstacleEstimate], setup: CoordinationSetup
) -> list[tuple[float, float, float]]:
    """Return the circles about units, where they stand or will stand, and about obstacles."""
    seen = [unit for unit in units if unit.X_WU is not None]
    circles = [(X.x, X.y, setup.lanes.body.radius) for unit in seen for X in unit.resting_places]
    return circles + [(obstacle.X_WB.x, obstacle.X_WB.y, obstacle.radius) for obstacle in obstacles]


def _tree(root: str, tasks: Sequence[Task]) -> Shape:
    """Return the shape of all that is to dock to a unit, and to those that dock there until they leave.

    The tasks are in an order in which they can be granted.
    """
    places, docked_by = [Place(root)], {root: -1}  # by which of the tasks each unit comes to its place
    for place in places:  # the list grows while it is walked
        until = len(tasks)
        if place.parent is not None:
            own = (k for k, task in enumerate(tasks) if task.unit == place.name)
            until = next((k for k in own if k > docked_by[place.name]), until)
        for k, task in enumerate(tasks[:until]):
            docks = task.kind is TaskKind.DOCK and task.parent_unit == place.name
            if docks and task.unit is not None and task.unit not in docked_by:
                docked_by[task.unit] = k
                places.append(Place(task.unit, place.name, task.port))
    return Shape(tuple(places))
