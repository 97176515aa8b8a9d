"""How figures look: sizes, colours that stay apart for colour-blind eyes, and the file they become."""

from __future__ import annotations

from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from msrr_bullet.viewer.palette import BLACK, BLUE, DARK, GREEN, ORANGE, PURPLE, SKY, VERMILLION, css

DPI = 110

#: Sizes at which a figure can still be read at half its width.
_TEXT: dict[Any, Any] = {
    "font.size": 14.0,
    "axes.titlesize": 14.0,
    "axes.labelsize": 14.0,
    "xtick.labelsize": 13.0,
    "ytick.labelsize": 13.0,
    "legend.fontsize": 12.0,
    "lines.linewidth": 2.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#d9dde2",
    "grid.linewidth": 0.8,
    "axes.axisbelow": True,
    "svg.hashsalt": "msrr",
}

#: Colour and marker of each controller; the marker tells them apart without colour.
_LOOKS: dict[str, tuple[int, str]] = {
    "c1": (BLUE, "o"),
    "c2": (VERMILLION, "s"),
    "cbf": (GREEN, "^"),
    "graceful": (PURPLE, "D"),
    "linear": (ORANGE, "v"),
}

PAPER = css(BLACK)
FAINT = css(DARK)
FIRST, SECOND, THIRD = css(BLUE), css(VERMILLION), css(GREEN)
LIMIT, MARK = css(SKY), css(ORANGE)


def look(controller: str) -> tuple[str, str]:
    """Return colour and marker of a controller."""
    colour, marker = _LOOKS.get(controller, (DARK, "P"))
    return css(colour), marker


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure of that size [in], drawn without a window system."""
    figure = Figure(figsize=(width, height), dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def styled() -> AbstractContextManager[None]:
    """Return the context in which every figure is drawn and saved."""
    return rc_context(_TEXT)


def save(figure: Figure, path: Path) -> Path:
    """Write a PNG that depends on nothing but what is drawn."""
    figure.savefig(path, metadata={"Software": None})
    return path
