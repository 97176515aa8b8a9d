"""The six panels of the paper's Fig. 6: one trial of each controller over time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle

from msrr_bullet.figures.plots.style import (
    FAINT,
    HAZARD,
    PAPER,
    controller_style,
    legend_above,
    new_figure,
    save,
    styled,
)
from msrr_bullet.studies.measures import SETTLED_M, measure
from msrr_bullet.studies.series import Panels, Series
from msrr_scenes.arrays import Array

#: Line styles of up to three curves of one panel, which are drawn in the controller's colour, black and grey.
_STYLES = ("-", "--", ":")


def draw_panels(panels: Panels, name: str, path: Path, cone_deg: tuple[float, float]) -> Path:
    """Draw the trial of the controller with the label ``name`` as a PNG file.

    ``cone_deg`` are the inner and the outer bound of the line of sight.
    """
    series = panels.series[name]
    colour = controller_style(name)[0]
    with styled():
        figure = new_figure(16.0, 10.0)
        axes = figure.subplots(2, 3)
        t = np.array(series.time)
        _draw_path(axes[0, 0], series, panels.phase, colour)
        _draw_errors(axes[0, 1], t, series, panels.phase, colour)
        _draw_speed(axes[0, 2], t, series, 0, colour)
        _draw_speed(axes[1, 2], t, series, 1, colour)
        if panels.phase == "long":
            _draw_distance(axes[1, 0], t, series, colour)
        else:
            _draw_angles(axes[1, 0], t, series, cone_deg, colour)
        _draw_auxiliary(axes[1, 1], t, series, colour)
        for panel in axes.flat[1:]:
            panel.set_xlabel("time [s]")
            panel.set_xlim(0.0, t[-1])
        figure.suptitle(f"{name}, {panels.phase} phase, {panels.setting}", fontweight="bold")
        return save(figure, path)


def _draw_path(axes: Axes, series: Series, phase: str, colour: str) -> None:
    tip = np.array(series.tip)
    reference = np.array(series.reference).reshape(-1, 2)
    if len(reference):
        text = "desired path" if phase == "long" else "guidance"
        axes.plot(*reference.T, color=PAPER, linestyle="--", label=text)
    axes.plot(*tip.T, color=colour, label="controlled point")
    axes.plot(*tip[0], color=colour, marker="o", markersize=8, linestyle="", label="its start")
    if series.obstacle is not None:
        x, y, radius = series.obstacle
        axes.add_patch(Circle((x, y), radius, facecolor=HAZARD, edgecolor=PAPER, label="obstacle"))
        points = np.concatenate([tip, reference, [[x - radius, y - radius], [x + radius, y + radius]]])
    else:
        axes.axvline(0.0, color=FAINT, linewidth=3.0, label="face of the port")
        points = np.concatenate([tip, [[0.0, -0.02], [0.0, 0.02]]])
    low, high = points.min(axis=0), points.max(axis=0)
    axes.set(xlabel="x [m]", ylabel="y [m]", title="from above")
    if series.obstacle is not None:
        axes.set_aspect("equal", adjustable="datalim")
    # Room for the legend at the top, whatever limits the equal aspect leads to.
    axes.update_datalim([low, (high[0], high[1] + 0.36 * (high[1] - low[1]))])
    axes.autoscale_view()
    axes.legend(loc="upper center", ncols=2, columnspacing=0.8, handlelength=1.8, framealpha=1.0)


def _draw_errors(axes: Axes, t: Array, series: Series, phase: str, colour: str) -> None:
    error = np.array(series.error)
    names, colours = ("x [m]", "y [m]", "heading [rad]"), (colour, PAPER, FAINT)
    for k, (name, ink, style) in enumerate(zip(names, colours, _STYLES, strict=True)):
        axes.plot(t, error[:, k], color=ink, linestyle=style, label=name)
    bound = measure("amplitude").paper_c1 if phase == "long" else SETTLED_M
    if bound is not None:
        text = f"paper: {bound:g} m at most" if phase == "long" else f"paper: {1e3 * bound:g} mm"
        for sign in (1.0, -1.0):
            axes.axhline(sign * bound, color=PAPER, linewidth=1.0, label=text if sign > 0 else None)
    settled = measure("settling").paper_c1
    if phase == "close" and settled is not None:
        axes.axvline(settled, color=PAPER, linewidth=1.0, linestyle="-.", label=f"paper: {settled:g} s")
    axes.set(ylabel="error [m], [rad]", title="tracking errors")
    legend_above(axes)


def _draw_speed(axes: Axes, t: Array, series: Series, component: int, colour: str) -> None:
    axes.plot(t, np.array(series.command)[:, component], color=PAPER, linewidth=0.9, label="commanded")
    axes.plot(t, np.array(series.twist)[:, component], color=colour, label="behind the limits")
    bound = series.limits[component]
    for sign in (1.0, -1.0):
        axes.axhline(sign * bound, color=PAPER, linestyle=":", label="limit" if sign > 0 else None)
    label, title = (("v [m/s]", "speed"), ("w [rad/s]", "turn rate"))[component]
    axes.set(ylabel=label, title=title)
    axes.set_ylim(-1.15 * bound, 1.15 * bound)
    legend_above(axes)


def _draw_distance(axes: Axes, t: Array, series: Series, colour: str) -> None:
    axes.plot(t, series.distance, color=colour, label="from the body to the obstacle's middle")
    if series.obstacle is not None:
        axes.axhline(series.obstacle[2], color=PAPER, linestyle="--", label="the obstacle's radius")
    axes.set(ylabel="distance [m]", title="distance to the obstacle")
    axes.set_ylim(bottom=0.0)
    legend_above(axes, columns=1)


def _draw_angles(axes: Axes, t: Array, series: Series, cone_deg: tuple[float, float], colour: str) -> None:
    angles = np.degrees(np.array(series.angles))
    axes.plot(t, angles[:, 0], color=colour, label="left edge")
    axes.plot(t, angles[:, 1], color=PAPER, linestyle="--", label="right edge")
    for bound, style, text in zip(cone_deg, (":", "-."), ("inner bound", "outer bound"), strict=True):
        for sign in (1.0, -1.0):
            axes.axhline(
                sign * bound, color=PAPER, linestyle=style, linewidth=1.3, label=text if sign > 0 else None
            )
    axes.set(ylabel="angle [deg]", title="line of sight")
    top = 1.1 * max(cone_deg[1], float(np.abs(angles).max()))
    axes.set_ylim(-top, top)
    legend_above(axes)


def _draw_auxiliary(axes: Axes, t: Array, series: Series, colour: str) -> None:
    axes.set(title="auxiliary states")
    if not any(np.any(values) for values in series.auxiliary.values()):
        axes.text(0.5, 0.5, "this law has none", transform=axes.transAxes, ha="center", color=FAINT)
        axes.set_yticks([])
        return
    lengths = any("[m]" in name for name in series.auxiliary)
    axes.set_ylabel("auxiliary state [-] or [m]" if lengths else "auxiliary state [-]")
    every = max(1, len(t) // 9)
    looks = zip((colour, PAPER, FAINT), ("", "o", "s"), series.auxiliary.items(), strict=False)
    for k, (ink, marker, (name, values)) in enumerate(looks):
        for axis, style in ((0, "-"), (1, "--")):
            axes.plot(
                t,
                np.array(values)[:, axis],
                color=ink,
                linestyle=style,
                marker=marker,
                markevery=(k * every // 3, every),
                label=f"{name}, {'xy'[axis]}",
            )
    legend_above(axes)
