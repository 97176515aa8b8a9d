"""What each part of C1 is worth: a panel for each measure, a group of bars for each setting."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Patch

from msrr_bullet.reproduce.report.intervals import Estimate, of_quantile, of_rate
from msrr_bullet.reproduce.report.style import PAPER, SMALL, look, new_figure, save, styled
from msrr_bullet.studies.measures import MEASURES, Measure
from msrr_bullet.studies.model import Ablations, Row

#: C1 is C1's colour; what it is without a part is paler, and told apart by hatches.
_FACES = (look("c1")[0], "#ffffff", "#a9cfe6", "#e4f0f8")
_HATCHES = ("", "//", "..", "xx")

Value = Callable[[Row], Estimate | None]


def draw_ablations(found: Ablations, path: Path) -> Path:
    """Draw failures, views lost and the 95th percentile of every measure, with their intervals."""
    measures = [m for m in MEASURES[found.phase] if m.paper_c1 is not None]
    shares = {
        "did not dock [%]" if found.phase == "close" else "hit the obstacle [%]": partial(_share, "success")
    }
    if found.phase == "close":
        shares["target left the cone [%]"] = partial(_share, "in_cone")
    with styled():
        figure = new_figure(16.0, 1.2 + 3.5 * (len(shares) + len(measures)))
        grid = figure.subplots(len(shares) + len(measures), 1)
        for axes, (text, value) in zip(grid, shares.items(), strict=False):
            _bars(axes, found, value, text)
            axes.set_ylim(0.0, 118.0)
            axes.set_yticks(range(0, 101, 20))
        for axes, what in zip(grid[len(shares) :], measures, strict=True):
            _bars(axes, found, partial(_high, what), f"{what.label}\n95th percentile [{what.unit}]")
            paper = what.scale * (what.paper_c1 or 0.0)
            axes.axhline(paper, color=PAPER, linewidth=1.8, zorder=1.5)
            axes.annotate(
                f"paper:\n{paper:g} {what.unit}",
                (1.005, paper),
                xycoords=("axes fraction", "data"),
                va="center",
                fontsize=SMALL,
                annotation_clip=False,
            )
            axes.set_ylim(0.0, 1.15 * axes.get_ylim()[1])
        handles = [
            Patch(facecolor=_FACES[k], hatch=_HATCHES[k], edgecolor=_FACES[0], label=row.label)
            for k, row in enumerate(found.tables[0].rows)
        ]
        figure.legend(handles=handles, loc="outside lower center", ncols=4, frameon=False)
        note = "whiskers: 95 % intervals" + ("; hit: through the obstacle" if found.phase == "long" else "")
        figure.suptitle(f"C1 without one of its parts, {found.phase} phase, unicycle ({note})")
        return save(figure, path)


def _high(what: Measure, row: Row) -> Estimate | None:
    found = of_quantile(row.measures[what.key], 0.95)
    # One that drives through the obstacle swings out little and recovers at once; that is no merit.
    if found is None or (what in MEASURES["long"] and row.success.rate < 0.5):
        return None
    return Estimate(what.scale * found.value, what.scale * found.low, what.scale * found.high)


def _share(which: str, row: Row) -> Estimate | None:
    rate = row.success if which == "success" else row.in_cone
    if rate is None:
        return None
    kept = of_rate(rate)
    return Estimate(100.0 * (1.0 - kept.value), 100.0 * (1.0 - kept.high), 100.0 * (1.0 - kept.low))


def _bars(axes: Axes, found: Ablations, value: Value, label: str) -> None:
    labels = [r.label for r in found.tables[0].rows]
    width = 0.9 / len(labels)
    for k in range(len(labels)):
        for group, table in enumerate(found.tables):
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
    axes.set_xticks(range(len(found.tables)), [t.setting for t in found.tables])
    axes.set_xlim(-0.5, len(found.tables) - 0.5)
    axes.grid(visible=False, axis="x")
    axes.set_ylabel(label)


def _short(value: float) -> str:
    """Return a number of two digits, or three beyond 100."""
    if value >= 9.95 or value == 0.0:
        return f"{value:.0f}"
    return f"{value:.1f}" if value >= 0.95 else f"{value:.2f}"
