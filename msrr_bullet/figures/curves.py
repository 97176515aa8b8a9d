"""Curves over time: one function for each pair of axes, and what all of them have in common."""

from __future__ import annotations

import math
from itertools import groupby

import numpy as np
from matplotlib.axes import Axes

from msrr_bullet.timeline.palette import (
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
from msrr_bullet.timeline.series import Series
from msrr_scenes.specs.plan import GuardSpec, JudgeSpec
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.vehicle import LimitsSpec

#: Below these the scales of a trial that begins far away are linear, above logarithmic [mm], [deg].
FINE_MM, FINE_DEG = 1.0, 1.0
#: The same for clearances [m].
FINE_M = 0.1
#: A phase shorter than this share of the trial is told by its colour alone: a name needs room.
NAMED_SHARE = 0.06


def lateral(axes: Axes, series: Series) -> None:
    """Draw the lateral offset of the port from the axis of the dock frame."""
    _truth_and_belief(axes, series, 1, 1e3, "lateral [mm]")
    _widen(axes, series, FINE_MM)
    axes.legend(loc="best", fontsize=8)


def yaw(axes: Axes, series: Series) -> None:
    """Draw the heading in the dock frame."""
    _truth_and_belief(axes, series, 2, math.degrees(1.0), "yaw [deg]")
    _widen(axes, series, FINE_DEG)


def gap(axes: Axes, series: Series) -> None:
    """Draw the distance between the faces."""
    _truth_and_belief(axes, series, 0, 1.0, "gap to the port [m]")


def _widen(axes: Axes, series: Series, fine: float) -> None:
    """Show both what is decimetres off at the start and what is tenths of a millimetre off at the port."""
    if series.assembles:
        axes.set_yscale("symlog", linthresh=fine, linscale=1.0)
        axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}")


def _truth_and_belief(axes: Axes, series: Series, column: int, scale: float, label: str) -> None:
    # Belief lies thin on top of truth: both show where they agree.
    for values, colour, width, name in (
        (series.true_port, PATH, 2.6, "truth"),
        (series.believed_port, BELIEF, 1.0, "believed"),
    ):
        curve = scale * series.torn(values)[:, column]
        axes.plot(series.time, curve, color=css(colour), linewidth=width, label=name)
    axes.axhline(0.0, color=css(DARK), linewidth=0.6)
    axes.set_ylabel(label)
    prepare(axes)


def off_path(axes: Axes, series: Series) -> None:
    """Draw how far the controlled point is from where it should be on the path."""
    for values, colour, width, name in (
        (series.truly_off_path, PATH, 2.6, "truth"),
        (series.off_path, BELIEF, 1.0, "believed"),
    ):
        axes.plot(series.time, 1e3 * values, color=css(colour), linewidth=width, label=name)
    if series.avoiding.any():
        top = max(1.0, 1e3 * float(np.nanmax([series.off_path, series.truly_off_path])))
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
    prepare(axes)


def speed(axes: Axes, series: Series, limits: LimitsSpec) -> None:
    """Draw forward velocity, commanded and driven."""
    _motion(axes, series, 0, "v [m/s]", limits.v_max_mps)


def turn_rate(axes: Axes, series: Series, limits: LimitsSpec) -> None:
    """Draw turn rate, commanded and driven."""
    _motion(axes, series, 1, "w [rad/s]", limits.w_max_radps)


def _motion(axes: Axes, series: Series, column: int, label: str, limit: float) -> None:
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
    prepare(axes)


def clearance(axes: Axes, series: Series, guard: GuardSpec, judge: JudgeSpec) -> None:
    """Draw the smallest clearance of all bodies, and the distances of guard and judge."""
    apart = np.where(series.docking_pair, np.nan, series.clearance)
    docking = np.where(series.docking_pair, series.clearance, np.nan)
    axes.plot(series.time, apart, color=css(CLEARANCE), linewidth=2.0, label="smallest clearance (truth)")
    axes.plot(series.time, docking, ":", color=css(CLEARANCE), linewidth=1.6, label="of the docking pair")
    bounds = [(judge.min_clearance_m, "-", "judge")]
    if guard.enabled:
        bounds += [(guard.slow_m, "--", "guard slows"), (guard.stop_m, "-.", "guard stops")]
    for value, style, _ in bounds:
        axes.axhline(value, color=css(VERMILLION), linestyle=style, linewidth=0.9)
    told = ", ".join(f"{name} {1e3 * value:.0f} mm" for value, _, name in sorted(bounds, reverse=True))
    axes.set_title(told, fontsize=7, loc="right", pad=2)
    axes.set_ylabel("clearance [m]")
    low = float(np.nanmin(series.clearance, initial=0.0))
    high = float(np.nanmax(series.clearance, initial=0.0))
    axes.set_ylim(low, 1.3 * max(high, FINE_M))
    if high > 3.0 * FINE_M:
        axes.set_yscale("symlog", linthresh=FINE_M, linscale=1.5)
        axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.legend(loc="best", fontsize=8)
    prepare(axes)


def sight(axes: Axes, series: Series, scene: Scene) -> None:
    """Draw the line-of-sight angles and the cone in which they have to stay."""
    for shown, style, how in ((series.seen, "-", "seen"), (~series.seen, ":", "predicted")):
        angles = np.where(shown[:, None], np.degrees(series.sight), np.nan)
        for column, colour, side in ((0, GREEN, "left edge"), (1, VERMILLION, "right edge")):
            axes.plot(series.time, angles[:, column], style, color=css(colour), label=f"{side}, {how}")
    half_fov = math.degrees(scene.cameras.onboard.pinhole.half_fov)
    for limit, style, name in (
        (scene.los.inner_deg, "--", "inner"),
        (scene.los.outer_deg, "-.", "outer"),
        (half_fov, "-", "field of view"),
    ):
        for sign in (1.0, -1.0):
            axes.axhline(sign * limit, color=css(DARK), linestyle=style, linewidth=0.8)
        axes.annotate(
            name, (1.0, limit), xycoords=("axes fraction", "data"), ha="right", va="bottom", fontsize=7
        )
    axes.set(ylabel="edge angle [deg]", ylim=(-1.2 * half_fov, 1.2 * half_fov))
    prepare(axes)
    axes.legend(loc="lower left", fontsize=7, ncols=2)


def prepare(axes: Axes) -> None:
    """Give axes their grid and the size of their figures."""
    axes.grid(True, color="#e4e7ea", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=8)


def shade_phases(axes: Axes, series: Series, named: bool) -> None:
    """Colour the background by phase; ``named`` writes the names of the longer ones above."""
    times = series.time
    end = float(times[-1]) or 1.0
    start = 0
    for phase, run in groupby(series.phases):
        stop = start + len(list(run))
        t0, t1 = float(times[start]), float(times[min(stop, len(times) - 1)])
        start = stop
        if phase is None:
            continue
        axes.axvspan(t0, t1, color=css(PHASE_COLOURS[phase]), linewidth=0.0, alpha=0.6, zorder=0)
        if named and t1 - t0 > NAMED_SHARE * end:
            axes.annotate(
                phase.value.replace("_", " "),
                (0.5 * (t0 + t1), 1.02),
                xycoords=("data", "axes fraction"),
                ha="center",
                fontsize=7,
            )
    axes.set_xlim(float(times[0]), end)
