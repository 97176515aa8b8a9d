"""Groups of units that are locked together, and the clearance that a docked unit leaves to its neighbours."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from msrr_bullet.collision.clearance_model import ClearanceModel
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.scene import Scene

#: How much nearer than in its seat a docking unit may come to a neighbour of its target [m]. A unit that is
#: off its axis by as much as the funnel of the port accepts is nearer by less.
NEIGHBOUR_MARGIN_M = 0.010


def seat_pose(scene: Scene, step: DockStep) -> SE2:
    """Return the pose ``X_TU`` of the docking unit U in the frame of its target T when it is seated."""
    return scene.dock_frame(step) @ scene.geometry(step.unit).port(step.port).inverse()


def locked_group(scene: Scene, locked: Iterable[DockStep], unit: str) -> dict[str, SE2]:
    """Return the units that are locked to a unit, directly or through others, with their seated poses.

    The docks in ``locked`` are closed. The poses ``X_UV`` of every unit V of the group are in the frame of
    ``unit``, by name, ``unit`` included.
    """
    steps = tuple(locked)
    poses = {unit: SE2()}
    pending = [unit]
    while pending:
        known = pending.pop()
        for step in steps:
            if known not in (step.unit, step.target_unit):
                continue
            other = step.unit if known == step.target_unit else step.target_unit
            if other not in poses:
                X_TU = seat_pose(scene, step)
                poses[other] = poses[known] @ (X_TU if other == step.unit else X_TU.inverse())
                pending.append(other)
    return poses


def neighbour_limits(
    scene: Scene, model: ClearanceModel, locked: Iterable[DockStep], step: DockStep
) -> Mapping[str, float]:
    """Return how near a docking unit may come to each of the neighbours of its target [m], by name.

    A neighbour is a unit that is locked to the target. The limit is the clearance that the seated unit has
    from it, less :data:`NEIGHBOUR_MARGIN_M`. The docks in ``locked`` are closed.
    """
    group = locked_group(scene, locked, step.target_unit)
    X_TU = seat_pose(scene, step)
    limits: dict[str, float] = {}
    for name, X_TN in group.items():
        seated = model.nearest(step.unit, X_TU, {name: X_TN})
        if name != step.target_unit and seated is not None:
            limits[name] = max(seated.distance - NEIGHBOUR_MARGIN_M, 0.0)
    return limits
