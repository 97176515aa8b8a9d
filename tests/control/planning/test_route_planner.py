"""Routes from anywhere to the place in front of the port, through free space, or none."""

import math
from itertools import product

import numpy as np
import pytest

from msrr_control.path_following.path import PaceSpec
from msrr_control.path_following.walls import WallSpec
from msrr_control.planning.free_space import Disc
from msrr_control.planning.route import ArenaMap, Route, RouteSpec
from msrr_control.planning.route_planner import RoutePlanner
from msrr_scenes.geometry.se2 import SE2, wrap_angle
from msrr_scenes.messages import ObstacleEstimate
from tests.conftest import not_none

PLANNER = RoutePlanner(RouteSpec(), WallSpec(), PaceSpec(), (-2.0, 2.0, -1.5, 1.5), 0.1, 0.1)
TARGET = SE2(1.2, 0.0, 0.0)
X_TD = SE2(-0.1, 0.0, 0.0)


def _obstacle(name: str, x: float, y: float, radius: float = 0.08) -> ObstacleEstimate:
    return ObstacleEstimate(name, 0, SE2(x, y), np.eye(3) * 1e-6, radius)


#: Posts across the arena, with 0.2 m between them.
FENCE = [_obstacle(f"f{k}", -0.3, y, 0.2) for k, y in enumerate(np.linspace(-1.2, 1.2, 5))]


def _arena(X_WU: SE2, *obstacles: ObstacleEstimate, target: SE2 = TARGET, others=()) -> ArenaMap:
    units = [
        Disc("b", target.x, target.y, 0.128),
        *(Disc(f"u{k}", *centre, 0.128) for k, centre in enumerate(others)),
    ]
    return ArenaMap(X_WU, target @ X_TD, tuple(units), obstacles)


def _ends_before_the_port(route: Route, arena: ArenaMap) -> bool:
    end = route.path.at(route.path.length)
    goal = PLANNER.spec.handover(arena.X_WD)
    near = float(np.hypot(*(end.point - goal.translation))) < 1e-6
    return near and abs(wrap_angle(float(end.heading) - goal.yaw)) < 1e-6


def _clearance(route: Route, arena: ArenaMap) -> float:
    """Smallest distance of the path from what is not left to walls, beyond the bodies' radii."""
    _, points = route.path.sample(0.01)
    bodies = [(u.x, u.y, u.radius) for u in arena.units]
    bodies += [(o.X_WB.x, o.X_WB.y, o.radius) for o in arena.obstacles if o.name not in route.sides]
    return min(float(np.hypot(*(points - (x, y)).T).min()) - r for x, y, r in bodies)


def test_in_open_ground_it_is_one_circle_and_the_lead_in() -> None:
    arena = _arena(SE2(-1.2, 0.8, 0.0))
    route = not_none(PLANNER.plan(arena))
    assert route.shape == "arc"
    assert route.final
    assert _ends_before_the_port(route, arena)
    np.testing.assert_allclose(route.path.start[:2], [-1.2, 0.8])
    assert float(route.path.length - route.path.arc_end) == pytest.approx(0.3)


@pytest.mark.parametrize("y", [0.0, 1e-12, 1e-9, -1e-6, 1e-3, -4e-3])
def test_from_next_to_the_axis_the_circle_ends_in_front_of_the_port_as_well(y: float) -> None:
    """A line along the axis in its place ended as far beside it as it began."""
    arena = _arena(SE2(-1.8, y, 0.0))
    route = not_none(PLANNER.plan(arena))
    assert route.shape == "arc"
    assert _ends_before_the_port(route, arena)


def test_an_obstacle_on_the_path_is_left_to_a_wall() -> None:
    free = not_none(PLANNER.plan(_arena(SE2(-1.6, 0.3, 0.0))))
    point = free.path.at(0.8)
    left = point.point + 0.02 * np.array([-math.sin(point.heading), math.cos(point.heading)])
    route = not_none(PLANNER.plan(_arena(SE2(-1.6, 0.3, 0.0), _obstacle("o", *left))))
    assert (route.shape, dict(route.sides)) == ("arc", {"o": -1.0})


def test_the_other_side_is_taken_where_the_nearer_one_is_shut() -> None:
    free = not_none(PLANNER.plan(_arena(SE2(-1.6, 0.3, 0.0))))
    point = free.path.at(0.8)
    normal = np.array([-math.sin(point.heading), math.cos(point.heading)])
    arena = _arena(
        SE2(-1.6, 0.3, 0.0),
        _obstacle("o", *(point.point + 0.02 * normal)),
        _obstacle("p", *(point.point - 0.4 * normal)),
    )
    route = not_none(PLANNER.plan(arena))
    assert dict(route.sides) == {"o": 1.0}


@pytest.mark.parametrize(
    ("obstacle", "why"),
    [
        (_obstacle("o", -0.2, 0.02), "too near the end of the path"),
        (_obstacle("o", -1.0, 0.1, 0.25), "too wide for a wall"),
    ],
)
def test_what_walls_cannot_do_is_driven_around(obstacle: ObstacleEstimate, why: str) -> None:
    arena = _arena(SE2(-1.6, 0.1, 0.0), obstacle)
    route = PLANNER.plan(arena)
    assert route is not None, why
    assert route.sides == {}
    assert _clearance(route, arena) > 0.1
    if route.final:
        assert _ends_before_the_port(route, arena)


def test_a_unit_that_was_stopped_keeps_further_away() -> None:
    arena = _arena(SE2(-1.6, 0.1, 0.0), _obstacle("o", -0.6, 0.05))
    gaps = []
    for caution in (1, 2, 3):
        route = not_none(PLANNER.plan(arena, caution))
        assert not route.sides
        gaps.append(_clearance(route, arena))
    assert gaps == sorted(gaps)
    assert gaps[2] > gaps[0] + 0.03


def test_too_near_the_port_it_goes_away_and_turns_on_the_spot() -> None:
    arena = _arena(TARGET @ SE2(-0.7, 0.05, 0.1))
    route = not_none(PLANNER.plan(arena))
    assert route.shape in ("staged", "around")
    assert _clearance(route, arena) > 0.1


@pytest.mark.parametrize("seed", range(3))
def test_from_anywhere_routes_keep_clear_of_everything(seed: int) -> None:
    rng = np.random.default_rng(seed)
    found = 0
    for _ in range(25):
        target = SE2(*rng.uniform([-0.6, -0.4, -3.14], [0.8, 0.4, 3.14]))
        start = SE2(*rng.uniform([-1.8, -1.3, -3.14], [1.8, 1.3, 3.14]))
        places = rng.uniform([-1.8, -1.3], [1.8, 1.3], (3, 2))
        arena = _arena(
            start, _obstacle("o", *places[0]), _obstacle("p", *places[1]), target=target, others=places[2:]
        )
        bodies = [target.translation, *places]
        if min(float(np.hypot(*(start.translation - body))) for body in bodies) < 0.4:
            continue
        route = PLANNER.plan(arena)
        if route is None:
            continue
        found += 1
        assert _clearance(route, arena) >= 0.1 + 0.05
        _, points = route.path.sample(0.02)
        assert np.abs(points[:, 0]).max() <= 1.91
        assert np.abs(points[:, 1]).max() <= 1.41
        assert _ends_before_the_port(route, arena) or not route.final
    assert found >= 12


@pytest.mark.parametrize("y", [-0.06, -0.03, 0.0, 0.03, 0.06])
def test_where_it_turned_near_the_border_a_unit_may_stand_beside_the_axis(y: float) -> None:
    """The border leaves room for a short lead-in alone; stops and localisation err by centimetres."""
    planner = RoutePlanner(RouteSpec(), WallSpec(), PaceSpec(), (-0.05, 2.0, -1.5, 1.5), 0.1, 0.1)
    staged = not_none(planner.plan(_arena(SE2(0.4, 1.2, -1.4))))
    assert staged.shape == "staged"
    stop = staged.path.at(staged.path.length - 0.1)
    arena = _arena(SE2(float(stop.point[0]), y, float(stop.heading)))
    route = not_none(planner.plan(arena))
    assert route.final
    assert _ends_before_the_port(route, arena)


def test_a_path_keeps_from_the_border() -> None:
    """Between posts and the border there is one way, unless the border is nearer."""
    posts = [_obstacle(f"p{k}", -0.5, y, 0.2) for k, y in enumerate(np.linspace(-0.95, 1.3, 7))]
    arena = _arena(SE2(-1.5, -0.9, 0.0), *posts)
    lowest = []
    for off in (0.0, 0.05, 0.12):
        box = (-2.0 + off, 2.0 - off, -1.5 + off, 1.5 - off)
        planner = RoutePlanner(RouteSpec(), WallSpec(), PaceSpec(), box, 0.1, 0.1)
        route = planner.plan(arena, caution=1)
        lowest.append(None if route is None else float(route.path.sample(0.01)[1][:, 1].min()))
    assert lowest[0] is not None
    assert -1.4 < lowest[0] < -1.3
    assert lowest[1] == lowest[0], "the way has room for 0.05 m"
    assert lowest[2] is None


def test_what_leaves_no_route_is_named() -> None:
    def why(start: SE2, *obstacles: ObstacleEstimate, low: float = -2.0) -> str:
        planner = RoutePlanner(RouteSpec(), WallSpec(), PaceSpec(), (low, 2.0, -1.5, 1.5), 0.1, 0.1)
        arena = _arena(start, *obstacles)
        assert planner.plan(arena) is None
        return planner.obstruction(arena)

    ahead, behind = SE2(-0.5, 0.0, 0.0), SE2(1.7, 0.6, 0.0)
    assert "o stands on the place in front" in why(ahead, _obstacle("o", 0.4, 0.1))
    assert "f2 stands between the unit and the place" in why(SE2(-1.4, 0.0, 0.0), *FENCE)
    # Beside the line, but the only one that could make way: the others stand too near to each other.
    gate = _obstacle("gate", -0.3, 0.87, 0.45)
    dense = [_obstacle(f"d{k}", -0.3, y, 0.2) for k, y in enumerate(np.linspace(-1.45, 1.45, 11))]
    posts = [post for post in dense if abs(post.X_WB.y - 0.87) > 0.3]
    assert "gate stands in every way" in why(SE2(-1.4, 0.0, 0.0), *posts, gate)
    assert "border" in why(behind, low=0.3)
    assert "border" in why(behind, _obstacle("o", 0.8, 0.4), low=0.3)  # without it there is no route either


def test_where_there_is_no_way_there_is_no_route() -> None:
    assert PLANNER.plan(_arena(SE2(-1.4, 0.2, 0.0), *FENCE)) is None
    assert PLANNER.plan(_arena(SE2(-1.4, 0.2, 0.0), *FENCE[:1], *FENCE[2:])) is not None
    assert PLANNER.plan(_arena(SE2(-1.4, 0.2, 0.0), _obstacle("o", 0.4, 0.0))) is None


@pytest.mark.parametrize("offset", [0.05, 0.1, 0.2, 0.3])
def test_the_body_that_trails_keeps_the_margin_as_well(offset: float) -> None:
    """On an arc the axle cuts the corner, the more the farther it is behind the controlled point."""
    planner = RoutePlanner(RouteSpec(), WallSpec(), PaceSpec(), (-3.0, 3.0, -2.0, 2.0), offset, 0.1)
    arena = _arena(SE2(-2.0, 0.05, 0.0), _obstacle("o", -1.0, 0.0))
    route = not_none(planner.plan(arena, caution=1))
    assert route.shape == "around"
    stations, _ = route.path.sample(0.002)
    x, y, yaw = -2.0, 0.05, float(route.path.start[2])
    nearest = math.inf
    for px, py in (route.path.at(s).point for s in stations[stations > offset]):
        yaw = math.atan2(py - y, px - x)
        x, y = px - offset * math.cos(yaw), py - offset * math.sin(yaw)
        nearest = min(nearest, math.hypot(x + 1.0, y))
    assert nearest >= 0.08 + 0.1 + WallSpec().margin_m


@pytest.mark.parametrize("seed", range(20))
def test_it_drives_straight_to_where_it_can_turn(seed: int) -> None:
    """Away from a post that is too near for a turn, and never nearer to it than it is or a wall would be."""
    rng = np.random.default_rng(seed)
    X_WU = SE2(*rng.uniform([-0.3, -0.3, -3.1], [0.3, 0.3, 3.1]))
    bearing, apart, radius = rng.uniform(-math.pi, math.pi), 0.28, 0.3
    post = X_WU.translation + apart * np.array([math.cos(bearing), math.sin(bearing)])
    way = PLANNER.margins.way_to_turn(_arena(X_WU, _obstacle("o", *post.tolist(), radius=0.05)), radius)
    assert way is not None
    assert way != 0.0
    passed = X_WU.act(np.stack([np.linspace(0.0, way, 100), np.zeros(100)], axis=-1))
    distance = np.hypot(*(passed - post).T)
    assert distance[-1] >= 0.05 + radius + WallSpec().margin_m - 2e-3
    assert distance.min() >= min(apart, 0.05 + 0.1 + WallSpec().margin_m) - 2e-3


def test_it_turns_where_it_stands_if_it_can_and_nowhere_without_room() -> None:
    free, fence = _arena(SE2(0.0, 0.0, 1.0)), np.linspace(0.0, 2.0 * math.pi, 12, endpoint=False)
    assert PLANNER.margins.way_to_turn(free, 0.3) == 0.0
    posts = [_obstacle(f"o{k}", 0.3 * math.cos(a), 0.3 * math.sin(a), 0.05) for k, a in enumerate(fence)]
    assert PLANNER.margins.way_to_turn(_arena(SE2(0.0, 0.0, 1.0), *posts), 0.3) is None


def test_a_route_that_ends_with_a_turn_is_as_long_in_the_mirrored_arena() -> None:
    """It came from the first direction that was free, of those in the world: detours of up to 10 s."""
    rng, found = np.random.default_rng(5), 0
    while found < 60:
        poses = rng.uniform((-1.7, -1.3, -3.0), (1.7, 1.3, 3.0), (2, 3)).tolist()
        posts = rng.uniform((-1.7, -1.3, 0.04), (1.7, 1.3, 0.15), (8, 3)).tolist()
        seconds = []
        for along, across in product((1.0, -1.0), repeat=2):
            turned = 0.0 if along > 0.0 else math.pi  # mirrored in x, a heading a is at pi - a
            X_WU, X_WD = (SE2(along * x, across * y, turned + along * across * yaw) for x, y, yaw in poses)
            obstacles = [_obstacle(f"o{k}", along * x, across * y, r) for k, (x, y, r) in enumerate(posts)]
            arena = ArenaMap(X_WU, X_WD, (), tuple(obstacles))
            route = PLANNER._turned_route(arena, 0.0)
            seconds.append(math.inf if route is None else route.seconds)
        assert seconds == pytest.approx([seconds[0]] * 4, abs=1e-6)
        found += math.isfinite(seconds[0])


def test_a_body_that_is_many_discs_is_left_out_as_one() -> None:
    """One that is lost may be anywhere on the rest of its way."""
    discs = (Disc("b", 1.0, 0.0, 0.1), Disc("lost", 0.0, 0.0, 0.1), Disc("lost", 0.1, 0.0, 0.1))
    arena = _arena(SE2())._replace(units=discs)
    assert {name: {u.name for u in left.units} for name, left in arena.without_one(discs[:1])} == {
        "lost": {"b"}
    }
