"""The paper's figures beside ours: every trial a dot, the median and the 95th percentile drawn in."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from msrr_bullet.reproduce.measures import MEASURES, Measure
from msrr_bullet.reproduce.model import Row, Table
from msrr_bullet.reproduce.settings import STANDARD
from msrr_bullet.reproduce.style import FAINT, PAPER, look, new_figure, save, styled
from msrr_bullet.streams import stream

#: Dots per row: more would be a blot.
_MOST = 200


def draw_strips(table: Table, path: Path) -> Path:
    """Draw every measure of a table, one panel each."""
    shown = [m for m in MEASURES[table.phase] if any(m.key in r.measures for r in table.rows)]
    # What is asked is asked on unicycles under the standard setting.
    asked = table.plant == "unicycle" and table.setting == STANDARD.name
    with styled():
        columns = 2
        lines = -(-len(shown) // columns)
        figure = new_figure(15.0, 0.9 + lines * (1.2 + 0.52 * len(table.rows)))
        axes = np.atleast_1d(figure.subplots(lines, columns, squeeze=False)).ravel()
        for place, what in zip(axes, shown, strict=False):
            _strip(place, table.rows, what, asked)
        for place in axes[len(shown) :]:
            place.set_axis_off()
        handles = [
            Line2D([], [], color=FAINT, marker="o", linestyle="", markersize=5, label="a trial"),
            Line2D([], [], color=FAINT, linewidth=4.0, label="median"),
            Line2D([], [], color=FAINT, linewidth=2.0, label="95th percentile"),
            Line2D([], [], color=PAPER, linestyle="-", label="paper, C1"),
            Line2D([], [], color=PAPER, linestyle="--", label="paper, C2"),
        ]
        if asked:
            text = "asked of C1's 95th percentile"
            handles.append(Line2D([], [], color=PAPER, linestyle=":", label=text))
        figure.legend(handles=handles, loc="outside lower center", ncols=6, frameon=False)
        figure.suptitle(f"{table.phase} phase, {table.plant}, {table.setting}", fontsize=16)
        return save(figure, path)


def _strip(axes: Axes, rows: Sequence[Row], what: Measure, asked: bool) -> None:
    jitter = stream(0, f"jitter/{what.key}")
    right = 0.0
    for i, row in enumerate(rows):
        found = row.measures.get(what.key)
        if found is None or not found.count:
            axes.text(0.01, i, "no trial has one", transform=axes.get_yaxis_transform(), va="center")
            continue
        colour, marker = look(row.controller)
        values = what.scale * np.array(found.values[:_MOST])
        across = i + jitter.uniform(-0.22, 0.22, len(values))
        axes.scatter(values, across, s=16, color=colour, marker=marker, alpha=0.35, linewidths=0)
        median, high = (what.scale * q for q in (found.quantiles.p50 or 0.0, found.quantiles.p95 or 0.0))
        axes.plot([median, median], [i - 0.36, i + 0.36], color=colour, linewidth=4.0)
        axes.plot([high, high], [i - 0.26, i + 0.26], color=colour, linewidth=2.0)
        right = max(right, what.scale * float(np.quantile(found.values, 0.99)))
    for value, style in ((what.paper_c1, "-"), (what.paper_c2, "--")):
        if value is not None:
            axes.axvline(what.scale * value, color=PAPER, linestyle=style, linewidth=1.6)
            right = max(right, what.scale * value)
    if asked and what.asked_p95 is not None:
        axes.axvline(what.scale * what.asked_p95, color=PAPER, linestyle=":", linewidth=1.6)
    axes.set_yticks(range(len(rows)), [r.label for r in rows])
    axes.set_ylim(len(rows) - 0.45, -0.55)
    axes.set_xlim(0.0, 1.12 * right if right else 1.0)
    axes.set_xlabel(f"{what.label} [{what.unit}]")
    axes.grid(visible=False, axis="y")
