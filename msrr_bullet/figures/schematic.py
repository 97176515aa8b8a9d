"""A drawing of what a camera had before it in truth: shown where no pixel was read."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np

from msrr_bullet.figures.canvas import Canvas
from msrr_bullet.figures.perspective import Perspective, Solids, circle, on_floor
from msrr_bullet.timeline.palette import DARK, FLOOR, GRID
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.specs.bodies import ArenaSpec

#: Colours of what is not floor, of the border, and of a tag's plate and square.
AROUND, BORDER, PLATE, SQUARE = 0xE2E7EC, DARK, 0xFFFFFF, 0x4A5562
#: By how much less depth a tag is drawn than the body that carries it [m].
_ON_TOP = 0.03
#: Spacing of the lines on the floor [m].
GRID_STEP = 0.5


def draw_scene(
    canvas: Canvas,
    view: Perspective,
    arena: ArenaSpec,
    solids: Mapping[str, Solids],
    poses: Mapping[str, SE2],
    without: str | None = None,
) -> None:
    """Draw floor and bodies.

    Args:
        canvas: What to draw on.
        view: The camera.
        arena: The floor.
        solids: Every body of the scene.
        poses: ``X_WB`` of those that are there.
        without: A body that the camera does not see: the one which carries it.
    """
    draw_floor(canvas, view, arena)
    for _, points_W, colour, edge in sorted(_faces(view, solids, poses, without), key=lambda f: -f[0]):
        canvas.fill(view.hull(points_W), colour, edge)


def _faces(
    view: Perspective, solids: Mapping[str, Solids], poses: Mapping[str, SE2], without: str | None
) -> Iterator[tuple[float, Array, int, int | None]]:
    """Yield what is to be filled: depth [m], points (N, 3) in W that span it, colour, colour of its edge."""
    for name, X_WB in poses.items():
        if name == without:
            continue
        X = SE3.from_se2(X_WB)
        for points_B, colour in solids[name].shapes:
            points_W = X.act(points_B)
            yield view.depth(points_W), points_W, pale(colour), colour
        for X_WT, plate, square in solids[name].squares(X_WB):
            if view.faces(X_WT):
                # A square lies on its plate, a plate on its body: each is nearer than what is under it.
                yield view.depth(plate) - _ON_TOP, plate, PLATE, SQUARE
                yield view.depth(square) - 2.0 * _ON_TOP, square, SQUARE, None


def draw_floor(canvas: Canvas, view: Perspective, arena: ArenaSpec) -> None:
    """Draw the floor with its grid and border."""
    (x0, x1), (y0, y1) = arena.x_m, arena.y_m
    corners = [[x0, y0], [x1, y0], [x1, y1], [x0, y1]]
    canvas.fill(view.hull(on_floor(corners)), FLOOR)
    lines = [[[x, y0], [x, y1]] for x in _steps(x0, x1)] + [[[x0, y], [x1, y]] for y in _steps(y0, y1)]
    for line in lines:
        draw_line(canvas, view, on_floor(line), GRID)
    draw_line(canvas, view, on_floor([*corners, corners[0]]), BORDER, 2)


def draw_line(
    canvas: Canvas,
    view: Perspective,
    points_W: Array,
    colour: int,
    width: int = 1,
    *,
    dashed: bool = False,
    halo: int | None = None,
) -> None:
    """Draw a line through points of the world, shape (N, 3), as far as it lies before the camera."""
    seen = view.pixels(points_W)
    if np.isfinite(seen).all():
        canvas.line(seen, colour, width, dashed=dashed, halo=halo)
        return
    for stretch in view.line(points_W):
        canvas.line(stretch, colour, width, dashed=dashed, halo=halo)


def ring(X_WB: SE2, radius: float, z: float = 0.0) -> Array:
    """Return a closed circle about a body at height ``z`` [m], shape (N, 3) [m]."""
    rim = on_floor(X_WB.translation + radius * circle(), z)
    return np.concatenate([rim, rim[:1]])


def pale(colour: int) -> int:
    """Return a colour mixed with white, so that drawings stay behind what is drawn upon them."""
    mixed = [(3 * ((colour >> shift) & 255) + 5 * 255) // 8 for shift in (16, 8, 0)]
    return (mixed[0] << 16) | (mixed[1] << 8) | mixed[2]


def _steps(low: float, high: float) -> list[float]:
    return [k * GRID_STEP for k in range(math.ceil(low / GRID_STEP), math.floor(high / GRID_STEP) + 1)]
