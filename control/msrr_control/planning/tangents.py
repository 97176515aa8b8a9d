"""Shortest paths around discs: lines that touch them and arcs along them."""

from __future__ import annotations

import heapq
import math
from typing import NamedTuple

import numpy as np

from msrr_control.path_following.path import Path
from msrr_control.planning.free_space import FreeSpace

_TURN = 2.0 * math.pi

#: Longest arc around one body that a path may take [rad].
_LONGEST_ARC = 1.5 * math.pi


#: Largest distance between the points by which an arc is checked for being free [m].
_SPACING_M = 0.03


class Goal(NamedTuple):
    """The end of a path.

    Attributes:
        x: Position along x [m].
        y: Position along y [m].
        heading: Direction of arrival; None for any [rad].
        radius: Radius of the last arc, which turns the path to that heading [m].
    """

    x: float
    y: float
    heading: float | None = None
    radius: float = 0.0


class _Circle(NamedTuple):
    """A circle to drive along, counter-clockwise for ``turn`` = +1, clockwise for -1."""

    x: float
    y: float
    radius: float
    turn: float


class _Line(NamedTuple):
    """A line that touches two circles, from point ``a`` on circle ``start`` to ``b`` on circle ``end``."""

    start: int
    end: int
    a: tuple[float, float]
    b: tuple[float, float]
    heading: float
    length: float


class _Ring:
    """The points of a circle that are free: each is checked once, however many arcs are asked for."""

    def __init__(self, space: FreeSpace, circle: _Circle) -> None:
        count = 8 + int(_TURN * circle.radius / _SPACING_M)
        self._step, self._turn = _TURN / count, circle.turn
        headings = circle.turn * self._step * np.arange(count)
        reach = circle.turn * circle.radius
        points = np.stack([circle.x + reach * np.sin(headings), circle.y - reach * np.cos(headings)], axis=-1)
        free = space.free_points(points).tolist()
        # Of each point, how many from it on are free, in the sense of the turn; all of a circle is enough.
        self._free = [count] * count
        if not all(free):
            run = free.index(False)
            for k in range(count - 1, -1, -1):
                run = run + 1 if free[k] else 0
                self._free[k] = run

    def allows(self, arrive: float, angle: float) -> bool:
        """Return whether an arc of that angle, entered with heading ``arrive``, is free [rad]."""
        at = (self._turn * arrive) % _TURN
        first = math.ceil(at / self._step)
        return self._free[first % len(self._free)] > math.floor((at + angle) / self._step) - first


def shortest_path(space: FreeSpace, start: tuple[float, float], goal: Goal) -> Path | None:
    """Return the shortest path around the discs of ``space``, None if there is none.

    The path begins at ``start`` (x, y) [m] in any direction and consists of lines and of arcs around discs.
    With a goal that has a heading the last arc has the goal's radius.
    """
    circles = [_Circle(*start, 0.0, 1.0)]
    circles += [_Circle(d.x, d.y, d.radius, t) for d in space.discs for t in (1.0, -1.0)]
    ends = range(len(circles), len(circles) + (1 if goal.heading is None else 2))
    if goal.heading is None:
        circles.append(_Circle(goal.x, goal.y, 0.0, 1.0))
    else:
        for turn in (1.0, -1.0):  # the middle of the circle is on the left of a path that turns left
            side = goal.heading + turn * 0.5 * math.pi
            x, y = goal.x + goal.radius * math.cos(side), goal.y + goal.radius * math.sin(side)
            circles.append(_Circle(x, y, goal.radius, turn))
    lines = _free_tangents(space, circles, ends)
    chain = _search(space, circles, lines, ends, goal)
    return None if chain is None else _as_path(start, circles, chain, goal)


def _free_tangents(space: FreeSpace, circles: list[_Circle], ends: range) -> list[_Line]:
    """Return the free lines that touch two circles in the sense of their turns."""
    found: list[_Line] = []
    for i, a in enumerate(circles):
        if i in ends:
            continue
        for j, b in enumerate(circles):
            if j == 0 or (a.x, a.y) == (b.x, b.y):
                continue
            dx, dy = b.x - a.x, b.y - a.y
            distance = math.hypot(dx, dy)
            offset = b.turn * b.radius - a.turn * a.radius
            if abs(offset) > distance:
                continue
            heading = math.atan2(dy, dx) - math.asin(offset / distance)
            n = (-math.sin(heading), math.cos(heading))
            p = (a.x - a.turn * a.radius * n[0], a.y - a.turn * a.radius * n[1])
            q = (b.x - b.turn * b.radius * n[0], b.y - b.turn * b.radius * n[1])
            found.append(_Line(i, j, p, q, heading, math.hypot(q[0] - p[0], q[1] - p[1])))
    if not found:
        return []
    free = space.allows_lines(np.array([line.a for line in found]), np.array([line.b for line in found]))
    return [line for line, is_free in zip(found, free, strict=True) if is_free]


def _search(
    space: FreeSpace, circles: list[_Circle], lines: list[_Line], ends: range, goal: Goal
) -> list[_Line] | None:
    """Return the lines of the shortest path, found by Dijkstra's algorithm; an arc joins two lines."""
    leaving: dict[int, list[int]] = {}
    for k, line in enumerate(lines):
        leaving.setdefault(line.start, []).append(k)
    rings: dict[int, _Ring | None] = {}  # None where all of a circle is free, as most are

    def arc_is_free(line: _Line, angle: float) -> bool:
        if line.end not in rings:
            circle = circles[line.end]
            near = space.near_circle(circle.x, circle.y, circle.radius)
            rings[line.end] = None if near is None else _Ring(near, circle)
        ring = rings[line.end]
        return ring is None or ring.allows(line.heading, angle)

    previous: dict[int, int] = {}
    queue: list[tuple[float, int, int]] = [(lines[k].length, k, -1) for k in leaving.get(0, [])]
    heapq.heapify(queue)
    shortest: tuple[float, int] | None = None  # length and last line
    while queue:
        cost, k, parent = heapq.heappop(queue)
        if shortest is not None and cost >= shortest[0]:
            break
        if k in previous:
            continue
        previous[k] = parent
        line = lines[k]
        circle = circles[line.end]
        if line.end in ends:
            last_arc = 0.0
            if goal.heading is not None:
                angle = _arc(circle, line.heading, goal.heading)
                if angle > _LONGEST_ARC or not arc_is_free(line, angle):
                    continue
                last_arc = circle.radius * angle
            if shortest is None or cost + last_arc < shortest[0]:
                shortest = (cost + last_arc, k)
            continue
        for following in leaving.get(line.end, []):
            angle = _arc(circle, line.heading, lines[following].heading)
            if following in previous or angle > _LONGEST_ARC:
                continue
            if arc_is_free(line, angle):
                total = cost + circle.radius * angle + lines[following].length
                heapq.heappush(queue, (total, following, k))
    if shortest is None:
        return None
    chain, k = [], shortest[1]
    while k >= 0:
        chain.append(lines[k])
        k = previous[k]
    return chain[::-1]


def _arc(circle: _Circle, arrive: float, leave: float) -> float:
    """Return the angle [rad] >= 0 driven along a circle from heading ``arrive`` to heading ``leave``."""
    angle = (circle.turn * (leave - arrive)) % _TURN
    return 0.0 if angle > _TURN - 1e-9 else angle


def _as_path(start: tuple[float, float], circles: list[_Circle], chain: list[_Line], goal: Goal) -> Path:
    curvature, lengths = [], []
    for k, line in enumerate(chain):
        curvature.append(0.0)
        lengths.append(line.length)
        circle = circles[line.end]
        leave = chain[k + 1].heading if k + 1 < len(chain) else goal.heading
        if leave is not None:
            curvature.append(circle.turn / circle.radius)
            lengths.append(circle.radius * _arc(circle, line.heading, leave))
    return Path(np.array([*start, chain[0].heading]), np.array(curvature), np.array(lengths))
