import numpy as np
import pytest

from msrr_control.path_following.path import Path
from msrr_control.path_following.walls import PassageError, WallSpec, find_encounter, side_wall
from msrr_scenes.errors import MsrrError

SPEC = WallSpec()
D = np.array(0.23)


def _straight(length: float = 3.0) -> Path:
    return Path(np.zeros(3), np.array([0.0]), np.array([length]))


def _encounter(path: Path, x: float, y: float):
    centre = np.array([x, y])
    return find_encounter(path, centre, D, SPEC), centre


@pytest.mark.parametrize(("y", "side"), [(0.03, -1.0), (-0.03, 1.0), (0.2, -1.0)])
def test_it_passes_on_the_side_of_the_smaller_detour(y: float, side: float) -> None:
    encounter, _ = _encounter(_straight(), 1.5, y)
    assert bool(encounter.blocked)
    assert float(encounter.side) == side
    assert float(encounter.s) == pytest.approx(1.5, abs=0.02)
    assert sorted(encounter.detours) == pytest.approx([float(D) - abs(y), float(D) + abs(y)], abs=1e-6)


def test_an_obstacle_beside_the_path_has_no_wall() -> None:
    encounter, centre = _encounter(_straight(), 1.5, 0.24)
    assert not bool(encounter.blocked)
    wall = side_wall(encounter, encounter.side, np.array([1.5, 0.0]), centre, D, SPEC, 0.1)
    assert not bool(wall.active)


@pytest.mark.parametrize(
    ("x", "stands"), [(0.7, False), (0.86, True), (1.5, True), (1.61, True), (1.63, False), (2.5, False)]
)
def test_the_wall_stands_from_before_the_obstacle_until_it_is_passed(x: float, stands: bool) -> None:
    encounter, centre = _encounter(_straight(), 1.5, 0.0)
    wall = side_wall(encounter, np.array(1.0), np.array([x, 0.0]), centre, D, SPEC, 0.1)
    assert bool(wall.active) is stands


@pytest.mark.parametrize("offset", [0.05, 0.1, 0.3])
def test_the_wall_stands_until_the_axle_is_past(offset: float) -> None:
    encounter, centre = _encounter(_straight(), 1.5, 0.0)
    for axle, stands in ((1.5, True), (1.51, True), (1.53, False)):
        tip = np.array([axle + offset, 0.0])
        assert bool(side_wall(encounter, np.array(1.0), tip, centre, D, SPEC, offset).active) is stands


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize("turn", [-0.8, 0.8])
def test_the_wall_is_beside_the_obstacle_across_the_path(side: float, turn: float) -> None:
    path = Path(np.array([0.5, 0.2, 1.0]), np.array([turn]), np.array([2.5]))
    nearest = path.at(1.3)
    encounter = find_encounter(path, nearest.point, D, SPEC)
    wall = side_wall(encounter, np.array(side), nearest.point, nearest.point, D, SPEC, 0.1)
    out = np.array([np.cos(wall.normal), np.sin(wall.normal)])
    along = np.array([np.cos(nearest.heading), np.sin(nearest.heading)])
    assert out @ along == pytest.approx(0.0, abs=0.02)
    assert (along[0] * out[1] - along[1] * out[0]) * side > 0.99
    assert (wall.foot - nearest.point) @ out == pytest.approx(float(D))


def test_on_the_outside_of_a_bend_it_rises_later() -> None:
    path = Path(np.zeros(3), np.array([1.0]), np.array([2.5]))
    encounter = find_encounter(path, path.at(1.5).point, D, SPEC)
    right, left = encounter.rise
    assert left == SPEC.ahead_m
    assert 0.3 < right < SPEC.ahead_m


@pytest.mark.parametrize(("side", "stands"), [(-1.0, False), (1.0, True)])
def test_each_side_has_its_own_place_at_which_the_wall_rises(side: float, stands: bool) -> None:
    """Between the two places of the bend above only the wall on the inside stands already."""
    path = Path(np.zeros(3), np.array([1.0]), np.array([2.5]))
    centre = path.at(1.5).point
    encounter = find_encounter(path, centre, D, SPEC)
    heading = float(encounter.heading)
    between = float(encounter.rise.mean())
    tip = centre - between * np.array([np.cos(heading), np.sin(heading)])
    assert bool(side_wall(encounter, np.array(side), tip, centre, D, SPEC, 0.1).active) is stands


def test_a_wall_that_cannot_be_reached_in_time_is_refused() -> None:
    assert SPEC.half_width(0.08, 0.10) == pytest.approx(0.18 + SPEC.margin_m)
    with pytest.raises(PassageError, match=r"radius 0\.300 m needs a wall 0\.455 m"):
        SPEC.half_width(0.30, 0.10)
    assert issubclass(PassageError, MsrrError)
    with pytest.raises(ValueError, match="cannot be reached"):
        WallSpec(ahead_m=0.4)
