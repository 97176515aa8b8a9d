"""Where a target stands so that all who are to dock to it, and to them, have their lanes."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from msrr_control.coordination.ledger import UnitRecord
from msrr_control.coordination.setup import CoordinationSetup
from msrr_control.coordination.target_place import later_ones_fit, place_of_target
from msrr_control.shapes.tasks import Task, TaskKind
from msrr_control.tracks.track import standing
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import ObstacleEstimate


def _dock(unit: str | None, holder: str, port: str) -> Task:
    return Task(f"{unit} to {holder}", TaskKind.DOCK, unit, parent_unit=holder, port=port)


def _units(**poses: SE2) -> dict[str, UnitRecord]:
    return {name: UnitRecord(name, X) for name, X in poses.items()}


A, C = SE2(1.2, 0.5, 2.0), SE2(1.2, -0.6, 1.0)


@pytest.mark.parametrize(
    ("tasks", "b"),
    [
        ([_dock("a", "b", "rear")], SE2(-1.7, 0.0, 0.0)),
        ([_dock("a", "b", "rear"), _dock("c", "b", "left")], SE2(0.0, 1.2, 0.0)),
        ([_dock("c", "a", "rear"), _dock("a", "b", "right")], SE2(0.0, -0.7, 0.0)),
    ],
)
def test_a_target_goes_to_where_all_lanes_lie_inside(
    tasks: list[Task], b: SE2, setup: CoordinationSetup
) -> None:
    units, lanes = _units(a=A, b=b, c=C), setup.lanes
    place = place_of_target(units["b"], tasks, units, setup, ())
    assert place is not None
    room = lanes.spec.border_m + lanes.body.offset
    x0, x1, y0, y1 = setup.finder.box
    poses = {"b": place}
    for task in sorted(tasks, key=lambda task: task.parent_unit != "b"):
        assert task.unit is not None
        assert task.parent_unit is not None
        poses[task.unit] = lanes.body.docked(poses[task.parent_unit], task.port)
        for X in (poses[task.unit], lanes.end(poses[task.unit])):
            assert x0 + room <= X.x <= x1 - room
            assert y0 + room <= X.y <= y1 - room
    units["b"].X_WU = place
    assert place_of_target(units["b"], tasks, units, setup, ()) is None, "there it stays"


def test_a_target_goes_to_where_nobody_stands_in_its_lanes(setup: CoordinationSetup) -> None:
    """Those who dock drive away; whoever has no task, or an obstacle, stays."""
    task, alone = _dock("a", "b", "rear"), _units(a=A, b=SE2())
    best = place_of_target(alone["b"], [task], alone, setup, ())
    assert best is not None
    in_lane = best @ SE2(-0.6, 0.0, 0.0)
    post = ObstacleEstimate("post", 0, in_lane, np.eye(3), 0.1)
    for units, obstacles in ((_units(a=A, b=SE2(), d=in_lane), ()), (alone, (post,))):
        place = place_of_target(units["b"], [task], units, setup, obstacles)
        X = SE2() if place is None else place
        leg = [X @ SE2(-0.2 - 0.05 * k, 0.0, 0.0) for k in range(15)]
        near = min(math.hypot(X.x - in_lane.x, X.y - in_lane.y) for X in leg)
        assert near > 0.1 + setup.lanes.body.half_width
    units = _units(a=A, b=SE2(), d=SE2(-1.5, -1.0, 0.0))
    units["d"].set_out(standing(in_lane), None, 1, 0)  # it will stand there
    assert place_of_target(units["b"], [task], units, setup, ()) != best
    everywhere = (replace(post, radius=9.0),)
    assert place_of_target(alone["b"], [task], alone, setup, everywhere) is None


def test_a_target_leaves_the_ends_of_moves_free_where_there_is_room_elsewhere(
    setup: CoordinationSetup,
) -> None:
    """It went where the unit that was to dock to it was to drive before, which then found no route."""
    dock, units = _dock("a", "b", "rear"), _units(a=A, b=SE2(-1.7, 0.0, 0.0))
    best = place_of_target(units["b"], [dock], units, setup, ())
    assert best is not None
    ahead = [Task("a moves", TaskKind.MOVE, "a", pose=SE2(best.x, best.y, 1.0)), dock]
    place = place_of_target(units["b"], ahead, units, setup, ())
    assert place is not None
    assert setup.lanes.body.gap(place, SE2(best.x, best.y, 1.0)) > 0.0
    own = [Task("b moves", TaskKind.MOVE, "b", pose=best), dock]
    assert place_of_target(units["b"], own, units, setup, ()) == best
    grid = [SE2(0.25 * i, 0.25 * k) for i in range(-8, 9) for k in range(-6, 7)]
    everywhere = [Task(f"{X}", TaskKind.MOVE, "a", pose=X) for X in grid]
    assert place_of_target(units["b"], [*everywhere, dock], units, setup, ()) == best


def test_only_dockings_of_units_that_are_named_and_seen_count(setup: CoordinationSetup) -> None:
    units = _units(a=A, b=SE2(-1.7, 0.0, 0.0), c=C)
    moves = Task("a", TaskKind.MOVE, "a", parent_unit="b", port="rear")
    for tasks in ([_dock(None, "b", "rear")], [moves], [_dock("a", "c", "rear")]):
        assert place_of_target(units["b"], tasks, units, setup, ()) is None
    ring = [_dock("a", "b", "rear"), _dock("b", "a", "rear")]
    assert place_of_target(units["b"], ring, units, setup, ()) is not None
    units["a"].X_WU = None
    assert place_of_target(units["b"], ring[:1], units, setup, ()) is None


def test_those_who_dock_and_leave_at_the_end_are_places_until_then(setup: CoordinationSetup) -> None:
    """The plan that builds a chain and takes it apart left its target where the chain had no room."""
    units = _units(a=A, b=SE2(-0.55, -1.1, -1.12), c=C)
    chain = [_dock("a", "b", "left"), _dock("c", "a", "left")]
    leave = [Task(f"{unit} leaves", TaskKind.UNDOCK, unit) for unit in ("c", "a")]
    place = place_of_target(units["b"], chain, units, setup, ())
    assert place is not None
    assert place_of_target(units["b"], chain + leave, units, setup, ()) == place
    assert not later_ones_fit(units["b"], chain + leave, units, setup, ())
    # A unit that docks where another one has been, and after it has left, has no place in the chain.
    gone = [chain[0], leave[1], chain[1]]
    assert later_ones_fit(units["b"], gone, units, setup, ())
