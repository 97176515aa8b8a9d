"""The effect of each part of C1: a panel for each measure, a group of bars for each setting."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Patch

from msrr_bullet.figures.plots.style import PAPER, SMALL, controller_style, new_figure, save, styled
from msrr_bullet.statistics import Rate, quantile, quantile_interval
from msrr_bullet.studies.measures import MEASURES, PATH_FOLLOWING, Measure
from msrr_bullet.studies.model import Ablations, Measured, Row

#: The complete C1 has C1's colour; without a part it is paler, and hatches tell the variants apart.
_FACES = (controller_style("c1")[0], "#ffffff", "#a9cfe6", "#e4f0f8")
_HATCHES = ("", "//", "..", "xx")


@dataclass(frozen=True, slots=True)
class Estimate:
    """A value and its 95 % interval.

    A bound is infinite where there are too few trials to bound the value. All three may be infinite where a
    timed event never happened in too many trials.
    """

    value: float
    low: float
    high: float


def estimate_quantile(measured: Measured, q: float) -> Estimate | None:
    """Return a quantile with its interval; None without values."""
    if not measured.values:
        return None
    low, high = quantile_interval(measured.values, q)
    return Estimate(
        quantile(measured.values, q), -math.inf if low is None else low, math.inf if high is None else high
    )


Value = Callable[[Row], Estimate | None]


def draw_ablations(ablations: Ablations, path: Path) -> Path:
    """Draw the rates of failures and lost views and the 95th percentile of every measure, with intervals."""
    measures = [m for m in MEASURES[ablations.phase] if m.paper_c1 is not None]
    shares = {
        "did not dock [%]" if ablations.phase == "close" else "hit the obstacle [%]": partial(
            _failed_percent, "success"
        )
    }
    if ablations.phase == "close":
        shares["target left the cone [%]"] = partial(_failed_percent, "in_cone")
    with styled():
        figure = new_figure(16.0, 1.2 + 3.5 * (len(shares) + len(measures)))
        grid = figure.subplots(len(shares) + len(measures), 1)
        for axes, (text, value) in zip(grid, shares.items(), strict=False):
            _bars(axes, ablations, value, text)
            axes.set_ylim(0.0, 118.0)
            axes.set_yticks(range(0, 101, 20))
        for axes, measure in zip(grid[len(shares) :], measures, strict=True):
            label = f"{measure.label}\n95th percentile [{measure.unit}]"
            _bars(axes, ablations, partial(_scaled_p95, measure), label)
            paper = measure.scale * (measure.paper_c1 or 0.0)
            axes.axhline(paper, color=PAPER, linewidth=1.8, zorder=1.5)
            axes.annotate(
                f"paper:\n{paper:g} {measure.unit}",
                (1.005, paper),
                xycoords=("axes fraction", "data"),
                va="center",
                fontsize=SMALL,
                annotation_clip=False,
            )
            axes.set_ylim(0.0, 1.15 * axes.get_ylim()[1])
        handles = [
            Patch(facecolor=_FACES[k], hatch=_HATCHES[k], edgecolor=_FACES[0], label=row.label)
            for k, row in enumerate(ablations.tables[0].rows)
        ]
        figure.legend(handles=handles, loc="outside lower center", ncols=4, frameon=False)
        note = whisker_note(ablations, measures)
        figure.suptitle(f"C1 without one of its parts, {ablations.phase} phase, unicycle\n{note}")
        return save(figure, path)


def whisker_note(ablations: Ablations, measures: Sequence[Measure]) -> str:
    """Return what the figure's whiskers and words mean."""
    rows = [row for table in ablations.tables for row in table.rows]
    shown = [estimate for measure in measures for row in rows if (estimate := _scaled_p95(measure, row))]
    note = "whiskers: 95 % intervals"
    if any(np.isfinite(estimate.value) and not np.isfinite(estimate.high) for estimate in shown):
        note += "; that of a percentile with no part above its bar has no upper bound"
    return note + ("; hit: through the obstacle" if ablations.phase == "long" else "")


def _scaled_p95(measure: Measure, row: Row) -> Estimate | None:
    """Return the 95th percentile of a measure in its unit.

    It is None without values, and for the path following of a law that drives through the obstacle in more
    than half of the trials: such a law swings out little and recovers at once, which is no merit.
    """
    p95 = estimate_quantile(row.measures[measure.key], 0.95)
    if p95 is None or (measure in PATH_FOLLOWING and row.success.rate < 0.5):
        return None
    return Estimate(measure.scale * p95.value, measure.scale * p95.low, measure.scale * p95.high)


def _failed_percent(name: Literal["success", "in_cone"], row: Row) -> Estimate | None:
    rate: Rate | None = getattr(row, name)
    if rate is None:
        return None
    return Estimate(100.0 * (1.0 - rate.rate), 100.0 * (1.0 - rate.high), 100.0 * (1.0 - rate.low))


def _bars(axes: Axes, ablations: Ablations, value: Value, label: str) -> None:
    labels = [r.label for r in ablations.tables[0].rows]
    width = 0.9 / len(labels)
    for k in range(len(labels)):
        for group, table in enumerate(ablations.tables):
            estimate, x = value(table.rows[k]), group + (k - 0.5 * (len(labels) - 1)) * width
            if estimate is None:
                axes.text(x, 0.0, "hit", ha="center", va="bottom", fontsize=SMALL, color=_FACES[0])
                continue
            if not np.isfinite(estimate.value):
                axes.text(x, 0.0, "never", ha="center", va="bottom", fontsize=SMALL, color=_FACES[0])
                continue
            top = estimate.high if np.isfinite(estimate.high) else estimate.value
            axes.bar(
                x,
                estimate.value,
                0.86 * width,
                color=_FACES[k],
                hatch=_HATCHES[k],
                edgecolor=_FACES[0],
                linewidth=1.2,
                yerr=[[estimate.value - max(estimate.low, 0.0)], [top - estimate.value]],
                error_kw={"ecolor": PAPER, "elinewidth": 1.6, "capsize": 3.0},
            )
            axes.annotate(
                _short(estimate.value),
                (x, top),
                xytext=(0, 3),
                textcoords="offset points",
                ha="center",
                fontsize=SMALL,
                bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.5},
            )
    axes.set_xticks(range(len(ablations.tables)), [t.setting for t in ablations.tables])
    axes.set_xlim(-0.5, len(ablations.tables) - 0.5)
    axes.grid(visible=False, axis="x")
    axes.set_ylabel(label)


def _short(value: float) -> str:
    """Return a number with two digits, or with three beyond 100."""
    if value >= 9.95 or value == 0.0:
        return f"{value:.0f}"
    return f"{value:.1f}" if value >= 0.95 else f"{value:.2f}"
