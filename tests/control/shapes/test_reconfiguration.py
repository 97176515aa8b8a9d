"""From one form to another by leaves: every hop can be made, and no fewer would do."""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Callable, Mapping, Sequence
from typing import get_args

import numpy as np
import pytest

from msrr_control.coordination.setup import CoordinationSetup
from msrr_control.shapes.forms import Form, Hop, Ports, after_hop, beside
from msrr_control.shapes.hop_rules import LEAST_WAY_OUT_M, HopRules
from msrr_control.shapes.least_hops import least_hops
from msrr_control.shapes.place_by_place import place_by_place
from msrr_control.shapes.reconfiguration import (
    assembly_ports,
    hops_between,
    reconfiguration_tasks,
    shape_ports,
    tasks_from,
)
from msrr_control.shapes.shape import LEAST_GAP_M, Shape, build_pattern
from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import ObstacleEstimate
from msrr_scenes.specs.mission import Pattern
from tests.conftest import not_none

WIDE = (-9.0, 9.0, -9.0, 9.0)
PORTS = ("rear", "left", "right")
PAIRS = list(itertools.combinations(get_args(Pattern), 2))


def _form(shape: Shape) -> dict[Ports, str]:
    return dict.fromkeys(shape_ports(shape).values(), "")


def _least(start: set[Ports], goal: set[Ports]) -> int:
    """No way has fewer hops than there are places to fill."""
    return len(goal - start)


def _made(start: Mapping[Ports, str], hops: Sequence[Hop], setup: CoordinationSetup) -> dict[Ports, str]:
    """Return the form to which the hops lead, each of which has to be one that a unit can make."""
    taken, poses, body = dict(start), HopRules(setup.lanes, SE2(), WIDE).pose, setup.lanes.body
    for leaves, enters in hops:
        unit = taken.pop(leaves)
        others = [poses(place) for place in taken if place != leaves[:-1]]
        out = [poses(leaves) @ SE2(-0.02 * k, 0.0, 0.0) for k in range(25)]
        assert min((body.gap(X, other) for X in out for other in others), default=1.0) > LEAST_GAP_M - 1e-6
        assert not any(setup.lanes.closed_by(poses(enters), poses(p)) for p in taken if p != enters[:-1])
        assert not any(place[:-1] == leaves for place in taken if place), "somebody is in its port"
        assert enters not in taken
        assert enters[:-1] in taken
        taken[enters] = unit
        shape = Shape.from_tree(
            {
                "/".join(("r", *place)): "/".join(("r", *place[:-1])) + "." + place[-1] if place else "root"
                for place in sorted(taken)
            }
        )
        assert shape.problem(setup.lanes.body) is None
    return taken


@pytest.mark.parametrize(("first", "second"), PAIRS)
def test_every_hop_can_be_made_and_the_last_one_ends_in_the_shape(
    first: Pattern, second: Pattern, setup: CoordinationSetup
) -> None:
    """Every hop can be made backwards, so the fewest of one way are the fewest of the other."""
    start, goal = _form(build_pattern(first, 5)), _form(build_pattern(second, 5))
    rules = HopRules(setup.lanes, SE2(), WIDE)
    there, back = hops_between(start, goal, rules), hops_between(goal, start, rules)
    assert _made(start, there, setup) == goal
    assert _made(goal, back, setup) == start
    assert len(there) == len(back) >= _least(set(start), set(goal))


def test_the_largest_common_part_stays_where_leaves_allow_it(setup: CoordinationSetup) -> None:
    for first, second, hops in (("line", "tee", 2), ("cross", "line", 3), ("comb", "tee", 1)):
        start, goal = _form(build_pattern(first, 6)), _form(build_pattern(second, 6))
        found = hops_between(start, goal, HopRules(setup.lanes, SE2(), WIDE))
        assert len(found) == _least(set(start), set(goal)) == hops


@pytest.mark.parametrize("other", ["line", "tee", "cross", "comb"])
def test_the_search_is_quick_where_units_have_to_step_aside(other: Pattern, setup: CoordinationSetup) -> None:
    """Of the patterns these need the most hops more than there are places to fill."""
    start, goal = _form(build_pattern(other, 12)), _form(build_pattern("zigzag", 12))
    rules = HopRules(setup.lanes, SE2(), WIDE)
    there, back = hops_between(start, goal, rules), hops_between(goal, start, rules)
    assert len(there) == len(back) > _least(set(start), set(goal))


def _distances(rules: HopRules, start: Form, most: int) -> dict[Form, int]:
    """Return all forms within reach of so many hops, with the least number of hops to each."""
    distances, queue = {start: 0}, [start]
    for form in queue:  # the list grows while it is walked
        if distances[form] < most:
            taken = dict(form)
            for hop in rules.hops(taken):
                following = after_hop(form, hop, taken[hop.start])
                if following not in distances:
                    distances[following] = distances[form] + 1
                    queue.append(following)
    return distances


@pytest.mark.parametrize("named", [False, True])
@pytest.mark.parametrize("pattern", get_args(Pattern))
def test_the_bound_of_the_search_is_never_too_large_and_tells_more_than_the_places_to_fill(
    named: bool, pattern: Pattern, setup: CoordinationSetup
) -> None:
    """Compared with the least number of hops to every form that three or four hops lead to."""
    places = shape_ports(build_pattern(pattern, 5))
    start = frozenset((ports, name if named else "") for name, ports in places.items())
    rules = HopRules(setup.lanes, SE2(), WIDE)
    tight = 0
    for form, distance in _distances(rules, start, 3 if named else 4).items():
        least = least_hops(start, form, rules.closes)
        assert len(form - start) <= least <= distance
        tight += least > len(form - start)
    assert tight > 0


#: Forms of a root with units at its ports, the one that is wanted, what closes the lane to the right port,
#: and the fewest hops; a unit is one letter, the ports are those from the root.
BOUNDS: dict[str, tuple[dict[str, str], dict[str, str], list[str], int]] = {
    "nothing is missing": ({"left": "a"}, {"left": "a"}, [], 0),
    "one goes to a free port": ({"left": "a"}, {"right": "a"}, [], 1),
    "one steps aside and comes back": (
        {"left": "a", "rear": "b"},
        {"left": "a", "right": "b"},
        ["left"],
        3,
    ),
    "so does what it carries": (
        {"left": "a", "left rear": "c", "rear": "b"},
        {"left": "a", "left rear": "c", "right": "b"},
        ["left"],
        5,
    ),
    "two change places": ({"left": "a", "rear": "b"}, {"left": "b", "rear": "a"}, [], 3),
    "one takes along what it carries": (
        {"left": "a", "left rear": "c"},
        {"right": "a", "right rear": "c"},
        [],
        3,
    ),
    "anybody fills a port, two lie in its lane": (
        {"left": "", "rear": "", "left rear": ""},
        {"left": "", "right": "", "right rear": ""},
        ["left rear", "rear"],
        3,
    ),
}


@pytest.mark.parametrize("name", BOUNDS)
def test_the_bound_is_the_fewest_hops_where_that_is_plain(name: str) -> None:
    start, goal, closing, hops = BOUNDS[name]
    root = {"": "r" if any(goal.values()) else ""}
    forms = [
        frozenset((tuple(k.split()), unit) for k, unit in (root | form).items()) for form in (start, goal)
    ]

    def closes(place: Ports, other: Ports) -> bool:
        return place == ("right",) and " ".join(other) in closing

    assert least_hops(forms[0], forms[1], closes) == hops


@pytest.mark.parametrize(("count", "find"), [(6, hops_between), (7, place_by_place)])
def test_units_that_change_places_step_aside(
    count: int, find: Callable[..., list[Hop] | None], setup: CoordinationSetup
) -> None:
    """Every unit of a line takes the place before its own, and the first one the last, in few hops.

    With seven the search for the fewest gives up, and :func:`hops_between` goes place by place.
    """
    names = [f"u{k}" for k in range(1, count + 1)]
    line = [("rear",) * k for k in range(1, count + 1)]
    start = {(): "u0", **dict(zip(line, names, strict=True))}
    goal = {(): "u0", **dict(zip(line, [*names[1:], names[0]], strict=True))}
    rules = HopRules(setup.lanes, SE2(), WIDE)
    hops = not_none(find(start, goal, rules))
    assert _made(start, hops, setup) == goal
    least = least_hops(frozenset(start.items()), frozenset(goal.items()), rules.closes)
    assert len(names) < least <= len(hops) <= 1.5 * least


def _grown(rules: HopRules, names: Sequence[str], rng: random.Random) -> dict[Ports, str]:
    """Units with names, the root first, that have docked one after another wherever they could."""
    form: dict[Ports, str] = {(): names[0]}
    for name in names[1:]:
        places = [(*holder, port) for holder in form for port in PORTS]
        free = [place for place in places if place not in form]
        form[rng.choice([place for place in free if not any(rules.closes(place, p) for p in form)])] = name
    return form


@pytest.mark.parametrize(
    ("units", "named"), [(6, True), (9, True), pytest.param(16, True, marks=pytest.mark.nightly), (16, False)]
)
def test_place_by_place_a_way_leads_from_any_form_to_any_other(
    units: int, named: bool, setup: CoordinationSetup
) -> None:
    """The search for the fewest hops finds no way for most of the forms of 16 units with names."""
    rules, rng = HopRules(setup.lanes, SE2(), WIDE), random.Random(units)
    names = [f"u{k}" for k in range(units)]
    start = _grown(rules, names, rng)
    goal = _grown(rules, [names[0], *rng.sample(names[1:], units - 1)], rng)
    if not named:
        start, goal = dict.fromkeys(start, ""), dict.fromkeys(goal, "")
    hops = place_by_place(start, goal, rules)
    assert hops is not None
    assert _made(start, hops, setup) == goal
    fewest = least_hops(frozenset(start.items()), frozenset(goal.items()), rules.closes)
    assert fewest <= len(hops) <= 4 * units
    assert place_by_place(goal, goal, rules) == []


def test_place_by_place_takes_over_where_the_search_for_the_fewest_hops_takes_too_long(
    setup: CoordinationSetup, monkeypatch: pytest.MonkeyPatch
) -> None:
    start, goal = _form(build_pattern("cross", 8)), _form(build_pattern("zigzag", 8))
    rules = HopRules(setup.lanes, SE2(), WIDE)
    fewest = hops_between(start, goal, rules)
    monkeypatch.setattr("msrr_control.shapes.reconfiguration._MOST_FORMS", 5)
    hops = hops_between(start, goal, rules)
    assert hops == place_by_place(start, goal, rules)
    assert _made(start, hops, setup) == goal
    assert len(fewest) <= len(hops) <= 2 * len(fewest)


def test_an_assembly_is_one_tree() -> None:
    assert assembly_ports({"b": "a.rear", "c": "b.left"}) == {"a": (), "b": ("rear",), "c": ("rear", "left")}
    with pytest.raises(SceneError, match="exactly one root, found b, d"):
        assembly_ports({"a": "b.rear", "c": "d.rear"})


def test_named_units_end_where_they_are_named(setup: CoordinationSetup) -> None:
    holders = {"b": "a.rear", "c": "b.rear", "d": "c.rear"}
    shape = Shape.from_tree({"a": "root", "b": "a.rear", "d": "b.rear", "c": "b.left"})
    tasks = reconfiguration_tasks(holders, shape, setup.lanes, SE2(), WIDE, named=True)
    now = dict(holders)
    task_units = {task.name: task.unit for task in tasks}
    for task in tasks:
        assert task.unit is not None
        holder = task.parent_unit if task.parent is None else task_units[task.parent]
        now[task.unit] = f"{holder}.{task.port}"
    assert now == {"b": "a.rear", "d": "b.rear", "c": "b.left"}


@pytest.mark.parametrize("pattern", ["line", "tee", "comb"])
def test_the_tasks_of_all_hops_lead_to_the_shape(pattern: Pattern, setup: CoordinationSetup) -> None:
    """From a zigzag in a corner, where units come to a port twice on their way: both tasks had one name."""
    X_WR = SE2(-0.16, -0.91, math.radians(-45.0))
    places, goal = shape_ports(build_pattern("zigzag", 6)), build_pattern(pattern, 6)
    name_of = {ports: name for name, ports in places.items()}
    joints = {name: f"{name_of[ports[:-1]]}.{ports[-1]}" for name, ports in places.items() if ports}
    tasks = reconfiguration_tasks(joints, goal, setup.lanes, X_WR, setup.finder.box)
    unit_of = {task.name: task.unit for task in tasks}
    assert len(unit_of) == len(tasks)
    last: dict[str | None, str] = {}  # the task that has brought a unit to where it is
    hops: list[str] = []
    for task in tasks:
        assert task.unit is not None
        holder = task.parent_unit if task.parent is None else unit_of[task.parent]
        joints[task.unit] = f"{holder}.{task.port}"
        assert task.parent == last.get(holder)
        assert task.after == tuple(last[name] for name in (task.unit,) if name in last)
        assert task.behind == tuple(list(last.values())[-1:])
        hops.append(f"{task.unit} to {joints[task.unit]}")
        times = hops.count(hops[-1])
        assert task.name == (hops[-1] if times == 1 else f"{hops[-1]} ({times})")
        last.pop(task.unit, None)
        last[task.unit] = task.name
    assert set(assembly_ports(joints).values()) == set(shape_ports(goal).values())


@pytest.mark.parametrize("yaw_deg", [0.0, 90.0, 180.0, 270.0])
def test_a_place_and_its_lane_fit_in_a_box_that_just_holds_them(
    yaw_deg: float, setup: CoordinationSetup
) -> None:
    lanes, X_WR = setup.lanes, SE2(0.3, -0.2, math.radians(yaw_deg))
    place, room = lanes.body.docked(X_WR, "left"), lanes.spec.border_m + lanes.body.offset
    x, y = zip(*((X.x, X.y) for X in (place, lanes.end(place))), strict=True)
    least = [min(x) - room, max(x) + room, min(y) - room, max(y) + room]
    for side, outwards in enumerate((-1.0, 1.0, -1.0, 1.0)):
        for off, fits in ((0.001, True), (-0.001, False)):
            box = [limit + 5.0 * way for limit, way in zip(least, (-1.0, 1.0, -1.0, 1.0), strict=True)]
            box[side] = least[side] + outwards * off
            x0, x1, y0, y1 = box
            assert (HopRules(lanes, X_WR, (x0, x1, y0, y1)).hindrance(("left",)) is None) is fits


def test_a_unit_with_the_border_behind_it_does_not_leave_its_place(setup: CoordinationSetup) -> None:
    """The mission began, and the first unit could not back out; here another one goes where it can."""
    lanes, limit = setup.lanes, -0.2 - 0.15
    line = Shape.from_tree({"a": "root", "b": "a.left"})
    with pytest.raises(SceneError, match="no order of leaving and docking again leads"):
        reconfiguration_tasks({"b": "a.rear"}, line, lanes, SE2(), (limit, 9.0, -9.0, 9.0))
    assert reconfiguration_tasks({"b": "a.rear"}, line, lanes, SE2(), (limit - 0.15, 9.0, -9.0, 9.0))
    holders = {"b": "a.rear", "c": "a.left"}
    wanted = Shape.from_tree({"a": "root", "b": "a.rear", "c": "a.right"})
    for left in (limit, limit - 5.0):
        tasks = reconfiguration_tasks(holders, wanted, lanes, SE2(), (left, 9.0, -9.0, 9.0))
        assert [task.unit for task in tasks] == ["c"]


def test_hops_keep_clear_of_the_obstacles_that_are_known(setup: CoordinationSetup) -> None:
    """Two change places by way of a third one, and a post stands about: where they can, they get past it."""
    lanes, finder, rng = setup.lanes, setup.finder, random.Random(0)
    holders = {"b": "a.left", "c": "a.right", "d": "a.rear", "e": "d.rear"}
    wanted = Shape.from_tree({"a": "root", "d": "a.rear", "e": "d.rear", "c": "a.left", "b": "a.right"})
    start = Shape.from_tree({"a": "root", **holders}).poses(SE2(), lanes.body)
    first, refused = set(), list[str]()
    for _ in range(80):
        x, y, radius = rng.uniform(-1.2, 0.4), rng.uniform(-1.0, 1.0), rng.uniform(0.03, 0.1)
        if min(math.hypot(x - X.x, y - X.y) for X in start.values()) < radius + lanes.body.radius + 0.05:
            continue
        post, poses = ObstacleEstimate("post", 0, SE2(x, y), np.eye(3), radius), dict(start)
        try:
            tasks = reconfiguration_tasks(holders, wanted, lanes, SE2(), WIDE, True, (post,))
        except SceneError as error:
            refused.append(str(error))
            continue
        first.add(tasks[0].name)
        unit_of = {task.name: task.unit for task in tasks}
        for task in tasks:
            unit, holder = str(task.unit), str(task.parent_unit or unit_of[str(task.parent)])
            assert finder.behind(poses[unit], LEAST_WAY_OUT_M, (post,)) is None, task.name
            poses[unit] = lanes.body.docked(poses[holder], task.port)
            assert lanes.obstacle_in(poses[unit], (post,)) is None, task.name
    assert len(refused) > 5
    assert all("post" in reason for reason in refused)
    assert len(first) > 1, "where a post stands in one lane, another one serves"


def test_what_cannot_be_is_refused(setup: CoordinationSetup) -> None:
    holders = {"b": "a.rear", "c": "b.rear"}
    with pytest.raises(SceneError, match="3 units, the shape 4"):
        reconfiguration_tasks(holders, build_pattern("line", 4), setup.lanes, SE2(), WIDE)
    narrow = (-2.0, 0.4, -0.4, 0.4)
    with pytest.raises(SceneError, match="do not fit into the arena from where the root"):
        reconfiguration_tasks(holders, build_pattern("zigzag", 3), setup.lanes, SE2(), narrow)
    turned = Shape.from_tree({"a": "root", "c": "a.rear", "b": "c.rear"})
    with pytest.raises(
        SceneError, match="no order of leaving and docking again leads"
    ):  # there is no way past
        reconfiguration_tasks(holders, turned, setup.lanes, SE2(), narrow, named=True)
    assert reconfiguration_tasks(holders, turned, setup.lanes, SE2(), WIDE, named=True)


def test_units_out_of_action_stay_and_all_others_fill_what_can_be_filled(setup: CoordinationSetup) -> None:
    """One of a fork is out of action, in its port or in the open, or stands free and hops from there."""
    rng, names = random.Random(1), "abcdefg"
    holders = {"b": "a.rear", "c": "b.rear", "d": "a.left", "e": "a.right", "f": "d.rear", "g": "e.rear"}
    ports, line = assembly_ports(holders), build_pattern("line", 7)
    filled: list[int] = []
    for _ in range(24):
        unit, places = rng.choice("bcfg"), dict(ports)
        leaves = not any(holder.startswith(f"{unit}.") for holder in holders.values())
        if leaves and rng.random() < 0.7:
            places[unit] = beside(unit)
        X_WU = SE2(rng.uniform(-2.0, 1.0), rng.uniform(-2.0, 2.0), rng.uniform(-3.0, 3.0))
        out = {} if places[unit] == beside(unit) and rng.random() < 0.4 else {unit: X_WU}
        tasks, whole = tasks_from(places, line, setup.lanes, SE2(), WIDE, out=out)
        now, unit_of = {u: p for u, p in places.items() if p}, {task.name: task.unit for task in tasks}
        for task in tasks:
            hopping, holder = str(task.unit), str(task.parent_unit or unit_of[str(task.parent)])
            assert hopping not in out
            assert holder not in out
            at = now.pop(hopping)
            assert not any(place[: len(at)] == at for place in now.values()), "it carries another unit"
            now[hopping] = (*now.get(holder, ()), task.port)
            X = HopRules(setup.lanes, SE2(), WIDE).pose(now[hopping])
            if places[unit] == beside(unit) and out:
                assert not setup.lanes.closed_by(X, X_WU)
        goal = set(shape_ports(line).values()) - {()}
        assert whole == (set(now.values()) >= goal)
        assert whole or out
        filled.append(len(goal & set(now.values())))
    assert set(filled) >= {len(names) - 2, len(names) - 1}


@pytest.mark.parametrize(
    ("free", "stays", "hopping"),
    [
        ({"e": None}, "", {"c", "d", "e"}),  # e has left its port
        ({"e": SE2(-2.0, 2.0), "x": None, "y": None}, "", {"c", "d", "x"}),
        ({"x": None, "e": None, "y": None}, "", {"c", "d", "x"}),
        ({"x": None, "y": None}, "", {"c", "d", "e"}),
        ({"x": None, "y": None}, "d", {"e", "c", "x"}),
        ({"x": None, "y": None}, "e", {"d", "x", "y"}),  # c has to carry it
    ],
)
def test_as_many_units_that_stand_free_hop_as_the_assembly_has_too_few(
    free: dict[str, SE2 | None], stays: str, hopping: set[str], setup: CoordinationSetup
) -> None:
    """One more would leave another unit in a port beside the shape: a hop for a hop."""
    ports = assembly_ports({"b": "a.rear", "c": "a.left", "d": "a.right", "e": "c.rear"})
    places = {unit: place for unit, place in ports.items() if unit not in free}
    places |= {unit: beside(unit) for unit in free}
    out = {unit: X for unit, X in free.items() if X is not None} | ({stays: SE2()} if stays else {})
    tasks, whole = tasks_from(places, build_pattern("line", 5), setup.lanes, SE2(), WIDE, out=out)
    assert {task.unit for task in tasks} == hopping
    assert whole == (not stays)
