"""Plots of the page of a finished run: errors, line of sight, velocities and clearance over time."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from msrr_bullet.timeline.palette import BELIEF, CLEARANCE, GREEN, PATH, PLAN, VERMILLION, css
from msrr_bullet.timeline.series import TrialSeries
from msrr_bullet.timeline.snapshot import Snapshot, moving_units, of_unit
from msrr_scenes.arrays import Array
from msrr_scenes.specs.scene import Scene

#: What JSON holds of a plot: title, times, curves, limits, and half of the linear part of a logarithmic axis.
Plot = dict[str, Any]
#: Range about zero that is linear on logarithmic axes: of a long approach [mm, deg], and of clearances [mm].
LINEAR_RANGE, LINEAR_CLEARANCE = 1.0, 50.0
#: Largest number of points of a curve; a longer one is thinned.
MAX_POINTS = 1500
#: Significant digits of the values, and decimal places of the times [s].
_DIGITS, _TIME_PLACES = 4, 3


def plots_of_run(scene: Scene, snapshots: Sequence[Snapshot]) -> dict[str, list[Plot]]:
    """Return the plots of every unit with a step by its name, and those of the run under an empty name."""
    plots = {}
    for unit in moving_units(snapshots):
        series = TrialSeries.of(scene, of_unit(snapshots, unit))
        plots[unit] = [_finished(plot, series.time) for plot in _unit_plots(scene, series)]
    series = TrialSeries.of(scene, snapshots)
    plots[""] = [_finished(plot, series.time) for plot in _run_plots(scene, series)]
    return {unit: [plot for plot in own if plot["curves"]] for unit, own in plots.items()}


def _unit_plots(scene: Scene, series: TrialSeries) -> Iterator[Plot]:
    asinh = LINEAR_RANGE if series.follows_path else 0.0
    lateral = series.true_port[:, 1], series.believed_port[:, 1]
    yield _plot("lateral [mm]", _both(series, *lateral, 1e3), asinh=asinh)
    yield _plot("heading [deg]", _both(series, *series.headings(), math.degrees(1.0)), asinh=asinh)
    if series.follows_path:
        yield _plot("off the path [mm]", _both(series, series.true_off_path, series.off_path, 1e3))
    sight = np.degrees(series.sight)
    los = [
        _curve(f"{side} edge, {how}", np.where(shown, sight[:, i], np.nan), colour, dash=how == "predicted")
        for how, shown in (("seen", series.seen), ("predicted", ~series.seen))
        for i, side, colour in ((0, "left", GREEN), (1, "right", VERMILLION))
    ]
    cone = [("inner", scene.los.inner_deg), ("outer", scene.los.outer_deg)]
    limits = [(f"{name} cone", sign * value) for name, value in cone for sign in (1.0, -1.0)]
    yield _plot("line of sight [deg]", los, limits)
    for i, title, limit in (
        (0, "v [m/s]", scene.limits.v_max_mps),
        (1, "w [rad/s]", scene.limits.w_max_radps),
    ):
        motion = [
            _curve("driven", series.driven[:, i], PATH, width=2.0),
            _curve("commanded", series.commanded[:, i], PLAN, stepped=True),
        ]
        yield _plot(title, motion, [("limit", limit), ("limit", -limit)])


def _run_plots(scene: Scene, series: TrialSeries) -> Iterator[Plot]:
    guard = scene.control.guard
    limits = [("judge", 1e3 * scene.judge.min_clearance_m)]
    if guard.enabled and scene.cameras.overhead is not None:  # it judges by what that camera shows
        limits += [("monitor slows", 1e3 * guard.slow_m), ("monitor stops", 1e3 * guard.stop_m)]
    curve = _curve("smallest clearance", 1e3 * series.clearance, CLEARANCE, width=2.0)
    yield _plot("clearance [mm]", [curve], limits, asinh=LINEAR_CLEARANCE)


def _both(series: TrialSeries, truth: Array, believed: Array, scale: float) -> list[dict[str, Any]]:
    """Return the curves of truth and belief, the thin one of the belief on the thick one of the truth."""
    return [
        _curve("truth", scale * series.with_gaps(truth), PATH, width=2.5),
        _curve("believed", scale * series.with_gaps(believed), BELIEF, width=1.2),
    ]


def _curve(
    name: str, values: Array, colour: int, *, width: float = 1.2, dash: bool = False, stepped: bool = False
) -> dict[str, Any]:
    return {
        "name": name,
        "values": values,
        "colour": css(colour),
        "width": width,
        "dash": dash,
        "stepped": stepped,
    }


def _plot(
    title: str,
    curves: list[dict[str, Any]],
    limits: Sequence[tuple[str, float]] = (),
    *,
    asinh: float = 0.0,
) -> Plot:
    named = [{"name": name, "value": float(f"{value:.{_DIGITS}g}")} for name, value in limits]
    return {"title": title, "curves": curves, "limits": named, "asinh": asinh}


def _finished(plot: Plot, times: Array) -> Plot:
    """Return a plot as JSON holds it: thinned, rounded, without curves of which nothing is known."""
    thin = slice(None, None, -(-len(times) // MAX_POINTS))
    curves = [curve for curve in plot["curves"] if np.isfinite(curve["values"]).any()]
    return {
        **plot,
        "times": [round(t, _TIME_PLACES) for t in times[thin].tolist()],
        "curves": [{**curve, "values": _rounded(curve["values"][thin])} for curve in curves],
    }


def _rounded(values: Array) -> list[float | None]:
    return [float(f"{value:.{_DIGITS}g}") if math.isfinite(value) else None for value in values.tolist()]
