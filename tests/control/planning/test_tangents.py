import math

import numpy as np
import pytest

from msrr_control.planning.free_space import Disc, FreeSpace
from msrr_control.planning.tangents import Goal, _Circle, _Ring, shortest_path
from msrr_scenes.geometry.se2 import wrap_angle
from tests.conftest import not_none


def test_the_shortest_path_around_a_disc_is_a_taut_string() -> None:
    space = FreeSpace((-5.0, 5.0, -5.0, 5.0), (Disc("d", 0.0, 0.0, 1.0),))
    path = not_none(shortest_path(space, (-2.0, 0.0), Goal(2.0, 0.0)))
    assert float(path.length) == pytest.approx(2 * math.sqrt(3) + math.pi / 3, abs=1e-6)
    straight = not_none(shortest_path(space, (-2.0, 1.5), Goal(2.0, 1.5)))
    assert float(straight.length) == pytest.approx(4.0)


def test_a_path_arrives_with_the_heading_that_is_asked_for() -> None:
    space = FreeSpace((-5.0, 5.0, -5.0, 5.0), ())
    for heading in np.linspace(-3.0, 3.0, 7):
        path = not_none(shortest_path(space, (-2.0, 0.5), Goal(1.0, 0.2, float(heading), 0.5)))
        end = path.at(path.length)
        np.testing.assert_allclose(end.point, [1.0, 0.2], atol=1e-9)
        assert wrap_angle(float(end.heading) - heading) == pytest.approx(0.0, abs=1e-9)


def test_where_discs_close_every_way_there_is_no_path() -> None:
    fence = tuple(Disc(f"d{k}", 0.0, y, 0.4) for k, y in enumerate(np.arange(-1.0, 1.1, 0.5)))
    space = FreeSpace((-2.0, 2.0, -1.0, 1.0), fence)
    assert shortest_path(space, (-1.5, 0.0), Goal(1.5, 0.0)) is None


def test_random_paths_are_free_and_smooth_and_no_shorter_than_the_line() -> None:
    rng = np.random.default_rng(7)
    found = 0
    for _ in range(40):
        discs = tuple(Disc(f"d{k}", *rng.uniform(-1.0, 1.0, 2), rng.uniform(0.1, 0.4)) for k in range(4))
        space = FreeSpace((-2.0, 2.0, -2.0, 2.0), discs)
        start, end = rng.uniform(-1.9, 1.9, (2, 2))
        if not space.allows(np.stack([start, end])):
            continue
        path = shortest_path(space, tuple(start), Goal(*end))
        if path is None:
            continue
        found += 1
        _, points = path.sample(0.01)
        assert space.allows(points)
        np.testing.assert_allclose(points[[0, -1]], [start, end], atol=1e-9)
        assert float(path.length) >= float(np.hypot(*(end - start))) - 1e-9
    assert found > 15


@pytest.mark.parametrize("degrees", [*range(65, 120, 10), *range(-115, -60, 10)])
def test_no_path_follows_an_arc_through_another_disc(degrees: int) -> None:
    """The shorter string about a disc meets a small disc on its arc: the other one is longer by 2 mm."""
    angle = math.radians(degrees)
    side = math.copysign(0.001, degrees)
    bump = Disc("bump", math.cos(angle), math.sin(angle), 0.04)
    space = FreeSpace((-5.0, 5.0, -5.0, 5.0), (Disc("d", 0.0, 0.0, 1.0), bump))
    path = not_none(shortest_path(space, (-2.0, side), Goal(2.0, side)))
    away = math.hypot(2.0, side)
    arc = math.pi + 2.0 * math.atan2(0.001, 2.0) - 2.0 * math.acos(1.0 / away)
    assert float(path.length) == pytest.approx(2.0 * math.sqrt(away**2 - 1.0) + arc, abs=1e-6)
    _, points = path.sample(0.005)
    assert np.hypot(points[:, 0] - bump.x, points[:, 1] - bump.y).min() >= bump.radius


def test_in_the_open_the_last_arc_turns_to_the_side_that_makes_the_path_shorter() -> None:
    """Of a line and an arc to the left or to the right, neither by more than the longest arc."""
    space, radius, both = FreeSpace((-9.0, 9.0, -9.0, 9.0), ()), 0.25, 0
    goals = np.random.default_rng(3).uniform([0.6, -0.5, -3.1], [1.5, 0.5, 3.1], (100, 3))
    for x, y, heading in goals.tolist():
        lengths = []
        for turn in (1.0, -1.0):
            to_x = x - turn * radius * math.sin(heading)
            to_y = y + turn * radius * math.cos(heading)
            distance = math.hypot(to_x, to_y)
            arrive = math.atan2(to_y, to_x) - math.asin(turn * radius / distance)
            angle = (turn * (heading - arrive)) % (2.0 * math.pi)
            if angle <= 1.5 * math.pi:
                lengths.append(math.sqrt(distance**2 - radius**2) + radius * angle)
        both += len(lengths) == 2
        path = not_none(shortest_path(space, (0.0, 0.0), Goal(x, y, heading, radius)))
        assert float(path.length) == pytest.approx(min(lengths))
    assert both > 30


def test_arcs_are_free_where_all_of_their_points_are() -> None:
    """As closely as points 3 cm apart tell: between two of them a circle enters a disc by 3 mm at most."""
    rng, told = np.random.default_rng(6), {True: 0, False: 0}
    for _ in range(60):
        discs = tuple(
            Disc(f"d{k}", *rng.uniform(-0.6, 0.6, 2).tolist(), float(rng.uniform(0.05, 0.3)))
            for k in range(3)
        )
        circle = _Circle(
            *rng.uniform(-0.3, 0.3, 2).tolist(), float(rng.uniform(0.1, 0.5)), rng.choice([-1.0, 1.0])
        )
        space = FreeSpace((-0.7, 0.7, -0.7, 0.7), discs)
        ring = _Ring(space, circle)
        for arrive, angle in rng.uniform([-7.0, 0.0], [7.0, 4.7], (20, 2)).tolist():
            headings = arrive + circle.turn * np.linspace(0.0, angle, 400)
            reach = circle.turn * circle.radius
            points = np.column_stack(
                [circle.x + reach * np.sin(headings), circle.y - reach * np.cos(headings)]
            )
            free = ring.allows(arrive, angle)
            told[free] += 1
            if not free:
                assert not space.free_points(points).all()
            else:  # the arc may end in a disc, where no line begins
                ends = np.minimum(np.arange(400), np.arange(400)[::-1]) * circle.radius * angle / 399 < 0.03
                smaller = FreeSpace(space.box, tuple(d._replace(radius=d.radius - 0.003) for d in discs))
                x, y = points[~ends].T
                inside = (np.abs(x) < 0.703) & (np.abs(y) < 0.703)
                assert inside.all()
                assert smaller.free_points(points[~ends]).all()
    assert min(told.values()) > 200
