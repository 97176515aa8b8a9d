"""What each part of C1 is worth: a panel for each measure, a group of bars for each setting."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from msrr_bullet.reproduce.measures import MEASURES, Measure
from msrr_bullet.reproduce.model import Ablations, Row
from msrr_bullet.reproduce.style import PAPER, new_figure, save, styled
from msrr_bullet.viewer.palette import BLUE, ORANGE, PURPLE, SKY, css

_COLOURS = tuple(css(c) for c in (BLUE, SKY, ORANGE, PURPLE))
_HATCHES = ("", "//", "..", "xx")


def draw_ablations(found: Ablations, path: Path) -> Path:
    """Draw failures, views lost and the 95th percentile of every measure."""
    measures = [m for m in MEASURES[found.phase] if m.paper_c1 is not None]
    shares = ["failed [%]"] + (["left the cone [%]"] if found.phase == "close" else [])
    with styled():
        figure = new_figure(16.0, 4.1 * (-(-(len(shares) + len(measures)) // 2)))
        grid = figure.subplots(-(-(len(shares) + len(measures)) // 2), 2).ravel()
        for axes, text in zip(grid, shares, strict=False):
            _bars(axes, found, partial(_share, text), text)
            axes.set_ylim(0.0, 100.0)
        for axes, what in zip(grid[len(shares) :], measures, strict=False):
            _bars(axes, found, partial(_high, what), f"{what.label}\n95th percentile [{what.unit}]")
            axes.axhline(what.scale * (what.paper_c1 or 0.0), color=PAPER, linewidth=1.6, label="paper, C1")
        for axes in grid[len(shares) + len(measures) :]:
            axes.set_axis_off()
        handles, names = grid[len(shares)].get_legend_handles_labels()
        figure.legend(handles, names, loc="outside lower center", ncols=5, frameon=False)
        figure.suptitle(f"C1 without one of its parts, {found.phase} phase, unicycle", fontsize=16)
        return save(figure, path)


def _high(what: Measure, row: Row) -> float:
    q = row.measures[what.key].quantiles.p95
    return np.nan if q is None else what.scale * q


def _share(text: str, row: Row) -> float:
    rate = row.success if text.startswith("failed") or row.in_view is None else row.in_view
    return 100.0 * (1.0 - rate.rate)


def _bars(axes: Axes, found: Ablations, value: Callable[[Row], float], label: str) -> None:
    labels = [r.label for r in found.tables[0].rows]
    width = 0.8 / len(labels)
    for k, name in enumerate(labels):
        heights = [value(table.rows[k]) for table in found.tables]
        x = np.arange(len(heights)) + (k - 0.5 * (len(labels) - 1)) * width
        axes.bar(
            x,
            heights,
            0.9 * width,
            color=_COLOURS[k],
            hatch=_HATCHES[k],
            edgecolor="white",
            linewidth=0.0,
            label=name,
        )
        for at, height in zip(x, heights, strict=True):
            text = "-" if np.isnan(height) else f"{height:.2g}" if height < 1.0 else f"{height:.3g}"
            axes.annotate(
                text,
                (at, 0.0 if np.isnan(height) else height),
                xytext=(0, 2),
                textcoords="offset points",
                ha="center",
                fontsize=10,
            )
    axes.set_xticks(range(len(found.tables)), [t.setting.replace(", ", ",\n") for t in found.tables])
    axes.grid(visible=False, axis="x")
    axes.set_ylabel(label)
