"""One picture of a trial: the ways from above, the errors and angles over time, what the camera saw."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from msrr_bullet.figures import curves
from msrr_bullet.figures.stack import draw_stack
from msrr_bullet.figures.top_view import draw_top_view, extent
from msrr_bullet.timeline.camera_views import CameraView
from msrr_bullet.timeline.palette import DETECTION, css
from msrr_bullet.timeline.series import Series
from msrr_bullet.timeline.snapshot import Snapshot
from msrr_scenes.errors import MsrrError
from msrr_scenes.messages import seconds
from msrr_scenes.specs.scene import Scene

#: Width [in] and resolution [1/in] of the picture; its height follows the shape of the trial.
WIDTH, DPI = 12.0, 130
#: Widths of the two columns' drawings, of a row of curves, of the words around a drawing [in].
_LEFT, _ROW, _WORDS = 5.7, 1.45, 0.75
#: Bounds of the height of the view from above [in].
_LOW, _HIGH = 1.7, 4.6


def write_picture(
    path: Path,
    scene: Scene,
    frames: Sequence[Snapshot],
    onboard: Sequence[CameraView] = (),
    headline: str = "",
) -> Path:
    """Write a PNG that sums a trial up; return its path.

    Args:
        path: File to write.
        scene: The scene of the trial.
        frames: Instants in order, at any rate.
        onboard: At most three views of the docking unit's camera.
        headline: Such as the outcome.

    Raises:
        MsrrError: There is not a single frame.
    """
    if not frames:
        raise MsrrError(f"{path}: a trial without a single frame gives no picture")
    series = Series.of(scene, frames)
    drawn: list[Callable[[Axes], None]] = [
        lambda axes: curves.lateral(axes, series),
        lambda axes: curves.yaw(axes, series),
        lambda axes: curves.sight(axes, series, scene),
    ]
    if series.assembles:
        drawn.insert(0, lambda axes: curves.off_path(axes, series))
    views = tuple(onboard)[:3]
    (x0, x1), (y0, y1) = extent(scene, frames)
    above = min(max(_LEFT * (y1 - y0) / (x1 - x0), _LOW), _HIGH) + _WORDS
    below = 0.75 * _LEFT / len(views) + 0.5 * _WORDS if views else 0.0
    below = min(below, 0.25 * _LEFT + 0.5 * _WORDS)
    height = max(above + below, len(drawn) * _ROW) + 0.5 * _WORDS
    figure = Figure(figsize=(WIDTH, height), dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)
    columns = figure.add_gridspec(1, 2, width_ratios=(1.15, 1.0))
    left, right = columns[0], columns[1]
    if views:
        rows = left.subgridspec(2, 1, height_ratios=(above, below))
        cells = rows[1].subgridspec(1, len(views))
        for i, view in enumerate(views):
            _onboard(figure.add_subplot(cells[i]), view, frames[0].stamp_ns)
        left = rows[0]
    draw_top_view(figure.add_subplot(left), scene, frames)
    draw_stack(figure, right, series, drawn)
    figure.suptitle(f"{scene.name}{f': {headline}' if headline else ''}", fontsize=13, fontweight="bold")
    figure.savefig(path, metadata={"Software": None})
    return path


def _onboard(axes: Axes, view: CameraView, start_ns: int) -> None:
    axes.imshow(view.mosaic()[0], cmap="gray", vmin=0, vmax=255, interpolation="antialiased")
    for tag in view.tags:
        axes.add_patch(
            Polygon([(float(x), float(y)) for x, y in tag.corners], fill=False, edgecolor=css(DETECTION))
        )
        middle = tag.corners.mean(axis=0)
        axes.annotate(
            str(tag.tag_id),
            (float(middle[0]), float(middle[1])),
            color=css(DETECTION),
            fontsize=7,
            ha="center",
        )
    axes.set_title(
        f"onboard, {seconds(view.stamp_ns - start_ns):.2f} s, tags found: {len(view.tags)}", fontsize=8
    )
    axes.set_axis_off()
