"""The figure of a calibration: where the boards were, how they were tilted, and the residuals."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.ticker import MaxNLocator

from msrr_bullet.figures.plots.style import FAINT, SMALL, new_figure, save, styled
from msrr_bullet.timeline.palette import BLUE, VERMILLION, css
from msrr_perception.camera_calibration.result import CameraCalibration, FittedView
from msrr_scenes.wording import counted

_WIDTH_IN, _HEIGHT_IN = 16.0, 6.5

#: Cells of the picture, across and down, by which its coverage is counted.
_CELLS = (8, 6)

#: Largest number of pictures whose names fit below an axis.
_MOST_NAMES = 40

#: Share of the width of the picture that the longest residual is drawn as.
_LONGEST = 0.04


def covered(calibration: CameraCalibration) -> float:
    """Return the share of the picture, in cells of an eighth by a sixth, in which the boards have points."""
    size = np.array([calibration.told.width_px, calibration.told.height_px], dtype=np.float64)
    points = np.concatenate([view.corners for view in calibration.views if view.used])
    cells = np.clip(((points + 0.5) / size * _CELLS).astype(int), 0, np.array(_CELLS) - 1)
    return len(np.unique(cells, axis=0)) / math.prod(_CELLS)


def tilt(view: FittedView) -> tuple[float, float]:
    """Return by how much the normal of a board leans from the optical axis, to the right and down [deg]."""
    x, y, z = view.X_CB.R[:, 2].tolist()
    length = math.degrees(math.atan2(math.hypot(x, y), abs(z))) / max(math.hypot(x, y), 1e-12)
    return math.copysign(length, z) * x, math.copysign(length, z) * y


def draw_coverage(calibration: CameraCalibration, path: Path) -> Path:
    """Draw where the boards were, how they were tilted, and the residuals of points and pictures, as PNG."""
    with styled():
        figure = new_figure(_WIDTH_IN, _HEIGHT_IN)
        where, tilts, residuals = figure.subplots(1, 3, width_ratios=(1.5, 1.0, 1.3))
        _draw_points(where, calibration)
        _draw_tilts(tilts, calibration)
        _draw_residuals(residuals, calibration)
        return save(figure, path)


def _draw_points(axes: Axes, calibration: CameraCalibration) -> None:
    width, height = calibration.told.width_px or 0, calibration.told.height_px or 0
    longest = max(float(np.hypot(*view.residuals.T).max()) for view in calibration.views)
    scale = _LONGEST * width / max(longest, 1e-9)
    for view in calibration.views:
        colour = css(BLUE if view.used else VERMILLION)
        axes.plot(*view.corners.T, ".", color=colour, markersize=3.0)
        lines = np.stack([view.corners, view.corners + scale * view.residuals], axis=1)
        axes.add_collection(LineCollection(list(lines), colors=colour, linewidths=0.8))
    for i in range(1, _CELLS[0]):
        axes.axvline(i * width / _CELLS[0] - 0.5, color=FAINT, linewidth=0.4)
    for i in range(1, _CELLS[1]):
        axes.axhline(i * height / _CELLS[1] - 0.5, color=FAINT, linewidth=0.4)
    axes.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5), aspect="equal")
    axes.grid(visible=False)
    for side in axes.spines.values():
        side.set_visible(True)
    axes.set_title(f"points of the boards in {100.0 * covered(calibration):.0f} % of the cells")
    axes.set_xlabel(f"columns [px]; residuals {scale:.0f} times as long")
    axes.set_ylabel("rows [px]")


def _draw_tilts(axes: Axes, calibration: CameraCalibration) -> None:
    for view in calibration.views:
        axes.plot(*tilt(view), "o", color=css(BLUE if view.used else VERMILLION))
    for angle in (15.0, 30.0, 45.0):
        around = np.linspace(0.0, 2.0 * np.pi, 100)
        axes.plot(angle * np.cos(around), angle * np.sin(around), color=FAINT, linewidth=0.6)
        at = 0.7 * angle, 0.7 * angle
        axes.annotate(f"{angle:.0f}", at, ha="left", va="top", fontsize=SMALL - 3.0, color=FAINT)
    reach = max(48.0, *(max(map(abs, tilt(view))) + 3.0 for view in calibration.views))
    axes.set(xlim=(-reach, reach), ylim=(reach, -reach), aspect="equal")
    axes.set_title("tilt of the boards [deg]")
    axes.set_xlabel("to the right")
    axes.set_ylabel("down")


def _draw_residuals(axes: Axes, calibration: CameraCalibration) -> None:
    views = calibration.views
    colours = [css(BLUE if view.used else VERMILLION) for view in views]
    axes.bar(range(len(views)), [view.rms_px for view in views], color=colours, width=0.7)
    axes.axhline(calibration.rms_px, color=FAINT, linewidth=1.2, linestyle="--")
    axes.grid(axis="x", visible=False)
    if len(views) <= _MOST_NAMES:
        names = [Path(view.name).stem for view in views]
        axes.set_xticks(range(len(views)), names, rotation=90, fontsize=SMALL - 3.0)
    else:
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    left_out = sum(not view.used for view in views)
    text = f", {left_out} left out" if left_out else ""
    axes.set_title(f"{counted(len(views), 'picture')}{text}: {calibration.rms_px:.2f} px RMS")
    axes.set_ylabel("residual [px]")
