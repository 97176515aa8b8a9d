"""Drawing of floor and bodies at their true poses, shown where no pixels of a frame were read."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from msrr_bullet.figures.drawing.canvas import Canvas
from msrr_bullet.figures.drawing.perspective import Perspective, Solids, on_floor
from msrr_bullet.timeline.palette import DARK, FLOOR, GRID
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.specs.bodies import ArenaSpec

#: Colours of the border of the arena, and of the plate and the square of a tag.
BORDER, PLATE, SQUARE = DARK, 0xFFFFFF, 0x4A5562
#: Depth by which a tag is drawn in front of the body that carries it [m].
_TAG_OFFSET = 0.03
#: Spacing of the lines on the floor [m].
GRID_STEP = 0.5


@dataclass(frozen=True, eq=False)
class Drawing:
    """Picture of a camera, to which points of the world are drawn where the camera sees them."""

    canvas: Canvas
    perspective: Perspective

    def line(
        self,
        points_W: Array,
        colour: int,
        width: int = 1,
        *,
        dashed: bool = False,
        halo: int | None = None,
    ) -> None:
        """Draw the part in front of the camera of a line through points of the world, shape (N, 3) [m]."""
        pixels = self.perspective.pixels(points_W)
        pieces = [pixels] if np.isfinite(pixels).all() else self.perspective.line(points_W)
        for piece in pieces:
            self.canvas.line(piece, colour, width, dashed=dashed, halo=halo)


def draw_scene(
    drawing: Drawing,
    arena: ArenaSpec,
    solids: Mapping[str, Solids],
    poses: Mapping[str, SE2],
    hidden: str | None,
) -> None:
    """Draw floor and bodies: those that are present, by their poses ``X_WB``.

    ``hidden`` is the body that the camera does not see: the unit that carries it; None without one.
    """
    draw_floor(drawing, arena)
    faces = list(_faces(drawing.perspective, solids, poses, hidden))
    if not faces:
        return
    outlines = drawing.perspective.areas([points_W for points_W, *_ in faces])
    seen = [
        (depth - ahead, outline, colour, edge)
        for (depth, outline), (_, ahead, colour, edge) in zip(outlines, faces, strict=True)
        if len(outline)
    ]
    for _, outline, colour, edge in sorted(seen, key=lambda face: -face[0]):
        drawing.canvas.fill(outline, colour, edge)


def _faces(
    perspective: Perspective, solids: Mapping[str, Solids], poses: Mapping[str, SE2], hidden: str | None
) -> Iterator[tuple[Array, float, int, int | None]]:
    """Yield areas to fill.

    Yields:
        Points (N, 3) in W whose hull the area is, by how much it is drawn in front of its place [m], its
        colour, and the colour of its edge.
    """
    for name, X_WB in poses.items():
        if name == hidden:
            continue
        points_W, end = SE3.from_se2(X_WB).act(solids[name].points), 0
        for points_B, colour in solids[name].shapes:
            start, end = end, end + len(points_B)
            yield points_W[start:end], 0.0, _pale(colour), colour
        for X_WT, plate, square in solids[name].squares(X_WB):
            if perspective.sees_front(X_WT):
                # The square lies on the plate and the plate on the body, so each is drawn after the one
                # below.
                yield plate, _TAG_OFFSET, PLATE, SQUARE
                yield square, 2.0 * _TAG_OFFSET, SQUARE, None


def draw_floor(drawing: Drawing, arena: ArenaSpec) -> None:
    """Draw the floor with grid and border."""
    (x0, x1), (y0, y1) = arena.x_m, arena.y_m
    corners = [[x0, y0], [x1, y0], [x1, y1], [x0, y1]]
    drawing.canvas.fill(drawing.perspective.hull(on_floor(corners)), FLOOR)
    lines = [[[x, y0], [x, y1]] for x in _grid(x0, x1)] + [[[x0, y], [x1, y]] for y in _grid(y0, y1)]
    for line in lines:
        drawing.line(on_floor(line), GRID)
    drawing.line(on_floor([*corners, corners[0]]), BORDER, 2)


def ring(X_WB: SE2, radius: float, z: float) -> Array:
    """Return a closed circle about a body at height ``z`` [m], shape (N, 3) in W [m]."""
    t = np.linspace(0.0, 2.0 * math.pi, 48, endpoint=False)
    rim = on_floor(X_WB.translation + radius * np.column_stack([np.cos(t), np.sin(t)]), z)
    return np.concatenate([rim, rim[:1]])


def _pale(colour: int) -> int:
    """Return a colour mixed with white, so that bodies stay in the background."""
    mixed = [(3 * ((colour >> shift) & 255) + 5 * 255) // 8 for shift in (16, 8, 0)]
    return (mixed[0] << 16) | (mixed[1] << 8) | mixed[2]


def _grid(low: float, high: float) -> list[float]:
    return [k * GRID_STEP for k in range(math.ceil(low / GRID_STEP), math.floor(high / GRID_STEP) + 1)]
