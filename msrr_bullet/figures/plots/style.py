"""The style of figures of studies: sizes, colours that colour-blind readers can tell apart, their files."""

from __future__ import annotations

import re
from contextlib import AbstractContextManager
from io import BytesIO
from pathlib import Path
from typing import Any

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from msrr_bullet.timeline.palette import BLACK, BLUE, GREEN, OBSTACLE, ORANGE, PURPLE, VERMILLION, css
from msrr_scenes.errors import MsrrError
from msrr_scenes.whole_files import write_named

DPI = 110

#: Formats with the metadata that leave out date and program, so that the same figure gives the same file.
_METADATA: dict[str, dict[str, str | None]] = {
    ".png": {"Software": None},
    ".pdf": {"CreationDate": None},
    ".svg": {"Date": None},
}

#: Text sizes that are still readable when a figure is shown at half its width.
_TEXT: dict[Any, Any] = {
    "font.size": 15.0,
    "axes.titlesize": 15.0,
    "axes.labelsize": 15.0,
    "xtick.labelsize": 14.0,
    "ytick.labelsize": 14.0,
    "legend.fontsize": 13.5,
    "figure.titlesize": 17.0,
    "lines.linewidth": 2.2,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#d9dde2",
    "grid.linewidth": 0.8,
    "axes.axisbelow": True,
    "hatch.linewidth": 1.6,
    "text.parse_math": False,  # names of pictures may hold dollars
}

#: What is different on a page that is shown in dark colours.
_DARK: dict[Any, Any] = {
    **dict.fromkeys(("figure.facecolor", "axes.facecolor", "savefig.facecolor"), "#14181d"),
    **dict.fromkeys(("text.color", "axes.labelcolor", "xtick.color", "ytick.color"), "#e4e8ec"),
    "axes.edgecolor": "#e4e8ec",
    "grid.color": "#333b44",
}

#: Size of numbers inside a figure.
SMALL = 13.0

#: Colour and marker of each controller in every figure; the marker tells controllers apart without colour.
_STYLES: dict[str, tuple[int, str]] = {
    "c1": (BLUE, "o"),
    "c2": (VERMILLION, "s"),
    "cbf": (GREEN, "^"),
    "graceful": (PURPLE, "D"),
    "linear": (ORANGE, "v"),
}

#: Colours of what belongs to no controller.
PAPER, FAINT, HAZARD = css(BLACK), "#6b747d", css(OBSTACLE)


def controller_style(controller: str) -> tuple[str, str]:
    """Return colour and marker of a controller, by its registered name or its label, which begins with it."""
    colour, marker = _STYLES.get(re.split(r"[ ,]", controller)[0].lower(), (0x59636D, "P"))
    return css(colour), marker


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure of this size [in] that needs no window system."""
    return Figure(figsize=(width, height), dpi=DPI, layout="constrained")


def styled(*, dark: bool = False) -> AbstractContextManager[None]:
    """Return the context in which every figure is drawn and saved."""
    return rc_context({**_TEXT, **_DARK} if dark else _TEXT)


def legend_above(axes: Axes, columns: int = 2) -> None:
    """Make room at the top of the axes and put the legend there, so that it hides no curve."""
    low, high = axes.get_ylim()
    lines = -(-len(axes.get_legend_handles_labels()[1]) // columns)
    axes.set_ylim(low, high + (0.06 + 0.115 * lines) * (high - low))
    axes.legend(loc="upper center", ncols=columns, columnspacing=0.8, handlelength=1.8, framealpha=1.0)


def check_format(path: Path) -> None:
    """Raise a :class:`MsrrError` if the ending of a file names no format of figures."""
    if path.suffix.lower() not in _METADATA:
        raise MsrrError(f"{path}: no format for plots; end the name with {' or '.join(_METADATA)}")


def save(figure: Figure, path: Path) -> Path:
    """Write a PNG, PDF or SVG file, by its ending, whose bytes depend on nothing but the figure.

    Raises:
        MsrrError: The ending names no such format, or the file cannot be written.
    """
    check_format(path)
    # It is made in memory, because matplotlib writes a file piece by piece.
    ending, content = path.suffix.lower(), BytesIO()
    with rc_context({"svg.hashsalt": "msrr"}):
        figure.savefig(content, format=ending[1:], metadata=_METADATA[ending])
    write_named(path, content.getvalue())
    return path
