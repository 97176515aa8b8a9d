"""Curves over time: one function for each kind of axes, and the layout of several of them in a figure."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec

from msrr_bullet.figures.plots.axes import add_grid
from msrr_bullet.timeline.palette import (
    ALARM,
    BELIEF,
    CLEARANCE,
    DARK,
    GREEN,
    OBSTACLE,
    PATH,
    PHASE_COLOURS,
    PLAN,
    VERMILLION,
    css,
)
from msrr_bullet.timeline.series import TrialSeries, phase_spans
from msrr_bullet.timeline.snapshot import phase_name
from msrr_scenes.arrays import Array
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.vehicle import LimitsSpec

#: Limits of the linear range of logarithmic scales: lateral offset [mm] and heading [deg], and clearance [m].
LINEAR, LINEAR_M = 1.0, 0.1
#: Values that a logarithmic scale of the clearance names [m]: powers of ten alone would name none above 0.1.
_CLEARANCE_TICKS_M = (0.0, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0)
#: Smallest duration of a phase whose name is written, as a fraction of the trial.
MIN_NAMED_FRACTION = 0.06


def lateral(axes: Axes, series: TrialSeries) -> None:
    """Draw the lateral offset of the port from the axis of the dock frame."""
    _truth_and_belief(axes, series, 1, 1e3, "lateral [mm]")
    _use_log_scale(axes, series)
    if axes.get_legend_handles_labels()[0]:  # a recording may show no target
        axes.legend(loc="best", fontsize=8)


def yaw(axes: Axes, series: TrialSeries) -> None:
    """Draw the heading in the dock frame, as continuous lines also where it passes 180 deg."""
    _truth_and_belief(axes, series, 2, math.degrees(1.0), "yaw [deg]", series.headings())
    _use_log_scale(axes, series)


def gap(axes: Axes, series: TrialSeries) -> None:
    """Draw the distance between the faces."""
    _truth_and_belief(axes, series, 0, 1.0, "gap to the port [m]")


def _use_log_scale(axes: Axes, series: TrialSeries) -> None:
    """Show both decimetres at the start of a long approach and tenths of a millimetre at the port."""
    if series.follows_path:
        axes.set_yscale("symlog", linthresh=LINEAR, linscale=1.0)
        axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}")


def _truth_and_belief(
    axes: Axes,
    series: TrialSeries,
    column: int,
    scale: float,
    label: str,
    curves: tuple[Array, Array] | None = None,
) -> None:
    """Draw a column of the series of the port; ``curves`` are its true and believed values, if others."""
    truth, believed = curves or (series.true_port[:, column], series.believed_port[:, column])
    recorded = not np.isfinite(truth).any() and bool(np.isfinite(believed).any())
    if recorded:  # there it matters how sure the estimate is
        two_sigma = 2.0 * series.port_sigma[:, column]
        low, high = (scale * series.with_gaps(believed + k * two_sigma) for k in (-1.0, 1.0))
        axes.fill_between(
            series.time, low, high, color=css(BELIEF), alpha=0.25, linewidth=0.0, label="believed, ± 2 sigma"
        )
    # The thin line of the belief lies on the thick line of the truth, so that both show where they agree.
    for values, colour, width, name in (
        (truth, PATH, 2.6, "truth"),
        (believed, BELIEF, 1.0, "believed"),
    ):
        if np.isfinite(values).any():  # a recording has no truth
            curve = scale * series.with_gaps(values)
            axes.plot(series.time, curve, color=css(colour), linewidth=width, label=name)
    axes.axhline(0.0, color=css(DARK), linewidth=0.6)
    axes.set_ylabel(label)
    add_grid(axes)


def off_path(axes: Axes, series: TrialSeries) -> None:
    """Draw the distance of the controlled point from the desired point on the path."""
    for values, colour, width, name in (
        (series.true_off_path, PATH, 2.6, "truth"),
        (series.off_path, BELIEF, 1.0, "believed"),
    ):
        axes.plot(series.time, 1e3 * values, color=css(colour), linewidth=width, label=name)
    if series.avoiding.any():
        top = max(1.0, 1e3 * float(np.nanmax([series.off_path, series.true_off_path])))
        axes.fill_between(
            series.time,
            0.0,
            1.05 * top,
            where=list(series.avoiding),
            color=css(OBSTACLE),
            alpha=0.35,
            linewidth=0.0,
            label="a wall stands",
        )
    axes.set_ylabel("off the path [mm]")
    axes.set_ylim(bottom=0.0)
    axes.legend(loc="upper right", fontsize=8)
    add_grid(axes)


def speed(axes: Axes, series: TrialSeries, limits: LimitsSpec) -> None:
    """Draw forward velocity, commanded and driven."""
    _motion(axes, series, 0, "v [m/s]", limits.v_max_mps)


def turn_rate(axes: Axes, series: TrialSeries, limits: LimitsSpec) -> None:
    """Draw turn rate, commanded and driven."""
    _motion(axes, series, 1, "w [rad/s]", limits.w_max_radps)


def _motion(axes: Axes, series: TrialSeries, column: int, label: str, limit: float) -> None:
    axes.plot(series.time, series.driven[:, column], color=css(PATH), linewidth=2.2, label="driven (truth)")
    axes.step(
        series.time,
        series.commanded[:, column],
        where="post",
        color=css(PLAN),
        linewidth=1.0,
        label="commanded",
    )
    for sign in (1.0, -1.0):
        axes.axhline(sign * limit, color=css(DARK), linestyle="--", linewidth=0.8)
    axes.axhline(0.0, color=css(DARK), linewidth=0.6)
    used = np.nanmax(np.abs([series.driven[:, column], series.commanded[:, column]]), initial=0.25 * limit)
    axes.set(ylabel=label, ylim=(-1.15 * used, 1.15 * used))
    axes.legend(loc="best", fontsize=8)
    add_grid(axes)


def clearance(axes: Axes, series: TrialSeries, scene: Scene) -> None:
    """Draw the smallest clearance, and the limits of the judge and of a collision monitor if there is one."""
    guard = scene.control.guard
    alone = bool(np.isnan(series.clearance).all())
    label = "no two bodies that may not touch" if alone else "smallest clearance of all bodies (truth)"
    width = 0.0 if alone else 2.0
    axes.plot(series.time, series.clearance, color=css(CLEARANCE), linewidth=width, label=label)
    bounds = [(scene.judge.min_clearance_m, "-", "judge")]
    if guard.enabled and scene.cameras.overhead is not None:  # it judges by what that camera shows
        bounds += [
            (guard.slow_m, "--", "collision monitor slows"),
            (guard.stop_m, "-.", "collision monitor stops"),
        ]
    for value, style, _ in bounds:
        axes.axhline(value, color=css(VERMILLION), linestyle=style, linewidth=0.9)
    limits = ", ".join(f"{name} {1e3 * value:.0f} mm" for value, _, name in sorted(bounds, reverse=True))
    axes.set_title(limits, fontsize=7, loc="right", pad=2)
    axes.set_ylabel("clearance [m]")
    low = float(np.nanmin(series.clearance, initial=0.0))
    high = float(np.nanmax(series.clearance, initial=0.0))
    axes.set_ylim(low, 1.3 * max(high, LINEAR_M))
    if high > 3.0 * LINEAR_M:
        axes.set_yscale("symlog", linthresh=LINEAR_M, linscale=1.5)
        axes.set_yticks([tick for tick in _CLEARANCE_TICKS_M if tick <= 1.3 * high])
        axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.legend(loc="best", fontsize=8)
    add_grid(axes)


def sight(axes: Axes, series: TrialSeries, scene: Scene) -> None:
    """Draw the line-of-sight angles, and the cone that has to contain them."""
    for shown, style, how in ((series.seen, "-", "seen"), (~series.seen, ":", "predicted")):
        angles = np.where(shown[:, None], np.degrees(series.sight), np.nan)
        for column, colour, side in ((0, GREEN, "left"), (1, VERMILLION, "right")):
            axes.plot(series.time, angles[:, column], style, color=css(colour), label=f"{side}, {how}")
    half_fov = math.degrees(scene.cameras.onboard.lens.half_fov)
    bounds = (
        (half_fov, "-", "field of view"),
        (scene.los.outer_deg, "-.", "outer"),
        (scene.los.inner_deg, "--", "inner"),
    )
    for limit, style, _ in bounds:
        for sign in (1.0, -1.0):
            axes.axhline(sign * limit, color=css(DARK), linestyle=style, linewidth=0.8)
    # Beside their lines the names of two that are near each other would lie on each other.
    limits = ", ".join(f"{name} {limit:.3g} deg" for limit, _, name in bounds)
    axes.set_title(limits, fontsize=7, loc="right", pad=2)
    # The legend is one row below the field of view, where no edge is seen.
    axes.set(ylabel="edge angle [deg]", ylim=(-1.5 * half_fov, 1.2 * half_fov))
    add_grid(axes)
    axes.legend(loc="lower left", fontsize=7, ncols=4, columnspacing=1.0, handlelength=1.5)


def _shade_phases(axes: Axes, series: TrialSeries, named: bool) -> None:
    """Colour the background by phase, and optionally write the names of the longer phases above."""
    times = series.time.tolist()
    duration = times[-1] - times[0] or 1.0
    for phase, start, end in phase_spans(times, series.phases):
        axes.axvspan(start, end, color=css(PHASE_COLOURS[phase]), linewidth=0.0, alpha=0.6, zorder=0)
        if named and end - start > MIN_NAMED_FRACTION * duration:
            position, coordinates = (0.5 * (start + end), 1.02), ("data", "axes fraction")
            axes.annotate(phase_name(phase), position, xycoords=coordinates, ha="center", fontsize=7)
    axes.set_xlim(times[0], times[0] + duration)


def _mark_monitor(axes: Axes, series: TrialSeries) -> None:
    """Mark the times at which the collision monitor slowed or stopped the unit, along the lower edge."""
    for times, colour, name in ((series.limited, PLAN, "slows"), (series.stopped, ALARM, "stops")):
        if times.any():
            axes.fill_between(
                series.time,
                0.0,
                0.06,
                where=list(times),
                step="post",
                transform=axes.get_xaxis_transform(),
                color=css(colour),
                linewidth=0.0,
                label=f"collision monitor {name}",
            )
            axes.legend(loc="upper right", fontsize=8)


def draw_stack(
    figure: Figure, region: SubplotSpec, series: TrialSeries, curves: Sequence[Callable[[Axes], None]]
) -> None:
    """Draw axes one above the other with a common axis of time.

    The phases of the trial are the background of all axes, and each function draws one, from top to bottom.
    """
    rows = region.subgridspec(len(curves), 1)
    lowest = figure.add_subplot(rows[len(curves) - 1])
    stack = [*(figure.add_subplot(rows[i], sharex=lowest) for i in range(len(curves) - 1)), lowest]
    for axes, draw in zip(stack, curves, strict=True):
        draw(axes)
        if axes is stack[0]:
            _mark_monitor(axes, series)
        _shade_phases(axes, series, named=axes is stack[0])
        axes.yaxis.set_label_coords(-0.085, 0.5)
        axes.tick_params(labelbottom=axes is lowest)
    lowest.set_xlabel("time [s]")


def set_title(figure: Figure, scene: Scene, headline: str, unit: str | None = None) -> None:
    """Write the scene's name, a headline, such as the outcome, and the unit of the curves above a figure."""
    text = ", ".join(filter(None, (headline, f"curves of unit {unit}" if unit else "")))
    figure.suptitle(f"{scene.name}{f': {text}' if text else ''}", fontsize=13, fontweight="bold")
