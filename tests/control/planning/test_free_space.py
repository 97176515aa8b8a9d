import numpy as np
import pytest

from msrr_control.planning.free_space import Disc, FreeSpace


def test_a_unit_may_leave_a_disc_that_it_stands_in_but_not_go_deeper() -> None:
    space = FreeSpace((-1.0, 1.0, -1.0, 1.0), (Disc("d", 0.0, 0.0, 0.5),))
    opened = space.opened_at(0.3, 0.0)
    assert not space.allows(np.array([[0.3, 0.0]]))
    assert opened.allows(np.array([[0.3, 0.0], [0.9, 0.0]]))
    assert not opened.allows(np.array([[0.2, 0.0]]))
    outside = space.opened_at(1.2, 0.0)
    assert outside.allows(np.array([[1.2, 0.0]]))
    assert not outside.allows(np.array([[1.3, 0.0]]))


@pytest.mark.parametrize("side", [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)])
def test_a_unit_beyond_a_border_may_come_back_and_not_go_farther(side: tuple[float, float]) -> None:
    out = np.array(side)
    space = FreeSpace((-1.0, 1.0, -1.0, 1.0), ())
    opened = space.opened_at(*(1.2 * out).tolist())
    assert space.allows(1.0005 * out[None]), "rounding is let pass"
    assert not space.allows(1.0015 * out[None])
    assert opened.allows(np.array([1.2 * out, 0.5 * out]))
    assert not opened.allows(1.3 * out[None])
    assert not opened.allows(-1.1 * out[None])


def test_a_unit_may_leave_a_disc_in_whose_middle_it_stands() -> None:
    opened = FreeSpace((-1.0, 1.0, -1.0, 1.0), (Disc("d", 0.3, -0.2, 0.5),)).opened_at(0.3, -0.2)
    assert opened.allows(np.array([[0.3, -0.2]]))
    assert opened.discs[0].radius >= 0.0


def test_a_disc_within_a_circle_is_not_near_it() -> None:
    space = FreeSpace((-1.0, 1.0, -1.0, 1.0), (Disc("d", 0.1, 0.0, 0.2),))
    assert space.near_circle(0.0, 0.0, 0.31) is None
    assert space.near_circle(0.0, 0.0, 0.29) is not None


def test_the_disc_that_points_enter_deepest() -> None:
    discs = (Disc("a", -0.5, 0.0, 0.2), Disc("b", 0.5, 0.0, 0.4))
    space = FreeSpace((-1.0, 1.0, -1.0, 1.0), discs)
    points = np.array([[-0.4, 0.0], [0.5, 0.1], [0.0, 0.9]])
    assert space.deepest_disc(points) == discs[1]
    assert space.deepest_disc(points[:1]) == discs[0]
    assert space.deepest_disc(points[2:]) is None
    assert FreeSpace(space.box, ()).deepest_disc(points) is None


def test_a_line_is_free_where_all_of_its_points_are() -> None:
    rng = np.random.default_rng(6)
    space = FreeSpace((-1.0, 1.0, -1.0, 1.0), (Disc("a", -0.4, 0.1, 0.3), Disc("b", 0.5, -0.2, 0.2)))
    a, b = rng.uniform(-1.1, 1.1, (2, 300, 2))
    free = space.allows_lines(a, b)
    sampled = np.array([space.allows(np.linspace(*ends, 500)) for ends in zip(a, b, strict=True)])
    assert 20 < free.sum() < 280
    assert (free != sampled).sum() <= 2  # grazing lines, between two samples


def test_the_space_near_a_circle_allows_of_it_what_all_of_the_space_allows() -> None:
    rng, box = np.random.default_rng(4), (-2.0, 2.0, -1.5, 1.5)
    wholly_free = 0
    for _ in range(300):
        discs = tuple(
            Disc(f"d{i}", *rng.uniform(-2.0, 2.0, 2).tolist(), float(rng.uniform(0.1, 0.4))) for i in range(4)
        )
        space, anywhere = FreeSpace(box, discs), rng.uniform((-2.0, -1.5, 0.1), (2.0, 1.5, 0.5))
        x, y, radius = discs[0][1:] if rng.random() < 0.5 else anywhere.tolist()
        near = space.near_circle(x, y, radius)
        wholly_free += near is None
        for begin, turn in rng.uniform(0.0, 6.0, (5, 2)):
            angles = begin + np.linspace(0.0, turn, 40)
            points = np.stack([x + radius * np.sin(angles), y - radius * np.cos(angles)], axis=-1)
            assert (near is None or near.allows(points)) == space.allows(points)
    assert 20 < wholly_free < 200
