"""Single decisions of the dispatcher: who sets out, who is sent out of the way, and who stays."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from msrr_control.coordination.assemblies import locate
from msrr_control.coordination.dispatcher import Dispatcher
from msrr_control.coordination.interlock import Interlock
from msrr_control.coordination.ledger import UnitRecord
from msrr_control.coordination.setup import CoordinationSetup
from msrr_control.coordination.task_list import TaskList
from msrr_control.coordination.waiting_places import waiting_places
from msrr_control.shapes.tasks import Task, TaskKind, TaskState
from msrr_control.tracks.track import standing
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import ObstacleEstimate
from msrr_scenes.messages.coordination import UnitState

#: Units that may be sent out of the way no more.
TIRED = 3

DOCK = Task("a to b", TaskKind.DOCK, "a", parent_unit="b", port="rear")


@dataclass
class Base:
    """A dispatcher with its ledger: a is to dock to the rear port of b, unless other tasks are given."""

    setup: CoordinationSetup
    units: dict[str, UnitRecord]
    listed: list[Task] = field(default_factory=lambda: [DOCK])
    one_by_one: bool = False

    def __post_init__(self) -> None:
        self.tasks = TaskList(self.listed)
        interlock = Interlock(self.units, self.setup.lanes.body)
        self.dispatcher = Dispatcher(self.setup, self.units, interlock, self.one_by_one)

    def dispatch(self, *obstacles: ObstacleEstimate) -> bool:
        self.dispatcher.ends.obstacles = obstacles
        return self.dispatcher.dispatch(self.tasks, 1_000_000_000)

    @property
    def under_way(self) -> dict[str, str | None]:
        """Tasks of those under way."""
        return {unit.name: unit.task for unit in self.units.values() if unit.under_way}


def _units(**poses: SE2) -> dict[str, UnitRecord]:
    return {name: UnitRecord(name, X) for name, X in poses.items()}


def _post(x: float, y: float, radius: float = 0.08) -> ObstacleEstimate:
    return ObstacleEstimate("post", 0, SE2(x, y, 0.0), np.eye(3), radius)


A, B = SE2(-1.2, 0.9, 0.0), SE2(0.5, 0.0, 0.0)
IN_LANE = SE2(-0.1, 0.0, 0.0)


def test_who_has_a_route_sets_out_at_once_and_who_is_not_in_the_way_stays(setup: CoordinationSetup) -> None:
    base = Base(setup, _units(a=A, b=B, c=SE2(1.0, 1.2, 0.0)))
    assert base.dispatch()
    assert base.under_way == {"a": DOCK.name}
    assert base.tasks.state(DOCK.name) is TaskState.GRANTED
    assert base.units["a"].enters == ("b", "rear")
    assert not base.dispatch()


@pytest.mark.parametrize("one_by_one", [False, True])
def test_units_set_out_together_unless_one_goes_after_the_other(
    one_by_one: bool, setup: CoordinationSetup
) -> None:
    moves = [Task(name, TaskKind.MOVE, name, pose=SE2(0.8, y, 0.0)) for name, y in (("a", 0.9), ("c", -0.9))]
    base = Base(setup, _units(a=A, c=SE2(-1.2, -0.9, 0.0)), moves, one_by_one)
    assert base.dispatch()
    assert base.under_way == ({"a": "a"} if one_by_one else {"a": "a", "c": "c"})
    assert [base.units[name].order for name in "ac"] == [1, 0 if one_by_one else 2]
    assert not base.dispatch()


def test_whoever_stands_in_the_lane_is_sent_to_where_it_is_in_nobody_s_way(setup: CoordinationSetup) -> None:
    """One after the other, whatever else others are under way for.

    Whoever stands elsewhere stays, even nearer to the port.
    """
    X_WC = SE2(-0.3, 0.05, 0.0)
    units = _units(a=A, b=B, c=X_WC, d=SE2(-0.7, 0.0, 0.0), e=SE2(0.3, 0.36, 0.0))
    units |= {"f": UnitRecord("f", SE2(1.7, -1.0, 0.5 * math.pi)), "unseen": UnitRecord("unseen")}
    base = Base(setup, units, [DOCK, Task("f", TaskKind.MOVE, "f", pose=SE2(1.7, 0.9, 0.5 * math.pi))])
    assert base.dispatch()
    assert base.dispatch()
    assert base.under_way == {"c": None, "f": "f"}
    assert (units["c"].evasions, units["c"].reason) == (1, "makes way")
    end = units["c"].destination
    seat = setup.lanes.body.docked(B, "rear")
    assert not setup.lanes.closed_by(seat, end)
    for X in (A, B, units["d"].pose, units["e"].pose):
        assert math.hypot(end.x - X.x, end.y - X.y) > setup.lanes.body.radius
    assert not base.dispatch(), "nobody else goes while one makes way"
    units["c"].X_WU = end
    units["c"].stand(2_000_000_000, "")
    assert base.dispatch()
    assert base.under_way == {"d": None, "f": "f"}
    end = units["d"].destination
    assert math.hypot(end.x + 0.7, end.y) < 1.0, "the nearest place that is free"


def test_whoever_makes_way_goes_to_the_nearest_place_that_is_free_and_for_no_task(
    setup: CoordinationSetup,
) -> None:
    units = _units(a=A, b=B, c=SE2(-0.3, -0.1, 2.0))
    c, seat = units["c"], setup.lanes.body.docked(B, "rear")
    c.task, c.evasions = "before", 1
    places = waiting_places(setup.lanes, setup.finder.box, [seat], units.values(), ())
    x, y = min(places.tolist(), key=lambda place: math.dist(place, (c.pose.x, c.pose.y)))
    base = Base(setup, units)
    assert base.dispatch()
    assert base.under_way == {"c": None}
    yaw = math.atan2(y - c.pose.y, x - c.pose.x)
    assert c.destination.as_array() == pytest.approx([x, y, yaw], abs=1e-6)
    assert c.evasions == 2


def test_a_task_that_nobody_can_begin_keeps_no_one_from_making_way_for_a_later_one(
    setup: CoordinationSetup,
) -> None:
    """Its unit or its target was never seen, an obstacle stays in the lane, or its port is taken."""
    units = _units(a=A, b=B, c=IN_LANE, d=SE2(1.2, -0.9, 0.0), e=setup.lanes.body.docked(B, "right"))
    units["e"].state, units["e"].holder = UnitState.DOCKED, ("b", "right")
    units |= {name: UnitRecord(name) for name in ("unseen", "hidden")}
    vain = [
        Task("unseen", TaskKind.MOVE, "unseen", pose=SE2()),
        Task("d to hidden", TaskKind.DOCK, "d", parent_unit="hidden", port="rear"),
        Task("d to left", TaskKind.DOCK, "d", parent_unit="b", port="left"),
        Task("d to right", TaskKind.DOCK, "d", parent_unit="b", port="right"),
    ]
    base = Base(setup, units, [*vain, DOCK])
    assert base.dispatch(_post(0.4, 0.6, 0.05))
    assert base.under_way == {"c": None}


def test_nobody_makes_way_where_that_would_not_help(setup: CoordinationSetup) -> None:
    def base(**changes: SE2) -> Base:
        """The target itself does not go anywhere."""
        units = _units(**{"a": A, "b": B, "c": IN_LANE, **changes})
        units["b"].evasions = TIRED
        return Base(setup, units)

    assert not base().dispatch(_post(0.1, 0.0, 0.03))

    seat = setup.lanes.body.docked(B, "rear")
    taken = base(d=seat)
    taken.units["d"].state, taken.units["d"].holder = UnitState.DOCKED, ("b", "rear")
    assert not taken.dispatch()

    failed = base(d=SE2(-0.5, 0.0, 0.0))
    failed.units["d"].state = UnitState.FAILED
    assert not failed.dispatch()

    dead = base()
    dead.units["b"].state = UnitState.FAILED
    del dead.units["c"]
    assert not dead.dispatch(), "nobody is allowed into the port of a unit that has failed"

    tired = base()
    tired.units["a"].evasions = tired.units["c"].evasions = TIRED
    assert not tired.dispatch()
    tired.units["c"].evasions -= 1
    assert tired.dispatch()


def _boxed_in(setup: CoordinationSetup) -> Base:
    """A unit in a corner, on its way to a place in the open, and another one right in front of it.

    A third one stands nearer to that place, but in nobody's way.
    """
    x0, _, y0, _ = setup.finder.box
    room = setup.lanes.spec.border_m + setup.lanes.body.offset
    a = SE2(x0 + room, y0 + room, 0.25 * math.pi)
    task = Task("a", TaskKind.MOVE, "a", pose=SE2(0.0, 0.9, 0.0))
    return Base(setup, _units(a=a, c=a @ SE2(0.24, 0.0, 0.0), d=SE2(1.0, -0.9, 0.0)), [task])


def test_one_that_stands_in_no_lane_is_sent_away_only_where_that_opens_a_route(
    setup: CoordinationSetup,
) -> None:
    """The one that was nearest to the end of the way went first, and a mission lost its time."""
    base = _boxed_in(setup)
    assert base.dispatch()
    assert base.under_way == {"c": None}
    closed = _boxed_in(setup)
    assert not closed.dispatch(_post(0.0, 0.9, 0.3)), "nobody, for no route leads there from anywhere"
    beside = _boxed_in(setup)
    assert beside.dispatch(_post(-0.4, 0.9, 0.05)), "only one that docks needs the ground behind its end"
    assert beside.under_way == {"c": None}


def test_whoever_stands_in_the_only_way_goes_before_the_unit_of_the_task(setup: CoordinationSetup) -> None:
    """The unit of the task drove back and forth three times before the other one was sent away."""
    wall = [_post(-0.6, y, 0.15) for y in (-1.35, -1.0, -0.65, -0.4, 0.4, 0.65, 1.0, 1.35)]
    task = Task("a", TaskKind.MOVE, "a", pose=SE2(1.5, 0.9, 0.0))
    base = Base(setup, _units(a=SE2(-1.4, 0.2, 0.0), c=SE2(-0.35, 0.0, 1.0)), [task])
    assert base.dispatch(*wall)
    assert base.under_way == {"c": None}
    target = SE2(1.3, 0.8, 0.0)
    both = _units(a=SE2(-1.4, 0.2, 0.0), b=target, d=SE2(-0.85, 0.0, 1.0), c=SE2(-0.35, 0.0, 1.0))
    base = Base(setup, both)
    assert base.dispatch(*wall)
    assert base.under_way == {"c": None}, "of two, the nearer one to the end, but never the target"


def _at_border(setup: CoordinationSetup, **others: SE2) -> Base:
    """The port of b looks at the border, right in front of it."""
    return Base(setup, _units(a=SE2(0.6, 0.9, 0.0), b=SE2(-1.6, 0.0, 0.0), **others))


def test_a_target_goes_to_where_its_port_can_be_reached(setup: CoordinationSetup) -> None:
    base = _at_border(setup, c=SE2(0.6, -0.9, 0.0))
    other = Task("c to b", TaskKind.DOCK, "c", parent_unit="b", port="left")
    base.tasks = TaskList([DOCK, other])
    b = base.units["b"]
    b.task, b.evasions = "before", 1
    assert base.dispatch()
    assert base.under_way == {"b": None, "a": DOCK.name, "c": other.name}, "they drive to where it will stand"
    assert (b.evasions, b.reason) == (2, "goes where its ports can be reached")
    assert b.enters is None
    nowhere = _at_border(setup)
    nowhere.dispatch(_post(0.3, 0.0, 1.4), _post(-1.6, 0.8, 0.3), _post(-1.6, -0.8, 0.3))
    assert "b" not in nowhere.under_way, "there is no such place"
    end = setup.lanes.end(setup.lanes.body.docked(b.destination, "rear"))
    x0, x1, y0, y1 = setup.finder.box
    assert x0 < end.x < x1
    assert y0 < end.y < y1


def test_a_target_goes_to_where_those_can_dock_who_dock_to_the_first(setup: CoordinationSetup) -> None:
    """Once the first has docked, the target stays: the next one had the border in front of its port."""
    then = Task("c to a", TaskKind.DOCK, "c", parent_unit="a", port="left", after=(DOCK.name,))
    units = _units(a=SE2(-1.4, 0.9, 0.0), b=SE2(0.8, 1.1, 0.0), c=SE2(-1.0, -0.9, 0.0))
    base = Base(setup, units, [DOCK, then])
    assert base.dispatch()
    assert base.under_way.keys() == {"a", "b"}
    body, (_, _, _, y1) = setup.lanes.body, setup.finder.box
    end = setup.lanes.end(body.docked(body.docked(units["b"].destination, "rear"), "left"))
    assert end.y < y1
    leaves = Task("a", TaskKind.MOVE, "a", pose=SE2(-1.4, 0.9, 0.0), after=(DOCK.name,))
    base = Base(setup, _units(**{name: unit.pose for name, unit in units.items()}), [DOCK, leaves, then])
    assert base.dispatch()
    assert base.under_way == {"a": DOCK.name}, "nobody knows where a is by then"


def test_a_target_stays_where_it_carries_others_or_has_moved_in_vain(setup: CoordinationSetup) -> None:
    seat = setup.lanes.body.docked(SE2(-1.6, 0.0, 0.0), "left")
    carries = _at_border(setup, c=seat)
    carries.units["c"].state, carries.units["c"].holder = UnitState.DOCKED, ("b", "left")
    tired, root = _at_border(setup), _at_border(setup)
    tired.units["b"].evasions = TIRED
    root.units["b"].state = UnitState.DOCKED
    for base in (carries, tired, root):
        assert not base.dispatch(), "a would not reach the port from elsewhere, either"


def test_a_target_whose_port_can_be_reached_stays_whoever_stands_there(setup: CoordinationSetup) -> None:
    """Whoever stands there can drive away."""
    base = Base(setup, _units(a=A, b=B, c=IN_LANE))
    base.dispatch()
    assert "b" not in base.under_way


def test_a_target_stays_where_only_the_port_of_another_one_cannot_be_reached(
    setup: CoordinationSetup,
) -> None:
    units = _units(a=A, b=B, c=SE2(1.2, -0.9, 0.0), e=SE2(-1.6, -0.9, 0.0))
    units["e"].evasions = TIRED
    base = Base(setup, units, [DOCK, Task("c to e", TaskKind.DOCK, "c", parent_unit="e", port="rear")])
    assert base.dispatch()
    assert base.under_way == {"a": DOCK.name}


def test_ports_of_two_units_are_driven_to_at_once(setup: CoordinationSetup) -> None:
    units = _units(a=A, b=B, c=SE2(-1.2, -0.3, 0.0), e=SE2(0.5, -0.9, 0.0))
    other = Task("c to e", TaskKind.DOCK, "c", parent_unit="e", port="rear")
    base = Base(setup, units, [DOCK, other])
    assert base.dispatch()
    assert base.under_way == {"a": DOCK.name, "c": other.name}


@pytest.mark.parametrize("kind", [TaskKind.UNDOCK, TaskKind.MOVE])
def test_a_docked_unit_leaves_its_port_for_a_task_that_names_it(
    kind: TaskKind, setup: CoordinationSetup
) -> None:
    """And for no other: what any unit may do is not for one that is in a port."""
    pose = SE2(-1.0, 0.5, 0.0) if kind is TaskKind.MOVE else None
    for unit in (None, "a"):
        units = _units(a=setup.lanes.body.docked(B, "rear"), b=B)
        units["a"].state, units["a"].holder = UnitState.DOCKED, ("b", "rear")
        units["b"].state = UnitState.DOCKED
        base = Base(setup, units, [Task("leave", kind, unit, pose=pose)])
        assert base.dispatch() is (unit is not None)
        assert base.under_way == ({} if unit is None else {"a": "leave"})
        assert base.units["a"].unlocks is (unit is not None)


def test_a_docked_unit_makes_way_only_if_it_is_to_leave_its_port_by_now(setup: CoordinationSetup) -> None:
    """It may be in the port of a task, or at the end of it; but while somebody is under way it waits."""
    body = setup.lanes.body
    swap = Task("swap", TaskKind.DOCK, "a", parent_unit="b", port="left")
    back = Task("back", TaskKind.DOCK, "c", parent_unit="b", port="rear", behind=("swap",))
    move = Task("move", TaskKind.MOVE, "d", pose=SE2(-1.0, -1.0, 0.0))
    there = replace(move, name="swap", pose=body.docked(B, "left"))
    for tasks, begun, leaves in (
        ([swap, back], False, True),
        ([swap], False, False),
        ([there, back], False, True),
        ([there], False, False),
        ([swap, replace(back, after=("move",)), replace(move, unit="unseen")], False, False),
        ([swap, back, move], True, False),
    ):
        units = _units(a=body.docked(B, "rear"), b=B, c=body.docked(B, "left"), d=SE2(-1.3, -1.0, 0.0))
        units["unseen"] = UnitRecord("unseen")
        for name, port in (("a", "rear"), ("c", "left")):
            units[name].state, units[name].holder = UnitState.DOCKED, ("b", port)
        base = Base(setup, units, tasks)
        assert base.dispatch() is (leaves or begun)
        base.dispatch()
        assert base.under_way == ({"c": None} if leaves else {"d": "move"} if begun else {})


@pytest.mark.parametrize("state", [UnitState.FAILED, UnitState.LOST])
def test_whoever_is_out_of_action_or_unseen_does_not_set_out(
    state: UnitState, setup: CoordinationSetup
) -> None:
    move = Task("a", TaskKind.MOVE, "a", pose=SE2(0.8, 0.9, 0.0))
    assert not Base(setup, {"a": UnitRecord("a", A, state=state)}, [move]).dispatch()
    assert not Base(setup, {"a": UnitRecord("a")}, [move]).dispatch()


def test_whoever_stands_where_others_still_have_to_drive_waits_until_they_have_passed(
    setup: CoordinationSetup,
) -> None:
    listed = [Task(name, TaskKind.MOVE, name, pose=SE2(0.8, y, 0.0)) for name, y in (("a", 0.9), ("c", -0.9))]
    base = Base(setup, _units(a=A, c=SE2(-1.2, -0.9, 0.0)), listed[:1])
    assert base.dispatch()
    a, c = base.units["a"], base.units["c"]
    assert a.track is not None
    c.X_WU, base.tasks = a.track.at(0.5 * a.track.length), TaskList(listed[1:])
    assert not base.dispatch()
    assert base.dispatcher.waits_for_tracks
    a.progress = a.track.length
    assert base.dispatch()
    assert not base.dispatcher.waits_for_tracks


def test_whoever_makes_way_gets_its_own_route_only_when_it_has_come_to_rest(setup: CoordinationSetup) -> None:
    move = Task("a", TaskKind.MOVE, "a", pose=SE2(0.8, 0.9, 0.0))
    base = Base(setup, _units(a=A), [move])
    a = base.units["a"]
    a.set_out(standing(A), None, 1, 0)
    assert not base.dispatch()
    a.stand(2_000_000_000, "")
    assert base.dispatch()


def test_an_obstacle_in_the_lane_ahead_is_told_of_those_who_drive_to_it(setup: CoordinationSetup) -> None:
    base = Base(setup, _units(a=A, b=B, c=SE2(1.0, 1.2, 0.0)))
    base.dispatcher.ends.obstacles = (_post(0.1, 0.0, 0.03),)
    assert [base.dispatcher.ahead_in_lane(unit) for unit in base.units.values()] == [None] * 3
    assert base.dispatch()
    base.dispatcher.ends.obstacles = (_post(0.1, 0.0, 0.03),)
    assert [base.dispatcher.ahead_in_lane(unit) for unit in base.units.values()] == ["post", None, None]
    base.units["a"].stand(2_000_000_000, "")
    assert base.dispatcher.ahead_in_lane(base.units["a"]) is None
    moves = Base(setup, _units(a=A), [Task("a", TaskKind.MOVE, "a", pose=B)])
    assert moves.dispatch()
    moves.dispatcher.ends.obstacles = (_post(0.65, 0.0, 0.03),)
    assert moves.dispatcher.ahead_in_lane(moves.units["a"]) is None, "it drives into no port"


def test_another_unit_gets_a_task_for_which_the_nearest_finds_no_route(setup: CoordinationSetup) -> None:
    near, far = _boxed_in(setup).units["a"].pose, SE2(1.2, 0.9, 0.0)
    task = Task("place", TaskKind.MOVE, pose=SE2(-0.9, -0.4, 0.0), stays=True)
    units = _units(a=near, c=near @ SE2(0.24, 0.0, 0.0), d=far)
    units["c"].state = UnitState.FAILED
    base = Base(setup, units, [task])
    assert base.dispatcher.assigner.assignment(base.tasks) == {"place": "a"}
    assert base.dispatch()
    assert base.under_way == {"d": "place"}


def test_a_task_waits_for_which_no_unit_is_left(setup: CoordinationSetup) -> None:
    """The only one is boxed in, and has another task."""
    base = _boxed_in(setup)
    base.units["c"].state = UnitState.FAILED
    del base.units["d"]
    base.tasks = TaskList(
        [Task(name, TaskKind.MOVE, pose=SE2(x, 0.0, 0.0)) for name, x in (("1", 0.0), ("2", 1.0))]
    )
    assert not base.dispatch()
    assert base.dispatcher.hindrance(base.tasks.open[1], base.tasks) == "a finds no route past c"


@pytest.mark.parametrize("state", [UnitState.DOCKED, UnitState.FAILED])
def test_nobody_sets_out_for_a_port_of_a_place_whose_unit_has_failed(
    state: UnitState, setup: CoordinationSetup
) -> None:
    root = Task("root", TaskKind.MOVE, pose=B, stays=True)
    base = Base(setup, _units(a=A, b=B), [root, Task("arm", TaskKind.DOCK, parent="root", port="rear")])
    base.tasks.grant("root")
    base.tasks.finish("root")
    base.units["b"].task, base.units["b"].state = "root", state
    assert base.dispatch() is (state is UnitState.DOCKED)


def test_of_the_others_the_nearest_with_a_route_gets_the_task(setup: CoordinationSetup) -> None:
    """Two units are boxed in, each in its corner; of the two in the open the nearer one goes."""
    x0, _, y0, y1 = setup.finder.box
    room = setup.lanes.spec.border_m + setup.lanes.body.offset
    corners = {
        "a": SE2(x0 + room, y0 + room, 0.25 * math.pi),
        "b": SE2(x0 + room, y1 - room, -0.25 * math.pi),
    }
    units = _units(**corners, far=SE2(1.7, 0.9, 0.0), near=SE2(0.4, 0.9, 0.0))
    for name, X in corners.items():
        units[f"before_{name}"] = UnitRecord(
            f"before_{name}", X @ SE2(0.24, 0.0, 0.0), state=UnitState.FAILED
        )
    base = Base(setup, units, [Task("place", TaskKind.MOVE, pose=SE2(-0.9, -0.4, 0.0), stays=True)])
    assert base.dispatcher.assigner.assignment(base.tasks) == {"place": "a"}
    assert base.dispatch()
    assert base.under_way == {"near": "place"}


@pytest.mark.parametrize("unseen", ["a", "b"])
def test_nobody_makes_way_while_nobody_knows_from_where_or_where_to(
    unseen: str, setup: CoordinationSetup
) -> None:
    units = _units(**{name: X for name, X in (("a", A), ("b", B), ("c", IN_LANE)) if name != unseen})
    units[unseen] = UnitRecord(unseen)
    assert not Base(setup, units).dispatch()


def test_a_unit_that_has_stopped_short_is_docked_to_when_nobody_drives_to_where_it_was_to_be(
    setup: CoordinationSetup,
) -> None:
    right = Task("c to b", TaskKind.DOCK, "c", parent_unit="b", port="left")
    base = Base(setup, _units(a=A, b=B, c=SE2(-1.2, -0.9, 0.0)), [DOCK, right])
    assert base.dispatch()
    assert base.under_way == {"a": DOCK.name, "c": right.name}
    base.tasks.reopen(right.name)
    base.units["c"].stand(2_000_000_000, "")
    base.units["b"].X_WU = B @ SE2(0.3, 0.0, 0.0)  # elsewhere than where a drives to
    base.dispatch()
    assert right.name not in base.under_way.values()
    base.tasks.reopen(DOCK.name)
    for unit in base.units.values():
        unit.stand(2_000_000_000, "")
    assert base.dispatch()
    assert right.name in base.under_way.values()


@pytest.mark.parametrize("docked", [True, False])
def test_a_neighbour_at_the_same_assembly_closes_a_lane_by_its_dock_and_not_by_sight(
    setup: CoordinationSetup, docked: bool
) -> None:
    """Sight shows it 4 cm elsewhere, where it would stand in the lane to the port beside its own."""
    body = setup.lanes.body
    units = _units(a=A, b=B, c=body.docked(B, "left") @ SE2(0.0, -0.04, 0.0))
    units["c"].state = UnitState.DOCKED
    if docked:
        units["c"].holder = ("b", "left")
    locate(units, body)
    base = Base(setup, units)
    closed = "a cannot dock: c closes the lane to b.rear"
    X_WE = body.docked(units["b"].pose, "rear")
    assert base.dispatcher.ends.hindrance(units["a"], X_WE, ("b", "rear")) == (
        None if docked else closed.removeprefix("a ")
    )


def test_hindrances_are_told_by_unit(setup: CoordinationSetup) -> None:
    base = Base(setup, _units(a=A, b=B, c=IN_LANE))
    assert base.dispatcher.hindrance(DOCK, base.tasks) == "a cannot dock: c closes the lane to b.rear"
    free = Task("place", TaskKind.MOVE, pose=SE2(), stays=True)
    units = {"a": UnitRecord("a"), "b": UnitRecord("b", B, state=UnitState.DOCKED)}
    units["c"] = UnitRecord("c", state=UnitState.FAILED)
    unseen = Base(setup, units, [free])
    assert unseen.dispatcher.hindrance(free, unseen.tasks) == "no unit is left; never seen from above: a"
    failed = Base(setup, {"c": UnitRecord("c", B, state=UnitState.FAILED)}, [free])
    assert failed.dispatcher.hindrance(free, failed.tasks) == "no unit is left"
    waits = Base(setup, _units(a=A, d=SE2(-1.2, 0.1, 0.0)), [free])
    assert waits.dispatcher.hindrance(free, waits.tasks) == "d finds no route", "the one that is to do it"
    boxed = _boxed_in(setup)
    boxed.units["c"].state = UnitState.FAILED
    assert boxed.dispatcher.hindrance(boxed.listed[0], boxed.tasks) == "a finds no route past c"
