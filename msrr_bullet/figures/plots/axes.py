"""Bodies and text as matplotlib draws them in views from above and in charts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from matplotlib.axes import Axes
from matplotlib.patches import Circle, Polygon
from matplotlib.patheffects import AbstractPathEffect, withStroke

from msrr_bullet.collision.footprint import Part
from msrr_bullet.timeline.palette import DARK, css
from msrr_scenes.geometry.se2 import SE2


def halo(width: float = 2.0) -> list[AbstractPathEffect]:
    """Return the effect that draws text on a white rim, so that it can be read on any ground."""
    return [withStroke(linewidth=width, foreground="white")]


def add_grid(axes: Axes, axis: Literal["both", "x"] = "both") -> None:
    """Add the grid behind all else, and set the size of the tick labels."""
    axes.grid(True, axis=axis, color="#e4e7ea", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.tick_params(axis=axis, labelsize=8)


def draw_body(axes: Axes, parts: Sequence[Part], X_WB: SE2, colour: int, alpha: float) -> None:
    """Draw the footprint of a body at a pose ``X_WB``."""
    for part in parts:
        patch = _patch(part, X_WB)
        patch.set(facecolor=css(colour), edgecolor=css(DARK), linewidth=0.8, alpha=alpha)
        axes.add_patch(patch)


def _patch(part: Part, X_WB: SE2) -> Polygon | Circle:
    core = X_WB.act(part.core)
    if len(core) == 1:
        return Circle((float(core[0, 0]), float(core[0, 1])), part.radius)
    return Polygon([(float(x), float(y)) for x, y in core])
