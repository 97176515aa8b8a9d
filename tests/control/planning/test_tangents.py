import math

import numpy as np
import pytest

from msrr_control.planning.free_space import Disc, FreeSpace
from msrr_control.planning.tangents import Goal, shortest_path
from msrr_scenes.geometry.se2 import wrap_angle


def test_the_shortest_path_around_a_disc_is_a_taut_string() -> None:
    space = FreeSpace((-5.0, 5.0, -5.0, 5.0), (Disc("d", 0.0, 0.0, 1.0),))
    path = shortest_path(space, (-2.0, 0.0), Goal(2.0, 0.0))
    assert path is not None
    assert float(path.length) == pytest.approx(2 * math.sqrt(3) + math.pi / 3, abs=1e-6)
    straight = shortest_path(space, (-2.0, 1.5), Goal(2.0, 1.5))
    assert straight is not None
    assert float(straight.length) == pytest.approx(4.0)


def test_a_path_arrives_with_the_heading_that_is_asked_for() -> None:
    space = FreeSpace((-5.0, 5.0, -5.0, 5.0), ())
    for heading in np.linspace(-3.0, 3.0, 7):
        path = shortest_path(space, (-2.0, 0.5), Goal(1.0, 0.2, float(heading), 0.5))
        assert path is not None
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
