"""The time series of a run in one figure."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from msrr_bullet.figures import curves
from msrr_bullet.figures.stack import draw_stack
from msrr_bullet.timeline.series import Series
from msrr_bullet.timeline.snapshot import Snapshot
from msrr_scenes.errors import MsrrError
from msrr_scenes.specs.scene import Scene

#: Width and height of one row [in], and resolution [1/in].
WIDTH, ROW, DPI = 13.0, 2.0, 120

#: The formats, and what of the day and the program each would tell: the same run gives the same file.
_TIMELESS: dict[str, dict[str, str | None]] = {
    ".png": {"Software": None},
    ".pdf": {"CreationDate": None},
    ".svg": {"Date": None},
}


def write_plot(path: Path, scene: Scene, frames: Sequence[Snapshot], headline: str = "") -> Path:
    """Write the time series of a run; the ending of the path says in which format (PNG, PDF, SVG).

    On the left where the unit is, on the right what it does: distance from the path (when it followed one),
    gap, lateral offset and heading before the port, belief on truth; velocities, clearance, line of sight.

    Args:
        path: File to write.
        scene: The scene of the run.
        frames: Instants in order, at any rate.
        headline: Such as the outcome.

    Raises:
        MsrrError: There is not a single frame, or no such format.
    """
    if path.suffix.lower() not in _TIMELESS:
        raise MsrrError(f"{path}: no format for plots; end the name with {' or '.join(_TIMELESS)}")
    series = Series.of(scene, frames)
    where: list[Callable[[Axes], None]] = [
        lambda axes: curves.gap(axes, series),
        lambda axes: curves.lateral(axes, series),
        lambda axes: curves.yaw(axes, series),
    ]
    if series.assembles:
        where.insert(0, lambda axes: curves.off_path(axes, series))
    what: list[Callable[[Axes], None]] = [
        lambda axes: curves.speed(axes, series, scene.limits),
        lambda axes: curves.turn_rate(axes, series, scene.limits),
        lambda axes: curves.clearance(axes, series, scene.control.guard, scene.judge),
        lambda axes: curves.sight(axes, series, scene),
    ]
    figure = Figure(figsize=(WIDTH, ROW * max(len(where), len(what)) + 0.6), dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)
    columns = figure.add_gridspec(1, 2)
    draw_stack(figure, columns[0], series, where)
    draw_stack(figure, columns[1], series, what)
    figure.suptitle(f"{scene.name}{f': {headline}' if headline else ''}", fontsize=13, fontweight="bold")
    with rc_context({"svg.hashsalt": "msrr"}):
        figure.savefig(path, metadata=_TIMELESS[path.suffix.lower()])
    return path
