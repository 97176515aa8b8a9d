"""What a monitor says of one route, by what is known on the way."""

import math

import numpy as np
import pytest

from msrr_control.path_following.path import PaceSpec, Path
from msrr_control.path_following.walls import WallSpec
from msrr_control.planning.free_space import Disc
from msrr_control.planning.route import ArenaMap, Route, RouteSpec
from msrr_control.planning.route_monitor import RouteMonitor, as_obstacles
from msrr_control.planning.route_planner import RoutePlanner
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import ObstacleEstimate

WALLS = WallSpec()
PLANNER = RoutePlanner(RouteSpec(), WALLS, PaceSpec(), (-2.0, 2.0, -1.5, 1.5), 0.1, 0.1)
TARGET = Disc("b", 1.2, 0.0, 0.128)


def _arena(*obstacles: ObstacleEstimate, units: tuple[Disc, ...] = (TARGET,)) -> ArenaMap:
    return ArenaMap(SE2(-1.6, 0.0), SE2(1.1, 0.0), units, obstacles)


def _obstacle(x: float, y: float = 0.0, name: str = "o") -> ObstacleEstimate:
    return ObstacleEstimate(name, 0, SE2(x, y), np.eye(3) * 1e-6, 0.08)


def _straight(sides: dict[str, float] | None = None) -> Route:
    """Along the x axis from the unit to the place in front of the port."""
    return Route(Path(np.array([-1.6, 0.0, 0.0]), np.array([0.0]), np.array([2.0])), "arc", sides or {}, 10.0)


def _monitor(arena: ArenaMap, sides: dict[str, float] | None = None) -> RouteMonitor:
    return RouteMonitor(_straight(sides), PLANNER, arena)


def test_a_route_in_a_world_that_stays_as_it_is_can_be_followed() -> None:
    arena = _arena(_obstacle(-0.6), units=(TARGET, Disc("c", 0.0, 0.8, 0.128)))
    monitor = _monitor(arena, {"o": 1.0})
    assert all(monitor.reason_to_replan(arena, s, 0.02) is None for s in np.linspace(0.1, 2.0, 10))
    assert monitor.end_moved(arena.X_WD) == (0.0, 0.0)


def test_an_obstacle_that_no_wall_leads_past_is_a_reason() -> None:
    monitor = _monitor(_arena())
    assert monitor.reason_to_replan(_arena(_obstacle(-0.4)), 0.1, 0.02) is None  # room for a wall
    reason = monitor.reason_to_replan(_arena(_obstacle(0.2, name="late")), 0.1, 0.02)
    assert reason == "late appeared on the path, 1.70 m ahead"


def test_an_obstacle_that_moves_onto_the_path_is_a_reason_and_a_small_motion_none() -> None:
    beside = _arena(_obstacle(0.2, 0.5))
    monitor = _monitor(beside)
    assert monitor.reason_to_replan(_arena(_obstacle(0.2, 0.49)), 0.1, 0.02) is None
    reason = monitor.reason_to_replan(_arena(_obstacle(0.2, 0.05)), 0.1, 0.02)
    assert reason is not None
    assert "o moved on the path" in reason


def test_a_wall_that_leads_past_an_obstacle_moves_with_the_estimate() -> None:
    """Too near to choose the side again: the unit stays on the side it has chosen."""
    monitor = _monitor(_arena(_obstacle(-0.6)), {"o": 1.0})
    moved = _arena(_obstacle(-0.6, 0.03))
    assert monitor.reason_to_replan(moved, 0.8, 0.02) is None
    wall, name = monitor.wall(moved, np.array([-0.8, 0.1]), 0.8)
    assert (bool(wall.active), name) == (True, "o")
    assert float(wall.normal) == pytest.approx(0.5 * math.pi)
    assert float(wall.foot[1]) == pytest.approx(0.03 + 0.08 + 0.1 + WALLS.margin_m)


@pytest.mark.parametrize(("y", "blocks"), [(0.1, True), (0.6, False)])
def test_a_unit_in_the_way_is_a_reason(y: float, blocks: bool) -> None:
    monitor = _monitor(_arena())
    known = _arena(units=(TARGET, Disc("c", -0.2, y, 0.128)))
    reason = monitor.reason_to_replan(known, 0.1, 0.02)
    assert reason == ("c stands in the way now" if blocks else None)


def test_what_is_behind_the_unit_is_none() -> None:
    monitor = _monitor(_arena())
    known = _arena(_obstacle(-1.4), units=(TARGET, Disc("c", -1.3, 0.1, 0.128)))
    assert monitor.reason_to_replan(known, 1.5, 0.02) is None


@pytest.mark.parametrize(("beyond_m", "behind"), [(0.03, True), (-0.03, False), (-0.2, False)])
def test_an_obstacle_is_behind_once_the_axle_is_past_it(beyond_m: float, behind: bool) -> None:
    s = 1.5
    abreast = -1.6 + s - WALLS.release_m(PLANNER.offset)
    reason = _monitor(_arena()).reason_to_replan(_arena(_obstacle(abreast - beyond_m, 0.1)), s, 0.02)
    assert (reason is None) is behind


def test_the_wall_is_that_of_the_first_obstacle_not_yet_passed() -> None:
    arena = _arena(_obstacle(-0.45, name="second"), _obstacle(-0.9, name="first"))
    monitor = _monitor(arena, {"first": 1.0, "second": -1.0})
    assert monitor.wall(arena, np.array([-1.6, 0.0]), 0.0)[1] is None
    for x in (-1.2, -0.95):  # before it stands the one wall, then the one of the second as well
        assert monitor.wall(arena, np.array([x, 0.0]), x + 1.6)[1] == "first"
    assert monitor.wall(arena, np.array([-0.6, 0.2]), 1.0)[1] == "second"


def test_on_the_way_back_beside_itself_the_walls_are_those_of_the_way_back() -> None:
    """A way of 1.5 m, a half turn of radius 0.5 m, and as far back: what was passed is abreast once more."""
    arena = _arena(_obstacle(-0.9, -0.5, "there"), _obstacle(-0.6, 0.5, "back"))
    path = Path(np.array([-1.6, -0.5, 0.0]), np.array([0.0, 2.0, 0.0]), np.array([1.5, 0.5 * math.pi, 1.5]))
    monitor = RouteMonitor(Route(path, "arc", {"there": 1.0, "back": 1.0}, 20.0), PLANNER, arena)
    for s, name in ((0.4, "there"), (3.27, "back"), (4.0, None)):
        assert monitor.wall(arena, path.at(s).point, s)[1] == name


def test_a_target_that_moves_moves_the_end() -> None:
    moved, turned = _monitor(_arena()).end_moved(SE2(1.1, 0.1, 0.2))
    assert moved == pytest.approx(math.hypot(0.7 - 0.7 * math.cos(0.2), 0.1 - 0.7 * math.sin(0.2)))
    assert turned == pytest.approx(0.2)


def test_the_obstacles_of_a_map_as_arrays() -> None:
    assert as_obstacles(_arena()).centre.shape == (0, 2)
    obstacles = as_obstacles(_arena(_obstacle(0.1, 0.2), _obstacle(0.3, 0.4, "p")))
    np.testing.assert_array_equal(obstacles.centre, [[0.1, 0.2], [0.3, 0.4]])
    assert obstacles.present.all()
