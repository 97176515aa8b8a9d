"""Plot of the time series of a run, or of a mission as a whole."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from msrr_bullet.figures.plots import curves
from msrr_bullet.figures.plots.mission_chart import draw_mission, mission_height
from msrr_bullet.figures.plots.style import check_format, save
from msrr_bullet.timeline.series import TrialSeries
from msrr_bullet.timeline.snapshot import Snapshot, of_unit, unit_of_curves
from msrr_scenes.errors import MsrrError
from msrr_scenes.specs.scene import Scene

#: Width and height of one row [in], and resolution [1/in].
WIDTH, ROW, DPI = 13.0, 2.0, 120


def write_plot(
    path: Path, scene: Scene, snapshots: Sequence[Snapshot], headline: str = "", unit: str | None = None
) -> Path:
    """Write a plot of the time series of a run, and return the path of the file.

    Of a mission of a base station it shows what every unit did, unless a unit is named. Otherwise the left
    column shows where the unit is, truth and belief: distance from the path if it followed one, gap, lateral
    offset and heading before the port. The right column shows velocities, clearance and line of sight.

    Args:
        path: File to write. Its suffix selects the format: PNG, PDF or SVG.
        scene: Scene of the run.
        snapshots: Snapshots in order of time, at any rate.
        headline: Text after the name of the scene, such as the outcome.
        unit: Unit whose steps are shown; None shows the mission or all, or if several units on their own are
            under way at once, the first one.

    Raises:
        MsrrError: There is no snapshot, the suffix names no such format, or the unit has no step.
    """
    check_format(path)
    if not snapshots:
        raise MsrrError(f"{path}: a trial without a single snapshot gives no plot")
    if scene.coordinated and unit is None:
        figure = Figure(figsize=(WIDTH, mission_height(scene) + 0.6), dpi=DPI, layout="constrained")
        draw_mission(figure, figure.add_gridspec(1, 1)[0], scene, snapshots)
        curves.set_title(figure, scene, headline)
        return save(figure, path)
    shown = unit_of_curves(snapshots, unit)
    series = TrialSeries.of(scene, of_unit(snapshots, shown))
    left: list[Callable[[Axes], None]] = []
    if np.isfinite([series.true_port, series.believed_port]).any():  # it has a port to go to
        left = [
            lambda axes: curves.gap(axes, series),
            lambda axes: curves.lateral(axes, series),
            lambda axes: curves.yaw(axes, series),
        ]
    if series.follows_path:
        left.insert(0, lambda axes: curves.off_path(axes, series))
    right: list[Callable[[Axes], None]] = []
    if np.isfinite(series.sight).any():
        right = [lambda axes: curves.sight(axes, series, scene)]
    if np.isfinite(series.commanded).any():  # of a recording nobody knows how it was driven
        right = [
            lambda axes: curves.speed(axes, series, scene.limits),
            lambda axes: curves.turn_rate(axes, series, scene.limits),
            lambda axes: curves.clearance(axes, series, scene),
            *right,
        ]
    figure = Figure(figsize=(WIDTH, ROW * max(len(left), len(right)) + 0.6), dpi=DPI, layout="constrained")
    if not left and not right:
        left = [lambda axes: curves.gap(axes, series)]
    stacks = [stack for stack in (left, right) if stack]
    columns = figure.add_gridspec(1, len(stacks))
    for k, stack in enumerate(stacks):
        curves.draw_stack(figure, columns[k], series, stack)
    curves.set_title(figure, scene, headline, shown)
    return save(figure, path)
