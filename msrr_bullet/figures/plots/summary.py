"""Summary picture of a trial: paths from above, curves or the chart of a mission, onboard camera frames."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from textwrap import fill

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.patches import Polygon

from msrr_bullet.figures.drawing.mission_marks import short_name
from msrr_bullet.figures.plots import curves
from msrr_bullet.figures.plots.mission_chart import draw_mission, mission_height
from msrr_bullet.figures.plots.style import save
from msrr_bullet.figures.plots.top_view import draw_top_view, extent
from msrr_bullet.timeline.camera_views import CameraView
from msrr_bullet.timeline.palette import DETECTION, css
from msrr_bullet.timeline.series import TrialSeries
from msrr_bullet.timeline.snapshot import Snapshot, of_unit, unit_of_curves
from msrr_scenes.errors import MsrrError
from msrr_scenes.messages import carrier_of, seconds
from msrr_scenes.specs.scene import Scene

#: Width [in] and resolution [1/in] of the picture. Its height depends on the extent of the trial.
WIDTH, DPI = 12.0, 130
#: Width of the left column, height of a row of curves, and height of the text around a drawing [in].
_LEFT, _ROW, _TEXT = 5.7, 1.45, 0.75
#: Smallest and largest height of the view from above [in].
_MIN_ABOVE, _MAX_ABOVE = 1.7, 4.6
#: Largest number of letters in a line above a frame.
_TITLE = 38


def write_picture(
    path: Path,
    scene: Scene,
    snapshots: Sequence[Snapshot],
    onboard: Sequence[CameraView] = (),
    headline: str = "",
) -> Path:
    """Write a PNG that summarizes a trial, and return the path of the file.

    At most three views of the onboard camera are shown. Scene, snapshots and headline are as for
    :func:`msrr_bullet.figures.plots.run_plot.write_plot`.

    Raises:
        MsrrError: There is no snapshot.
    """
    if not snapshots:
        raise MsrrError(f"{path}: a trial without a single snapshot gives no picture")
    shown: str | None = None
    if scene.coordinated:
        beside, draw_beside = mission_height(scene), partial(draw_mission, scene=scene, snapshots=snapshots)
    else:
        shown = unit_of_curves(snapshots)
        series = TrialSeries.of(scene, of_unit(snapshots, shown))
        rows_of_curves = _rows_of_curves(scene, series)
        beside = len(rows_of_curves) * _ROW
        draw_beside = partial(curves.draw_stack, series=series, curves=rows_of_curves)
    views = tuple(onboard)[:3]
    (x0, x1), (y0, y1) = extent(scene, snapshots)
    above = min(max(_LEFT * (y1 - y0) / (x1 - x0), _MIN_ABOVE), _MAX_ABOVE) + _TEXT
    below = 0.75 * _LEFT / len(views) + 0.5 * _TEXT if views else 0.0
    below = min(below, 0.25 * _LEFT + 0.5 * _TEXT)
    height = max(above + below, beside) + 0.5 * _TEXT
    figure = Figure(figsize=(WIDTH, height), dpi=DPI)
    columns = figure.add_gridspec(1, 2, width_ratios=(1.15, 1.0))
    left, right = columns[0], columns[1]
    if views:
        rows = left.subgridspec(2, 1, height_ratios=(above, below))
        cells = rows[1].subgridspec(1, len(views))
        for i, view in enumerate(views):
            _draw_onboard(figure.add_subplot(cells[i]), view)
        left = rows[0]
    from_above = figure.add_subplot(left)
    draw_top_view(from_above, scene, snapshots)
    draw_beside(figure, right)
    curves.set_title(figure, scene, headline, shown)
    # Axes of equal aspect are laid out as if they filled their cell, and then shrink inside it. Laid out with
    # their aspect, those that nearly fill it run over the edge of the picture.
    from_above.set_aspect("auto")
    ConstrainedLayoutEngine().execute(figure)
    from_above.set_aspect("equal")
    return save(figure, path)


def _rows_of_curves(scene: Scene, series: TrialSeries) -> list[Callable[[Axes], None]]:
    rows: list[Callable[[Axes], None]] = [
        lambda axes: curves.lateral(axes, series),
        lambda axes: curves.yaw(axes, series),
    ]
    if np.isfinite(series.sight).any():  # the unit has looked for the port
        rows.append(lambda axes: curves.sight(axes, series, scene))
    if series.follows_path:
        rows.insert(0, lambda axes: curves.off_path(axes, series))
    return rows


def _draw_onboard(axes: Axes, view: CameraView) -> None:
    axes.imshow(view.mosaic()[0], cmap="gray", vmin=0, vmax=255, interpolation="antialiased")
    for tag in view.tags:
        outline = [(float(x), float(y)) for x, y in tag.corners]
        axes.add_patch(Polygon(outline, fill=False, edgecolor=css(DETECTION)))
        x, y = (float(a) for a in tag.corners.mean(axis=0))
        axes.annotate(str(tag.tag_id), (x, y), color=css(DETECTION), fontsize=7, ha="center")
    unit, time = short_name(carrier_of(view.exposure.camera) or ""), seconds(view.stamp_ns)
    title = f"onboard {unit}, {time:.2f} s, tags found: {len(view.tags)}"
    axes.set_title(fill(title, _TITLE), fontsize=8)
    axes.set_axis_off()
