"""The figures of every trial as dots, with their median and 95th percentile and the paper's figures."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from msrr_bullet.figures.plots.style import FAINT, PAPER, SMALL, controller_style, new_figure, save, styled
from msrr_bullet.statistics import Rate
from msrr_bullet.studies.measures import Measure
from msrr_bullet.studies.model import Row, Table
from msrr_bullet.studies.settings import STANDARD
from msrr_scenes.random_streams import stream

#: Largest number of dots in a row.
_MAX_DOTS = 200


def draw_strips(table: Table, path: Path) -> Path:
    """Draw every measure of a table; in the close phase also the rates of docking and of views kept."""
    shown = table.measures
    shares = any(r.in_view is not None for r in table.rows)
    # The targets are those of unicycles under the standard setting.
    has_targets = table.plant == "unicycle" and table.setting == STANDARD.name
    with styled():
        lines = -(-len(shown) // 2) + shares
        figure = new_figure(16.0, 1.2 + lines * (1.4 + 0.46 * len(table.rows)))
        axes = np.atleast_1d(figure.subplots(lines, 2, squeeze=False)).ravel()
        for panel, measure in zip(axes, shown, strict=False):
            _draw_strip(panel, table.rows, measure, has_targets)
        for panel in axes[len(shown) :]:
            panel.set_axis_off()
        if shares:
            _draw_rates(
                axes[-2], table.rows, (("docked [%], 95 % interval", [r.success for r in table.rows]),)
            )
            views = [("in view", [r.in_view for r in table.rows])]
            views.append(("in the cone", [r.in_cone for r in table.rows]))
            _draw_rates(axes[-1], table.rows, views)
        handles = [
            Line2D([], [], color=FAINT, marker="o", linestyle="", markersize=6, label="a trial"),
            Line2D([], [], color=FAINT, linewidth=4.5, label="median"),
            Line2D([], [], color=FAINT, linewidth=2.0, label="95th percentile (clearance: 5th)"),
            Line2D([], [], color=PAPER, linestyle="-", label="paper, C1"),
            Line2D([], [], color=PAPER, linestyle="--", label="paper, C2"),
        ]
        if has_targets:
            text = "target for C1's 95th percentile"
            handles.append(Line2D([], [], color=PAPER, linestyle=":", label=text))
        figure.legend(handles=handles, loc="outside lower center", ncols=6, frameon=False, columnspacing=1.2)
        figure.suptitle(f"{table.phase} phase, {table.plant}, {table.setting}")
        return save(figure, path)


def _draw_strip(axes: Axes, rows: Sequence[Row], measure: Measure, has_targets: bool) -> None:
    jitter = stream(0, f"jitter/{measure.key}")
    papers = [measure.scale * v for v in (measure.paper_c1, measure.paper_c2) if v is not None]
    found = [r.measures.get(measure.key) for r in rows]
    finite = [np.array([v for v in f.values if np.isfinite(v)]) for f in found if f is not None]
    high = [measure.scale * float(np.quantile(v, 0.99)) for v in finite if v.size]
    right = 1.18 * max([*high, *papers, 0.0]) or 1.0
    # The clearance of a trial that hit the obstacle is negative.
    left = min([measure.scale * float(v.min()) for v in finite if v.size] + [0.0])
    axes.set_xlim(1.05 * left, right)
    for i, (row, measured) in enumerate(zip(rows, found, strict=True)):
        if measured is None or not measured.count:
            white = {"facecolor": "white", "edgecolor": "none", "pad": 1.0}  # lines may be behind
            across_axes = axes.get_yaxis_transform()
            axes.text(0.01, i, "no trial has one", transform=across_axes, va="center", bbox=white)
            continue
        colour, marker = controller_style(row.controller)
        values = measure.scale * np.array(measured.values[:_MAX_DOTS])
        across = i + jitter.uniform(-0.22, 0.22, len(values))
        axes.scatter(values, across, s=20, color=colour, marker=marker, alpha=0.4, linewidths=0)
        tail = measured.p05 if measure.more_is_better else measured.quantiles.p95
        for value, half, width in ((measured.quantiles.p50, 0.38, 4.5), (tail, 0.30, 2.0)):
            x = measure.scale * (value or 0.0)
            if not np.isfinite(x):
                continue  # counted with the values beyond the axis
            axes.plot([x, x], [i - half, i + half], color=colour, linewidth=width)
        beyond = int((measure.scale * np.array(measured.values) > right).sum())
        if beyond:
            never = f", {measured.never} never" if measured.never else ""
            axes.text(
                1.0,
                i,
                f"{beyond} more{never} \N{RIGHTWARDS ARROW}",
                transform=axes.get_yaxis_transform(),
                ha="right",
                va="center",
                fontsize=SMALL,
                bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1.0},
            )
    _draw_paper_lines(axes, measure, right)
    if has_targets and measure.target_p95 is not None:
        axes.axvline(measure.scale * measure.target_p95, color=PAPER, linestyle=":", linewidth=2.0)
    _label_rows(axes, rows)
    axes.set_xlabel(f"{measure.label} [{measure.unit}]")


def _draw_paper_lines(axes: Axes, measure: Measure, right: float) -> None:
    """Draw the paper's figures and write them above; that of C1 left of its line if that of C2 is near."""
    near = (
        measure.paper_c1 is not None
        and measure.paper_c2 is not None
        and measure.scale * (measure.paper_c2 - measure.paper_c1) < 0.5 * right
    )
    sides = ("right" if near else "left", "left" if near else "right")
    styles = (("C1", measure.paper_c1, "-", sides[0]), ("C2", measure.paper_c2, "--", sides[1]))
    for name, paper, style, side in styles:
        if paper is None:
            continue
        x = measure.scale * paper
        axes.axvline(x, color=PAPER, linestyle=style, linewidth=1.8)
        axes.annotate(
            f"paper's {name}: {x:g} {measure.unit}"
            if not near or name == "C1"
            else f"{name}: {x:g} {measure.unit}",
            (x, 1.0),
            xycoords=("data", "axes fraction"),
            xytext=(3 if side == "left" else -3, 2),
            textcoords="offset points",
            ha=side,
            fontsize=SMALL,
        )


def _draw_rates(axes: Axes, rows: Sequence[Row], kinds: Sequence[tuple[str, Sequence[Rate | None]]]) -> None:
    """Draw rates with their intervals; markers of the first kind are filled, those of the second open."""
    axes.set_axis_on()
    lowest = 100.0
    for k, (_, rates) in enumerate(kinds):
        for i, (row, rate) in enumerate(zip(rows, rates, strict=True)):
            if rate is None:
                continue
            colour, marker = controller_style(row.controller)
            x, y = 100.0 * rate.rate, i + (k - 0.5 * (len(kinds) - 1)) * 0.36
            axes.errorbar(
                x,
                y,
                xerr=[[x - 100.0 * rate.low], [100.0 * rate.high - x]],
                color=colour,
                marker=marker,
                markersize=9,
                markerfacecolor=colour if k == 0 else "white",
                capsize=4,
                clip_on=False,
            )
            lowest = min(lowest, 100.0 * rate.low)
    axes.set_xlim(min(80.0, max(0.0, lowest - 2.0)), 100.0)
    _label_rows(axes, rows)
    text = kinds[0][0] if len(kinds) == 1 else "target kept in view (filled), in the cone (open) [%]"
    axes.set_xlabel(text)


def _label_rows(axes: Axes, rows: Sequence[Row]) -> None:
    axes.set_yticks(range(len(rows)), [r.label for r in rows])
    axes.set_ylim(len(rows) - 0.45, -0.55)
    axes.grid(visible=False, axis="y")
