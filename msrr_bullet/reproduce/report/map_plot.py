"""Docking success over gain and total delay: C1, C2, and each with the other's way with limits."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib.patheffects as effects
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle
from numpy.typing import NDArray

from msrr_bullet.figures.plots.style import PAPER, SMALL, controller_style, new_figure, save, styled
from msrr_bullet.reproduce.report.gain_delay_findings import DOCKS
from msrr_bullet.studies.gain_delay import C1, C1_WITHOUT, C2_WITH
from msrr_bullet.studies.labels import C2
from msrr_bullet.studies.measures import measure
from msrr_bullet.studies.model import GainDelayMap

#: The two pairs of laws that are compared; the second has its treatment of the limits exchanged.
_PAIRS = ((C1, C2), (C1_WITHOUT, C2_WITH))

#: Name, colour and hatch of a cell, by whether (C1, C2), or (C1 without, C2 with anti-windup) dock.
_CELL_STYLES: dict[tuple[bool, bool], tuple[str, str, str]] = {
    (True, True): ("both dock", "#f7f7f2", ""),
    (True, False): ("C1 (below: without anti-windup) alone", controller_style("c1")[0], "//"),
    (False, True): ("C2 (below: with anti-windup) alone", controller_style("c2")[0], "\\\\"),
    (False, False): ("neither", "#9aa3ab", "xx"),
}


def draw_gain_delay_map(chart: GainDelayMap, path: Path) -> Path:
    """Draw the success of each controller, and which of two dock in each cell; a row for each pair."""
    with styled():
        figure = new_figure(19.0, 13.6)
        grid = figure.subplots(2, 3, sharey=True)
        handles: list[Artist] = []
        for line, pair in zip(grid, _PAIRS, strict=True):
            handles = _draw_pair(figure, line, chart, pair)
        figure.legend(handles=handles, loc="outside lower center", ncols=3, frameon=False)
        how = "delay compensated by the estimator" if chart.compensated else "delay not compensated"
        figure.suptitle(f"Docking over gain and delay, {how} ({chart.trials} trials a cell)")
        return save(figure, path)


def _draw_pair(
    figure: Figure, line: Sequence[Axes], chart: GainDelayMap, pair: tuple[str, str]
) -> list[Artist]:
    """Draw two laws and which of them dock; return what the legend explains."""
    first, second = (np.array([[c.success for c in row] for row in chart.cells[law]]) for law in pair)
    left, middle, right = line
    for axes, law, shares in ((left, pair[0], first), (middle, pair[1], second)):
        image = axes.imshow(
            100.0 * shares, cmap="cividis", vmin=0.0, vmax=100.0, origin="lower", aspect="auto"
        )
        for i, j in np.ndindex(shares.shape):
            ink = "black" if shares[i, j] > 0.55 else "white"
            text = f"{100 * shares[i, j]:.0f}"
            axes.text(j, i, text, ha="center", va="center", color=ink, fontsize=SMALL)
        axes.set_title(f"{law}: docked [%]")
    bar = figure.colorbar(image, ax=(left, middle), shrink=0.8, pad=0.01)
    bar.set_label("docked [%]")
    handles = [*_draw_cells(right, first >= DOCKS, second >= DOCKS), *_draw_stability_limits(right, chart)]
    for axes in (left, middle, right):
        _draw_axes(axes, chart)
        if not chart.compensated:
            ring = _draw_paper_cell(axes, chart)
    if not chart.compensated:
        handles.append(ring)
    left.set_ylabel("gain k_n [1/s]", labelpad=10.0)
    return handles


def _draw_cells(axes: Axes, c1: NDArray[np.bool_], c2: NDArray[np.bool_]) -> list[Artist]:
    for i, j in np.ndindex(c1.shape):
        _, colour, hatch = _CELL_STYLES[bool(c1[i, j]), bool(c2[i, j])]
        cell = Rectangle((j - 0.5, i - 0.5), 1, 1, facecolor=colour, hatch=hatch, edgecolor="#ffffff")
        cell.set_linewidth(0.0)
        axes.add_patch(cell)
    axes.set_title(f"who docks (at least {100 * DOCKS:.0f} %)")
    return [
        Patch(facecolor=colour, hatch=hatch, edgecolor="#ffffff" if hatch else "black", label=name)
        for name, colour, hatch in _CELL_STYLES.values()
    ]


def _draw_stability_limits(axes: Axes, chart: GainDelayMap) -> list[Artist]:
    """Draw the curves on which gain times total delay is 1; about there a law begins to oscillate."""
    gains, delays = np.array(chart.gains), chart.lag + np.array(chart.latencies)
    fine = np.linspace(delays[0], delays[-1], 400)
    handles: list[Artist] = []
    limits = ((chart.extra_gain, "--", "C2: gain x delay = 1"), (0.0, "-", "C1: gain x delay = 1"))
    for extra_gain, style, text in limits:
        gain = 1.0 / fine - extra_gain
        inside = (gain >= gains[0]) & (gain <= gains[-1])
        x = np.interp(fine[inside], delays, np.arange(len(delays)))
        y = np.interp(gain[inside], gains, np.arange(len(gains)))
        (line,) = axes.plot(x, y, color=PAPER, linestyle=style, linewidth=3.0, label=text)
        line.set_path_effects([effects.Stroke(linewidth=6.0, foreground="white"), effects.Normal()])
        handles.append(line)
    return handles


def _draw_paper_cell(axes: Axes, chart: GainDelayMap) -> Patch:
    """Outline the cell whose final errors are nearest to the paper's, and state both."""
    i, j = chart.gains.index(chart.paper_cell[0]), chart.latencies.index(chart.paper_cell[1])
    final = measure("final")
    papers = f"{1e3 * (final.paper_c1 or 0.0):g} and {1e3 * (final.paper_c2 or 0.0):g} mm"
    ours = " and ".join(f"{1e3 * chart.cells[law][i][j].final_p50_m:.0f}" for law in (C1, C2))
    ring = Rectangle((j - 0.5, i - 0.5), 1, 1, fill=False, edgecolor=PAPER, linewidth=4.0)
    ring.set_path_effects([effects.Stroke(linewidth=8.0, foreground="white"), effects.Normal()])
    ring.set_label(f"most like the paper: final errors {papers} there, {ours} mm here")
    axes.add_patch(ring)
    return ring


def _draw_axes(axes: Axes, chart: GainDelayMap) -> None:
    axes.grid(visible=False)
    delays = [f"{1e3 * (chart.lag + t):.0f}" for t in chart.latencies]
    axes.set_xticks(range(len(delays)), delays)
    axes.set_yticks(range(len(chart.gains)), [f"{g:g}" for g in chart.gains])
    axes.set_xlabel("total delay: latency + 1/kappa [ms]")
    axes.set_xlim(-0.5, len(delays) - 0.5)
    axes.set_ylim(-0.5, len(chart.gains) - 0.5)
