"""Routes for tasks: they end where they should, clear of what stands, out of ports and into them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from msrr_control.coordination.setup import CoordinationSetup
from msrr_control.tracks.gaps import GAP_M, first_contact
from msrr_control.tracks.route_finder import RouteFinder
from msrr_control.tracks.route_params import RouteParams
from msrr_control.tracks.route_request import RouteRequest, Standing
from msrr_control.tracks.track import TrackBuilder
from msrr_scenes.geometry.se2 import SE2, wrap_angle
from msrr_scenes.messages import ObstacleEstimate
from msrr_scenes.messages.coordination import LegKind

Starts = Callable[[int, int], dict[str, SE2]]


def test_routes_end_where_they_should_and_keep_clear_of_what_stands(
    setup: CoordinationSetup, starts: Starts
) -> None:
    finder, body = setup.finder, setup.lanes.body
    found = 0
    for seed in range(8):
        units = list(starts(seed, 5).items())
        standing = [Standing(name, X, False) for name, X in units[1:]]
        goal = SE2(0.2, 0.1, 0.8 * seed)
        if any(math.hypot(s.X_WB.x - goal.x, s.X_WB.y - goal.y) < 0.4 for s in standing):
            continue
        track = finder.find(RouteRequest(units[0][1], goal, standing))
        if track is None:
            continue
        found += 1
        np.testing.assert_allclose(track.poses[0], units[0][1].as_array())
        assert math.hypot(track.end.x - goal.x, track.end.y - goal.y) < 0.01
        assert abs(wrap_angle(track.end.yaw - goal.yaw)) < 1e-3
        for other in standing:
            gaps = body.near(track.poses, other.X_WB.as_array(), GAP_M)
            assert not gaps.any()
    assert found >= 3


def test_a_unit_docks_and_leaves_beside_neighbours(setup: CoordinationSetup) -> None:
    finder, body = setup.finder, setup.lanes.body
    hub = SE2(0.4, 0.0, 0.3)
    standing = [Standing("hub", hub, True), Standing("left", body.docked(hub, "left"), True)]
    place = body.docked(hub, "rear")
    track = finder.find(RouteRequest(SE2(-1.2, 0.8, -2.0), place, standing, dock=True, enters="hub"))
    assert track is not None
    assert track.legs[-1].kind is LegKind.DOCK
    assert math.hypot(track.end.x - place.x, track.end.y - place.y) < 1e-3
    assert abs(track.length - track.dock_start - finder.spec.handover_m) < 1e-6
    there = SE2(-1.0, -0.6, 0.0)
    back = finder.find(RouteRequest(place, there, standing, leaves="hub"))
    assert back is not None
    assert back.legs[0].kind is LegKind.BACK
    assert math.hypot(back.end.x - there.x, back.end.y - there.y) < 0.01
    only_out = finder.find(RouteRequest(place, None, standing, leaves="hub"))
    assert only_out is not None
    assert [leg.kind for leg in only_out.legs] == [LegKind.BACK]


@pytest.mark.parametrize(
    ("start", "goal", "yaw"),
    [
        (SE2(0.628, 0.004, -1.265), SE2(-0.599, -0.039, -3.015), -0.410),
        (SE2(0.240, 0.848, -0.371), SE2(-0.076, -0.504, -2.093), -1.278),
        (SE2(0.762, 0.600, -1.111), SE2(-0.329, -0.511, -2.034), 2.131),
    ],
)
def test_around_a_unit_there_is_a_route_although_the_axle_cuts_the_corner(
    setup: CoordinationSetup, start: SE2, goal: SE2, yaw: float
) -> None:
    """By the margin alone, a corner of the unit in the middle would be up to 2 mm nearer than it may be."""
    there = SE2(0.0, 0.0, yaw)
    track = setup.finder.find(RouteRequest(start, goal, [Standing("middle", there, False)]))
    assert track is not None
    assert not setup.lanes.body.near(track.poses, there.as_array(), GAP_M).any()
    assert math.hypot(track.end.x - goal.x, track.end.y - goal.y) < 0.01


def test_an_obstacle_is_driven_around(setup: CoordinationSetup) -> None:
    post = ObstacleEstimate("post", 0, SE2(0.0, 0.0), np.eye(3) * 1e-6, 0.08)
    start, goal = SE2(-1.3, 0.0, 0.0), SE2(1.0, 0.0, 0.0)
    track = setup.finder.find(RouteRequest(start, goal, [], (post,)))
    assert track is not None
    distance = np.hypot(track.poses[:, 0], track.poses[:, 1])
    assert float(distance.min()) > 0.08 + setup.lanes.body.half_width + 0.02


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_unit_beside_an_obstacle_drives_straight_before_it_turns(
    setup: CoordinationSetup, side: float
) -> None:
    """A post stands 40 mm beside the body: in a turn on the spot towards the goal a corner would touch it."""
    start, body = SE2(0.0, 0.0, math.radians(90.0 * side)), setup.lanes.body
    x, y = start.act([0.05, -side * (body.half_width + 0.08 + 0.04)])
    post = ObstacleEstimate("post", 0, SE2(float(x), float(y)), np.eye(3) * 1e-6, 0.08)
    far = replace(post, name="far", X_WB=SE2(-1.5, 1.0))
    track = setup.finder.find(RouteRequest(start, SE2(1.2, 0.0, 0.0), [], (far, post)))
    assert track is not None
    assert [leg.kind for leg in track.legs[:2]] == [LegKind.REVERSE, LegKind.TURN]
    assert not track.at_port.any()
    gaps = body.gaps_to_disc(track.poses, float(x), float(y), 0.08)
    assert gaps.min() > 0.039


def test_a_unit_that_was_held_turns_only_where_it_has_room(setup: CoordinationSetup) -> None:
    """Whatever stands beside it is nearer than it seems: a turn on the spot that seemed to pass does not."""
    finder, body, rng = setup.finder, setup.lanes.body, np.random.default_rng(0)
    turned = 0
    for _ in range(60):
        radius, bearing = float(rng.uniform(0.03, 0.15)), rng.uniform(-math.pi, math.pi)
        start, goal = SE2(0.0, 0.0, rng.uniform(-math.pi, math.pi)), SE2(1.2, rng.uniform(-1.0, 1.0), 0.0)
        apart = body.radius + radius + rng.uniform(0.0, 0.05)
        x, y = apart * math.cos(bearing), apart * math.sin(bearing)
        post = ObstacleEstimate("post", 0, SE2(x, y), np.eye(3) * 1e-6, radius)
        before, track = (
            finder.find(RouteRequest(start, goal, (), (post,), held=held)) for held in (False, True)
        )
        assert track is not None
        first = next(k for k, leg in enumerate(track.legs) if leg.kind is LegKind.TURN)
        place, begin = track.legs[first].start, track.legs[first - 1].end if first else 0.0
        assert math.hypot(place[0] - x, place[1] - y) > body.radius + radius + 0.05
        gaps = body.gaps_to_disc(track.poses[track.s <= begin], x, y, radius)
        assert gaps.min() > gaps[0] - 0.002
        turned += before is not None and before.legs[0].kind is LegKind.TURN
    assert turned > 20, "so many would turn at once if they were not held"


def test_a_unit_backs_out_only_where_there_is_room(setup: CoordinationSetup) -> None:
    """It backed out of the arena, and into obstacles: only other units were looked at."""
    finder, body = setup.finder, setup.lanes.body
    x0, _, _, _ = finder.box
    for inside, leaves in ((0.5, True), (0.2, False)):
        X_WU = SE2(x0 + inside, 0.0, 0.0)
        standing = [Standing("hub", X_WU @ SE2(0.2, 0.0, 0.0), True)]
        track = finder.find(RouteRequest(X_WU, None, standing, leaves="hub"))
        assert (track is not None) is leaves
        assert (finder.behind(X_WU, 0.3, ()) is None) is leaves
    place = SE2(0.0, 0.0, 1.0)
    hub = [Standing("hub", place @ SE2(0.2, 0.0, 0.0), True)]
    for gap, leaves in ((0.4, True), (0.2, False)):
        x, y = place.act([-body.offset - gap - 0.08, 0.0])
        post = ObstacleEstimate("post", 0, SE2(float(x), float(y)), np.eye(3) * 1e-6, 0.08)
        assert (finder.find(RouteRequest(place, None, hub, (post,), leaves="hub")) is not None) is leaves
        assert finder.behind(place, 0.3, (post,)) == (None if leaves else "post stands behind it")


@pytest.mark.parametrize("yaw", [-math.pi / 2.0, 0.0, math.pi / 2.0, 3.0])
def test_a_unit_outside_the_box_backs_out_only_where_it_comes_no_farther_out(
    setup: CoordinationSetup, yaw: float
) -> None:
    """Along the border, or into the box."""
    finder = setup.finder
    x0, x1, _, _ = finder.box
    for x, inwards in ((x1 + 0.05, math.cos(yaw)), (x0 - 0.05, -math.cos(yaw))):
        assert (finder.behind(SE2(x, 0.0, yaw), 0.3, ()) is None) is (inwards > -1e-9)


@pytest.mark.parametrize("extra", [0.0, 0.02])
def test_bodies_known_less_well_stay_farther_from_what_they_pass(
    setup: CoordinationSetup, extra: float
) -> None:
    """A unit backs out past a post."""
    body = replace(setup.lanes.body, extra_gap=extra)
    finder = RouteFinder(body, RouteParams(), setup.finder.box)
    for off, passes in ((-0.002, False), (0.002, True)):
        beside = SE2(-0.3, body.half_width + 0.05 + 0.044 + extra + off, 0.0)
        post = ObstacleEstimate("post", 0, beside, np.eye(3) * 1e-6, 0.05)
        assert (finder.behind(SE2(), 0.3, (post,)) is None) is passes


def test_a_unit_that_stands_where_it_is_to_be_only_turns(setup: CoordinationSetup) -> None:
    """One in a port leaves it first, and one that is to dock comes to the port along its lane."""
    place = SE2(0.3, 0.2, 0.5)
    there = place @ SE2(0.01, 0.0, 1.5)
    track = setup.finder.find(RouteRequest(place, there))
    assert track is not None
    assert [leg.kind for leg in track.legs] == [LegKind.TURN]
    assert track.end.yaw == pytest.approx(there.yaw)
    hub = [Standing("hub", place @ SE2(0.2, 0.0, 0.0), True)]
    leaves = setup.finder.find(RouteRequest(place, there, hub, leaves="hub"))
    assert leaves is None or leaves.legs[0].kind is LegKind.BACK
    docks = setup.finder.find(RouteRequest(there, place, dock=True, enters="hub"))
    assert docks is not None
    assert docks.legs[-1].kind is LegKind.DOCK


def test_to_an_end_nearby_a_unit_turns_drives_straight_and_turns(setup: CoordinationSetup) -> None:
    """It drove a loop of two metres to an end three centimetres ahead."""
    finder, rng, reversed_ways = setup.finder, np.random.default_rng(4), 0
    for _ in range(100):
        start = SE2(*rng.uniform([-1.0, -0.5, -math.pi], [1.0, 0.5, math.pi]).tolist())
        way, aside, yaw = rng.uniform([0.021, -math.pi, -math.pi], [0.29, math.pi, math.pi]).tolist()
        goal = start @ SE2(way * math.cos(aside), way * math.sin(aside), yaw)
        track = finder.find(RouteRequest(start, goal))
        assert track is not None
        assert sum(leg.kind in (LegKind.PATH, LegKind.REVERSE) for leg in track.legs) == 1
        assert track.length < way + 1.5 * math.pi * setup.lanes.body.offset + 1e-9
        assert math.hypot(track.end.x - goal.x, track.end.y - goal.y) < 1e-6
        assert abs(wrap_angle(track.end.yaw - goal.yaw)) < 1e-2
        reversed_ways += any(leg.kind is LegKind.REVERSE for leg in track.legs)
    assert 20 < reversed_ways < 80


@pytest.mark.parametrize("ahead", [1.0, -1.0])
def test_to_an_end_nearby_no_straight_way_leads_into_a_body(ahead: float, setup: CoordinationSetup) -> None:
    goal = SE2(0.25 * ahead, 0.0, 0.0)
    other = Standing("other", SE2(goal.x + 0.2 * ahead, 0.0, 0.0), False)
    post = ObstacleEstimate("post", 0, SE2(goal.x + 0.17 * ahead, 0.0, 0.0), np.zeros((3, 3)), 0.05)
    free = setup.finder.find(RouteRequest(SE2(), goal))
    assert free is not None
    assert len(free.legs) == 1
    for request in (RouteRequest(SE2(), goal, [other]), RouteRequest(SE2(), goal, obstacles=(post,))):
        track = setup.finder.find(request)
        assert track is None or len(track.legs) > 1


def test_beside_the_border_a_unit_turns_where_it_is_to_stand(setup: CoordinationSetup) -> None:
    """There is no room for a lead-in on the heading of the end, and in the open none is needed."""
    finder, rng = setup.finder, np.random.default_rng(0)
    x1, y1 = finder.box[1] - finder.spec.border_m, finder.box[3] - 0.3
    for _ in range(60):
        X_WU = SE2(rng.uniform(-1.0, 1.0), rng.uniform(-1.0, 1.0), rng.uniform(-math.pi, math.pi))
        goal = SE2(x1 - rng.uniform(0.0, 0.3), rng.uniform(-y1, y1), rng.uniform(-math.pi, math.pi))
        track = finder.find(RouteRequest(X_WU, goal))
        assert track is not None, (X_WU, goal)
        off = goal.inverse() @ track.end
        assert math.hypot(off.x, off.y) < 0.01
        assert abs(off.yaw) < 1e-3
        assert track.poses[:, 0].max() < x1 + 0.01
    post = ObstacleEstimate("post", 0, SE2(x1 - 0.45, 0.0, 0.0), np.eye(3) * 1e-6, 0.08)
    standing = [Standing("other", SE2(x1, -0.5, 0.0), False)]
    goal = SE2(x1, 0.0, math.pi)
    track = finder.find(RouteRequest(SE2(-1.0, 0.0, 0.0), goal, standing, (post,)))
    assert track is not None
    gaps = finder.body.gaps_to_disc(track.poses, post.X_WB.x, post.X_WB.y, post.radius)
    assert gaps.min() > 0.045
    assert first_contact(track, standing, finder.body) is None


def test_into_a_corner_and_out_of_it_there_is_a_route(setup: CoordinationSetup) -> None:
    """On any heading, as near to both sides as a move may end; and none where a post stands on the end."""
    finder, rng = setup.finder, np.random.default_rng(0)
    _, x1, _, y1 = finder.box
    backs = 0
    for _ in range(50):
        room = finder.spec.border_m + rng.uniform(0.0, finder.body.offset, 2)
        x, y = rng.choice([-1.0, 1.0], 2) * ([x1, y1] - room)
        corner = SE2(x, y, rng.uniform(-math.pi, math.pi))
        inside = SE2(rng.uniform(-1.5, 1.5), rng.uniform(-1.0, 1.0), rng.uniform(-math.pi, math.pi))
        for start, goal in ((inside, corner), (corner, inside)):
            track = finder.find(RouteRequest(start, goal))
            assert track is not None, (start, goal)
            off = goal.inverse() @ track.end
            assert math.hypot(off.x, off.y) < 0.01
            assert abs(off.yaw) < 2e-3
            assert (np.abs(track.poses[:, :2]) < np.array([x1, y1]) - finder.spec.border_m + 0.01).all()
            backs += track.legs[-1 if len(track.legs) < 2 else -2].kind is LegKind.REVERSE
        post = ObstacleEstimate("post", 0, corner @ SE2(0.05, 0.0, 0.0), np.eye(3) * 1e-6, 0.05)
        assert finder.find(RouteRequest(inside, corner, (), (post,))) is None
    assert backs > 40


def test_an_obstacle_in_a_lane_counts_until_the_unit_has_passed_it(setup: CoordinationSetup) -> None:
    builder = TrackBuilder(SE2(-1.2, 0.0, 0.0), setup.lanes.body.offset)
    builder.ahead(0.5)
    builder.dock(SE2(), 0.7)
    track, finder = builder.track(), setup.finder
    for x, progress, meets in ((-0.3, 0.0, True), (-0.3, 0.95, False), (-0.3, 0.6, True), (-0.9, 0.0, False)):
        post = ObstacleEstimate("post", 0, SE2(x, 0.0, 0.0), np.eye(3) * 1e-6, 0.05)
        assert finder.ahead_in_lane(track, progress, (post,)) == ("post" if meets else None)


def test_where_there_is_no_way_there_is_no_track(setup: CoordinationSetup) -> None:
    wall = [Standing(f"w{k}", SE2(0.0, -1.5 + 0.25 * k), False) for k in range(13)]
    assert setup.finder.find(RouteRequest(SE2(-1.0, 0.0, 0.0), SE2(1.0, 0.0, 0.0), wall)) is None


def test_from_beside_a_body_a_route_leads_away(setup: CoordinationSetup) -> None:
    """As near as here the collision monitor of a robot built with care lets a unit only drive away."""
    finder, body, rng = setup.finder, setup.lanes.body, np.random.default_rng(0)
    places = found = 0
    while places < 60:
        other = SE2(0.0, 0.0, rng.uniform(-math.pi, math.pi))
        bearing, apart = rng.uniform(-math.pi, math.pi), rng.uniform(0.2, 0.36)
        X_WU = SE2(apart * math.cos(bearing), apart * math.sin(bearing), rng.uniform(-math.pi, math.pi))
        goal = SE2(rng.choice([-1.0, 1.0]), rng.uniform(-1.0, 1.0), rng.uniform(-math.pi, math.pi))
        if not 0.031 < body.gap(X_WU, other) < 0.06:
            continue
        places += 1
        track = finder.find(RouteRequest(X_WU, goal, [Standing("other", other, False)]))
        if track is None:
            continue
        found += 1
        gaps = body.gaps(track.poses, other.as_array())
        best = np.maximum.accumulate(gaps)
        assert (gaps > np.minimum(best, 0.045) - 0.003).all()
    assert found > 0.75 * places


def test_straight_ahead_is_tried_only_inside_the_box_and_clear_of_obstacles(setup: CoordinationSetup) -> None:
    """A unit beside another one that looks over the border, or at an obstacle."""
    finder, offset = setup.finder, setup.lanes.body.offset
    post = ObstacleEstimate("post", 0, SE2(0.35, 0.0, 0.0), np.eye(3) * 1e-6, 0.08)
    for X_WU, obstacles in ((SE2(finder.box[1] - 0.25, 0.2, 0.0), ()), (SE2(0.0, 0.0, 0.0), (post,))):
        standing = [Standing("other", X_WU @ SE2(-0.1, 0.26, 0.0), False)]
        for bearing in np.linspace(-math.pi, math.pi, 12, endpoint=False):
            goal = SE2(math.cos(bearing), math.sin(bearing), bearing)
            track = finder.find(RouteRequest(X_WU, goal, standing, obstacles))
            if track is None:
                continue
            tips = track.poses[:, :2] + offset * np.stack(
                [np.cos(track.poses[:, 2]), np.sin(track.poses[:, 2])], axis=-1
            )
            assert float(tips[:, 0].max()) < finder.box[1] - finder.spec.border_m + 0.01
            assert not obstacles or float(np.hypot(*(tips - [0.35, 0.0]).T).min()) > 0.18


def test_a_unit_that_was_held_beside_its_target_drives_away_before_it_turns(setup: CoordinationSetup) -> None:
    """It stands 40 mm from a corner of the unit that it docks to; a turn on the spot brings it nearer."""
    body, finder = setup.lanes.body, setup.finder
    X_WT, X_WU = SE2(0.69, 0.175, 1.77), SE2(0.946, 0.24, -2.36)
    standing = [Standing("target", X_WT, True)]
    request = RouteRequest(X_WU, body.docked(X_WT, "left"), standing, dock=True, enters="target")
    track = finder.find(request)
    assert track is not None
    gaps = body.gaps(track.poses[~track.at_port], X_WT.as_array())
    assert gaps.min() > gaps[0] - 0.002
    assert track.legs[0].kind is LegKind.REVERSE


@pytest.mark.parametrize(
    ("post", "apart", "begins"),
    [
        (None, 0.28, {False: LegKind.PATH, True: LegKind.PATH}),
        (None, 0.30, {False: LegKind.TURN, True: LegKind.PATH}),
        (SE2(0.2, 0.12), 0.30, {False: LegKind.TURN, True: None}),
    ],
)
def test_ahead_of_a_unit_behind_it_a_unit_drives_to_where_it_can_turn(
    setup: CoordinationSetup, post: SE2 | None, apart: float, begins: dict[bool, LegKind | None]
) -> None:
    """By 5 cm, for a post may be beside that. One that was held gets no route that begins as the last one."""
    start, goal = SE2(1.2268, 0.5055, -2.4512), SE2(0.292, 0.497, 3.1357)
    standing = [
        Standing("hub", goal @ SE2(0.2, 0.0, 0.0), True),
        Standing("behind", start @ SE2(-apart, 0.03, -1.1), False),
    ]
    obstacles = () if post is None else (ObstacleEstimate("post", 0, start @ post, np.eye(3) * 1e-6, 0.03),)
    for held, kind in begins.items():
        track = setup.finder.find(
            RouteRequest(start, goal, standing, obstacles, dock=True, enters="hub", held=held)
        )
        assert (None if track is None else track.legs[0].kind) is kind


def test_a_route_stays_inside_of_the_inner_bounds_if_there_is_one(setup: CoordinationSetup) -> None:
    """A fence leaves a way along the border of the arena alone, and a unit is sent to that border."""
    outer = setup.finder
    x0, x1, y0, y1 = outer.box
    inner = (x0 + 0.3, x1 - 0.3, y0 + 0.3, y1 - 0.3)
    finder = RouteFinder(outer.body, RouteParams(), outer.box, inner=inner)
    start, goal = SE2(-1.0, 0.2, 0.0), SE2(1.0, -0.2, 0.0)
    ys = np.arange(y0 + 0.45, y1, 0.2)
    fence = tuple(ObstacleEstimate(f"f{y}", 0, SE2(0.0, float(y)), np.eye(3) * 1e-6, 0.08) for y in ys)
    for request, leaves in (
        (RouteRequest(start, goal), False),
        (RouteRequest(start, goal, obstacles=fence), True),
        (RouteRequest(start, SE2(1.0, y0 + 0.2, 0.0)), True),
    ):
        track = finder.find(request)
        assert track is not None
        assert (float(track.poses[:, 1].min()) < inner[2]) is leaves
        assert float(track.poses[:, 1].min()) > y0 + 0.09


def test_what_leaves_no_route_is_told(setup: CoordinationSetup) -> None:
    finder, body = setup.finder, setup.lanes.body
    hub = SE2(0.4, 0.0, 0.0)
    place, there = body.docked(hub, "rear"), SE2(-1.2, 0.0, 0.0)

    def why(request: RouteRequest) -> str:
        assert finder.find(request) is None
        reason = finder.obstruction(request)
        assert reason is not None
        return reason

    post = ObstacleEstimate("post", 0, place @ SE2(-0.3, 0.0, 0.0), np.eye(3) * 1e-8, 0.05)
    hubs = [Standing("hub", hub, True)]
    assert "post stands behind it" in why(RouteRequest(place, None, hubs, (post,), leaves="hub"))
    docks = RouteRequest(there, place, hubs, (post,), dock=True, enters="hub")
    assert "post stands in the lane" in why(docks)
    beside = replace(post, X_WB=place @ SE2(-0.3, 0.05 + body.half_width + 0.035, 0.0))
    assert finder.obstruction(replace(docks, obstacles=(beside,))) is None
    assert "post stands on the end of its way" in why(RouteRequest(there, post.X_WB, (), (post,)))
    neighbour = Standing("other", place @ SE2(-0.28, 0.0, 0.0), False)
    assert "past other" in why(RouteRequest(place, None, [*hubs, neighbour], leaves="hub"))
    assert finder.obstruction(RouteRequest(there, SE2(1.2, 1.0, 0.0), hubs)) is None
