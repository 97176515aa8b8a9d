"""A follower on one straight route: what it needs before it drives, what it says on the way."""

import numpy as np
import pytest

from msrr_control.path_following.c1 import C1PathFollowingLaw
from msrr_control.path_following.path import Path
from msrr_control.planning.free_space import Disc
from msrr_control.planning.route import ArenaMap, Route
from msrr_control.planning.route_planner import RoutePlanner
from msrr_control.sequence.observation import Observation
from msrr_control.staging.parameters import AssemblyParams
from msrr_control.staging.route_follower import RouteFollower
from msrr_control.staging.setup import AssemblySetup
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.loading.load import load_scene
from msrr_scenes.messages import ArenaEstimate, GlobalPose, Twist

S = 1_000_000_000
PARAMS = AssemblyParams()
X_WD = SE2(1.1, 0.0)


@pytest.fixture
def follower() -> RouteFollower:
    scene = load_scene("two_units")
    setup = AssemblySetup.of(scene, scene.plan[0])
    planner = RoutePlanner(
        PARAMS.route, PARAMS.walls, PARAMS.pace, (-2.0, 2.0, -1.5, 1.5), setup.offset, setup.half_width
    )
    return RouteFollower(C1PathFollowingLaw(PARAMS, setup.limits, setup.offset), planner, PARAMS.watch)


def _arena(X_WU: SE2, target: SE2 = X_WD) -> ArenaMap:
    return ArenaMap(X_WU, target, (Disc("b", 1.2, 0.0, 0.128),), ())


def _route() -> Route:
    return Route(Path(np.array([-1.0, 0.0, 0.0]), np.array([0.0]), np.array([1.4])), "arc", {}, 10.0)


START = SE2(-1.0, 0.0)


def test_without_a_route_there_is_nothing_to_follow(follower: RouteFollower) -> None:
    with pytest.raises(RuntimeError, match="no route"):
        _ = follower.route
    follower.set_route(_route(), _arena(START))
    assert not follower.started
    with pytest.raises(RuntimeError, match="not started"):
        follower.step(_arena(START), 0.0, 0.02)
    follower.drop_route()
    with pytest.raises(RuntimeError, match="no route"):
        _ = follower.route


def test_it_drives_along_the_route_and_says_where_it_is(follower: RouteFollower) -> None:
    follower.set_route(_route(), _arena(START))
    follower.start(START, Twist(), 0)
    assert follower.s == pytest.approx(0.1)
    x = -1.0
    for _ in range(100):
        twist = follower.step(_arena(SE2(x, 0.0)), follower.s, 0.02)
        assert twist.w == pytest.approx(0.0, abs=1e-9)
        x += 0.02 * twist.v
    assert x > -0.9
    own = GlobalPose("a", 2 * S, SE2(x, 0.0), np.zeros((3, 3)))
    arena = ArenaEstimate(2 * S, own, None, (), (), 2 * S)
    progress = follower.progress(Observation(2 * S, arena=arena), "drive", None, "because")
    assert progress is not None
    assert progress.tip == pytest.approx((x + 0.1, 0.0))
    assert progress.desired[0] == pytest.approx(-1.0 + progress.s, abs=0.01)
    assert (progress.length, progress.arc_end, progress.avoiding) == (pytest.approx(1.4), 0.0, None)
    assert follower.distance_to_end(SE2(x, 0.0)) == pytest.approx(0.4 - (x + 0.1))


def test_the_time_without_progress_begins_anew_with_every_bit_that_counts(follower: RouteFollower) -> None:
    follower.set_route(_route(), _arena(START))
    follower.start(START, Twist(), 0)
    assert follower.time_without_progress(0.1, 1 * S) == 0.0
    assert follower.time_without_progress(0.1 + 0.5 * PARAMS.watch.stuck_m, 3 * S) == 2.0
    assert follower.time_without_progress(0.1 + 1.5 * PARAMS.watch.stuck_m, 4 * S) == 0.0


def test_a_restart_goes_on_where_the_unit_was(follower: RouteFollower) -> None:
    follower.set_route(_route(), _arena(START))
    follower.start(START, Twist(), 0)
    for _ in range(50):
        follower.step(_arena(START @ SE2(follower.s - 0.1, 0.0)), follower.s, 0.02)
    s = follower.s
    follower.restart(SE2(-0.5, 0.1), Twist(), 5 * S)
    assert follower.s == s
    assert follower.time_without_progress(s, 6 * S) == 1.0


@pytest.mark.parametrize(
    ("X_WU", "target", "says"),
    [
        (START, X_WD, None),
        (START, SE2(1.15, 0.02), None),
        (START, SE2(1.2, 0.0), "the place in front of the port is 0.100 m elsewhere"),
        (START, SE2(0.4, 0.0, 0.15) @ SE2(0.7, 0.0), "is 0.000 m elsewhere, and turned by 8.6 deg"),
        (SE2(-1.0, 0.6), X_WD, "0.60 m off the path"),
    ],
)
def test_what_makes_another_route_necessary(
    follower: RouteFollower, X_WU: SE2, target: SE2, says: str | None
) -> None:
    follower.set_route(_route(), _arena(START))
    follower.start(START, Twist(), 0)
    reason = follower.reason_to_replan(_arena(X_WU, target))
    assert reason is None if says is None else says in str(reason)
