"""The fit of a shape into the arena: where its root stands, and which unit takes which place."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from msrr_control.path_following.path import PaceSpec
from msrr_control.planning.free_space import Bounds
from msrr_control.shapes.precedence import Lanes
from msrr_control.shapes.shape import Shape
from msrr_control.tracks.route_finder import STANDS_THERE_M
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se2 import SE2

#: Grid of the root's poses [m], and its number of headings.
_GRID_M, _HEADINGS = 0.2, 8

#: Distance before a place to which a way is estimated [m].
_BEFORE_M = 1.0

#: Distance by which a shape that is built from another one should fit more closely than it has to [m]: its
#: root stands where it came to rest and was pushed to, which is some centimetres and degrees off.
_SLACK_M = 0.15

#: Weights of the root's time and of the others' in the score; cost of a unit that stands in a place [s].
_ROOT_WEIGHT, _WEIGHT, _STANDS_S = 2.0, 0.5, 4.0

#: Cost of what is forbidden; finite, because the assignment has to be one of numbers [s].
_FORBIDDEN_S = 1e6


class Embedding(NamedTuple):
    """A pose of the root of a shape, the units by their places, and a score, the lower the better [s]."""

    X_WR: SE2
    units: Mapping[str, str]
    score: float


class Travel(NamedTuple):
    """What is assumed of a unit's way for an estimate of its time.

    It turns on the spot, and ``ramp_s`` is its time to get under way and to stop.
    """

    cruise_mps: float
    turn_radps: float
    ramp_s: float

    @classmethod
    def of(cls, pace: PaceSpec, turn_radps: float) -> Travel:
        """Return the assumptions that belong to routes of that pace."""
        return cls(pace.cruise_mps, turn_radps, pace.ramp_s)

    def times(self, start: Array, goal: Array) -> Array:
        """Return the times [s] from poses to poses, shapes (..., 3) that broadcast: turn, drive, turn."""
        dx, dy = goal[..., 0] - start[..., 0], goal[..., 1] - start[..., 1]
        way = np.arctan2(dy, dx)
        turns = _angle(way - start[..., 2]) + _angle(goal[..., 2] - way)
        distance = np.hypot(dx, dy)
        there = distance < STANDS_THERE_M
        drive = turns / self.turn_radps + distance / self.cruise_mps + self.ramp_s
        result: Array = np.where(there, _angle(goal[..., 2] - start[..., 2]) / self.turn_radps, drive)
        return result


def assign(costs: Array) -> tuple[list[tuple[int, int]], float]:
    """Return the cheapest assignment of rows to columns of a matrix of costs, and the sum of its costs."""
    from scipy.optimize import linear_sum_assignment  # slow to import, and only missions need it

    rows, columns = linear_sum_assignment(costs)
    pairs = sorted(zip(rows.tolist(), columns.tolist(), strict=True))
    return pairs, float(costs[rows, columns].sum())


def place_costs(units: Array, places: Array, travel: Travel) -> Array:
    """Return the estimated times [s] from every unit to every docked place, shape (..., units, places).

    The poses of the units have shape (U, 3), and those of the places (..., P, 3).
    """
    before = places.copy()
    before[..., 0] -= _BEFORE_M * np.cos(places[..., 2])
    before[..., 1] -= _BEFORE_M * np.sin(places[..., 2])
    return travel.times(units[:, None], before[..., None, :, :])


def fits(shapes: Iterable[Shape], lanes: Lanes, box: Bounds) -> bool:
    """Return whether shapes and the lanes to them fit into an empty arena, on the grid of the root's poses.

    They are built one from the other, with the same root. The axle may be and is seen in ``box``.
    """
    roots = _root_candidates(np.zeros((0, 3)), box)
    each = [_fit(_places(shape, roots, lanes), lanes, box, ()) for shape in shapes]
    return bool(np.logical_and.reduce(each).any())


def grandchildren_fit(
    shape: Shape, X_WR: SE2, lanes: Lanes, box: Bounds, keep_out: Sequence[tuple[float, float, float]]
) -> bool:
    """Return whether all that docks to what docks to the root of a shape fits, with the lanes to it.

    ``box`` and ``keep_out`` are as for :func:`embedding`.
    """
    deep = [k for k, place in enumerate(shape.places) if place.parent not in (None, shape.root.name)]
    places = _places(shape, X_WR.as_array()[None], lanes)[:, [0, *deep]]
    return not deep or bool(_fit(places, lanes, box, keep_out).all())


def embedding(
    shape: Shape,
    units: Mapping[str, SE2],
    lanes: Lanes,
    box: Bounds,
    travel: Travel,
    *,
    named: bool = False,
    keep_out: Sequence[tuple[float, float, float]] = (),
    later: Iterable[Shape] = (),
) -> Embedding | None:
    """Return the best place in the arena for a shape; None if it does not fit.

    Where there is such a place, shapes that are built from this one ``later``, with the same root, fit there,
    too, with some room to spare. The shape has at most as many places as there are units that may take part;
    if it is ``named``, each is named by the unit that has to take it. The axle may be and is seen in ``box``:
    x low, x high, y low, y high [m]. ``keep_out`` are x, y and radius of bodies that will not move [m].
    """
    names = list(units)
    poses = np.array([X.as_array() for X in units.values()])
    roots = _root_candidates(poses, box)
    places = _places(shape, roots, lanes)
    fits = _fit(places, lanes, box, keep_out)
    following = [_places(other, roots, lanes) for other in later]
    for slack in (0.0, _SLACK_M):  # that all of them fit comes before room to spare for any
        for later_places in following:
            both = fits & _fit(later_places, lanes, _shrunk(box, slack), keep_out)
            if both.any():
                fits = both
    roots, places = roots[fits], places[fits]
    if not len(roots):
        return None
    weighted = _WEIGHT * place_costs(poses, places, travel)
    weighted[:, :, 0] = _ROOT_WEIGHT * travel.times(poses, roots[:, None])
    if named:
        allowed = np.array([[unit == place.name for place in shape.places] for unit in names])
        weighted = np.where(allowed, weighted, _FORBIDDEN_S)
    apart = np.hypot(*np.moveaxis(places[:, None, :, :2] - poses[None, :, None, :2], -1, 0))
    stands = _STANDS_S * (apart.min(axis=2) < 2.0 * lanes.body.radius).sum(axis=1)
    # No assignment is cheaper than the cheapest unit for every place, so that most candidates need none.
    bound = weighted.min(axis=1).sum(axis=1) + stands
    best: tuple[float, int, list[tuple[int, int]]] | None = None
    for k in np.argsort(bound, kind="stable").tolist():
        if best is not None and bound[k] >= best[0]:
            break
        pairs, total = assign(weighted[k])
        if total < _FORBIDDEN_S:
            candidate = (total + float(stands[k]), k, pairs)
            best = candidate if best is None else min(best, candidate)
    if best is None:
        return None
    score, k, pairs = best
    return Embedding(SE2(*roots[k].tolist()), {shape.places[p].name: names[u] for u, p in pairs}, score)


def _shrunk(box: Bounds, slack: float) -> Bounds:
    x0, x1, y0, y1 = box
    return x0 + slack, x1 - slack, y0 + slack, y1 - slack


def _root_candidates(poses: Array, box: Bounds) -> Array:
    """Return the poses of the root that are tried, shape (C, 3): a grid, and where units stand."""
    x0, x1, y0, y1 = box
    headings = np.arange(_HEADINGS) * 2.0 * math.pi / _HEADINGS - math.pi
    xs = _grid(x0, x1)
    ys = _grid(y0, y1)
    grid = np.stack(np.meshgrid(xs, ys, headings, indexing="ij"), axis=-1).reshape(-1, 3)
    turned = np.repeat(poses, _HEADINGS, axis=0)
    turned[:, 2] = np.tile(headings, len(poses))
    return np.concatenate([poses, turned, grid])


def _grid(low: float, high: float) -> Array:
    count = max(int((high - low) / _GRID_M), 1)
    half = 0.5 * _GRID_M * (count - 1)
    middle = 0.5 * (low + high)
    return np.linspace(middle - half, middle + half, count)


def _places(shape: Shape, roots: Array, lanes: Lanes) -> Array:
    """Return the poses of the places of a shape for each pose of its root, shape (C, P, 3)."""
    relative = shape.poses(SE2(), lanes.body)
    places = np.array([relative[place.name].as_array() for place in shape.places])
    c, s = np.cos(roots[:, 2])[:, None], np.sin(roots[:, 2])[:, None]
    x = roots[:, 0, None] + c * places[:, 0] - s * places[:, 1]
    y = roots[:, 1, None] + s * places[:, 0] + c * places[:, 1]
    return np.stack([x, y, roots[:, 2, None] + places[:, 2]], axis=-1)


def _fit(
    places: Array,
    lanes: Lanes,
    box: Bounds,
    keep_out: Sequence[tuple[float, float, float]],
) -> NDArray[np.bool_]:
    """Return which candidates have all places and lanes inside the box and clear of what will not move."""
    room = lanes.spec.border_m + lanes.body.offset
    x0, x1, y0, y1 = box
    back = np.linspace(0.0, lanes.length, 9)
    ahead = np.stack([np.cos(places[..., 2]), np.sin(places[..., 2])], axis=-1)
    lane = places[..., None, :2] - back[:, None] * ahead[..., None, :]
    lane[:, 0] = places[:, 0, None, :2]  # the root has no lane
    x, y = lane[..., 0], lane[..., 1]
    inside = (x >= x0 + room) & (x <= x1 - room) & (y >= y0 + room) & (y <= y1 - room)
    fits: NDArray[np.bool_] = inside.all(axis=(1, 2))
    for bx, by, radius in keep_out:
        apart = np.hypot(x - bx, y - by) >= radius + lanes.body.half_width + lanes.spec.unit_margin_m
        fits = fits & apart.all(axis=(1, 2))
    return fits


def _angle(difference: Array) -> Array:
    """Return the size of an angle [rad], wrapped."""
    size: Array = np.abs(np.remainder(difference + math.pi, 2.0 * math.pi) - math.pi)
    return size
