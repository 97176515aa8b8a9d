"""Shortest ways around discs: lines that touch them and arcs along them."""

from __future__ import annotations

import heapq
import math
from typing import NamedTuple

import numpy as np

from msrr_control.path_following.path import Path
from msrr_control.planning.free_space import FreeSpace

_TURN = 2.0 * math.pi

#: A longer arc around one body than this is no way that makes sense [rad].
_LONGEST_ARC = 1.5 * math.pi


class Goal(NamedTuple):
    """Where a way ends.

    Attributes:
        x: [m].
        y: [m].
        heading: In which direction it arrives; None if that does not matter [rad].
        radius: Of the last arc, by which it comes to that heading [m].
    """

    x: float
    y: float
    heading: float | None = None
    radius: float = 0.0


class _Circle(NamedTuple):
    """A circle that is driven along, ``turn`` +1 counter-clockwise, -1 clockwise."""

    x: float
    y: float
    radius: float
    turn: float


class _Line(NamedTuple):
    """A line from one circle to another that touches both."""

    start: int
    end: int
    a: tuple[float, float]
    b: tuple[float, float]
    heading: float
    length: float


def shortest_way(ground: FreeSpace, start: tuple[float, float], goal: Goal) -> Path | None:
    """Return the shortest way around the discs of ``ground``, None if there is none.

    It begins at ``start`` in whatever direction suits it and consists of lines and of arcs around discs. With
    a goal that has a heading the last arc has the goal's radius.
    """
    circles = [_Circle(*start, 0.0, 1.0)]
    circles += [_Circle(d.x, d.y, d.radius, t) for d in ground.discs for t in (1.0, -1.0)]
    ends = range(len(circles), len(circles) + (1 if goal.heading is None else 2))
    if goal.heading is None:
        circles.append(_Circle(goal.x, goal.y, 0.0, 1.0))
    else:
        for turn in (1.0, -1.0):  # the middle is on the left of a path that turns left
            side = goal.heading + turn * 0.5 * math.pi
            x, y = goal.x + goal.radius * math.cos(side), goal.y + goal.radius * math.sin(side)
            circles.append(_Circle(x, y, goal.radius, turn))
    lines = _touching_lines(ground, circles, ends)
    chain = _search(ground, circles, lines, ends, goal)
    return None if chain is None else _as_path(start, circles, chain, goal)


def _touching_lines(ground: FreeSpace, circles: list[_Circle], ends: range) -> list[_Line]:
    found: list[_Line] = []
    for i, a in enumerate(circles):
        if i in ends:
            continue
        for j, b in enumerate(circles):
            if j == 0 or (a.x, a.y) == (b.x, b.y):
                continue
            dx, dy = b.x - a.x, b.y - a.y
            apart = math.hypot(dx, dy)
            offset = b.turn * b.radius - a.turn * a.radius
            if abs(offset) > apart:
                continue
            heading = math.atan2(dy, dx) - math.asin(offset / apart)
            n = (-math.sin(heading), math.cos(heading))
            p = (a.x - a.turn * a.radius * n[0], a.y - a.turn * a.radius * n[1])
            q = (b.x - b.turn * b.radius * n[0], b.y - b.turn * b.radius * n[1])
            found.append(_Line(i, j, p, q, heading, math.hypot(q[0] - p[0], q[1] - p[1])))
    if not found:
        return []
    free = ground.allows_lines(np.array([line.a for line in found]), np.array([line.b for line in found]))
    return [line for line, good in zip(found, free, strict=True) if good]


def _search(
    ground: FreeSpace, circles: list[_Circle], lines: list[_Line], ends: range, goal: Goal
) -> list[_Line] | None:
    """Dijkstra's algorithm over lines; an arc joins two of them."""
    leaving: dict[int, list[int]] = {}
    for k, line in enumerate(lines):
        leaving.setdefault(line.start, []).append(k)
    best: dict[int, float] = {}
    before: dict[int, int] = {}
    queue: list[tuple[float, int, int]] = [(lines[k].length, k, -1) for k in leaving.get(0, [])]
    heapq.heapify(queue)
    done: tuple[float, int] | None = None
    while queue:
        cost, k, parent = heapq.heappop(queue)
        if done is not None and cost >= done[0]:
            break
        if k in best:
            continue
        best[k], before[k] = cost, parent
        line = lines[k]
        circle = circles[line.end]
        if line.end in ends:
            last = 0.0
            if goal.heading is not None:
                angle = _arc(circle, line.heading, goal.heading)
                if angle > _LONGEST_ARC or not _arc_is_free(ground, circle, line, angle):
                    continue
                last = circle.radius * angle
            if done is None or cost + last < done[0]:
                done = (cost + last, k)
            continue
        for following in leaving.get(line.end, []):
            angle = _arc(circle, line.heading, lines[following].heading)
            if following in best or angle > _LONGEST_ARC:
                continue
            if _arc_is_free(ground, circle, line, angle):
                total = cost + circle.radius * angle + lines[following].length
                heapq.heappush(queue, (total, following, k))
    if done is None:
        return None
    chain, k = [], done[1]
    while k >= 0:
        chain.append(lines[k])
        k = before[k]
    return chain[::-1]


def _arc(circle: _Circle, arrive: float, leave: float) -> float:
    """Return the angle [rad] >= 0 driven along a circle from one heading to another."""
    angle = (circle.turn * (leave - arrive)) % _TURN
    return 0.0 if angle > _TURN - 1e-9 else angle


def _arc_is_free(ground: FreeSpace, circle: _Circle, line: _Line, angle: float) -> bool:
    count = 2 + int(circle.radius * angle / 0.03)
    headings = line.heading + circle.turn * np.linspace(0.0, angle, count)
    reach = circle.turn * circle.radius
    points = np.stack([circle.x + reach * np.sin(headings), circle.y - reach * np.cos(headings)], axis=-1)
    return ground.allows(points)


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
