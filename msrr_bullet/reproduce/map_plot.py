"""Docking success of C1 and C2 over gain and total delay."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.patches import Patch, Rectangle
from numpy.typing import NDArray

from msrr_bullet.reproduce.findings import DOCKS
from msrr_bullet.reproduce.gain_delay import LAWS
from msrr_bullet.reproduce.model import GainDelayMap
from msrr_bullet.reproduce.style import FAINT, FIRST, MARK, PAPER, SECOND, new_figure, save, styled

Array = NDArray[np.float64]


def draw_map(found: GainDelayMap, path: Path) -> Path:
    """Draw the success of each controller, and who docks where."""
    c1, c2 = (np.array([[c.success for c in row] for row in found.cells[law]]) for law in LAWS)
    with styled():
        figure = new_figure(18.0, 6.6)
        left, middle, right = figure.subplots(1, 3, sharey=True)
        for axes, law, shares in ((left, "c1", c1), (middle, "c2", c2)):
            image = axes.imshow(
                100.0 * shares, cmap="cividis", vmin=0.0, vmax=100.0, origin="lower", aspect="auto"
            )
            for i, j in np.ndindex(shares.shape):
                share = shares[i, j]
                ink = "black" if share > 0.55 else "white"
                axes.text(j, i, f"{100 * share:.0f}", ha="center", va="center", color=ink, fontsize=12)
            axes.set_title(f"{law.upper()}: docked [%]")
        figure.colorbar(image, ax=(left, middle), shrink=0.8, pad=0.01)
        _who(right, c1 >= DOCKS, c2 >= DOCKS)
        for axes in (left, middle, right):
            _frame(axes, found)
        left.set_ylabel("gain k_n [1/s]")
        figure.legend(
            *left.get_legend_handles_labels(), loc="outside lower left", ncols=3, frameon=False, fontsize=13
        )
        how = "delay made up for by the estimator" if found.compensated else "delay not made up for"
        figure.suptitle(f"Docking over gain and delay, {how} ({found.trials} trials a cell)", fontsize=16)
        return save(figure, path)


def _who(axes: Axes, c1: NDArray[np.bool_], c2: NDArray[np.bool_]) -> None:
    kinds = np.where(c1 & c2, 3, np.where(c1, 2, np.where(c2, 1, 0)))
    colours = [FAINT, SECOND, FIRST, "#f7f7f2"]
    norm = BoundaryNorm(np.arange(-0.5, 4.0), 4)
    axes.imshow(kinds, cmap=ListedColormap(colours), norm=norm, origin="lower", aspect="auto")
    signs = ("-", "2", "1", "+")
    for i, j in np.ndindex(kinds.shape):
        ink = "black" if kinds[i, j] == 3 else "white"
        axes.text(j, i, signs[kinds[i, j]], ha="center", va="center", color=ink, fontsize=14)
    names = ("- neither", "2 C2 alone", "1 C1 alone", "+ both")
    handles = [Patch(facecolor=c, edgecolor="black", label=n) for c, n in zip(colours, names, strict=True)]
    axes.legend(handles=handles[::-1], loc="upper center", bbox_to_anchor=(0.5, -0.15), ncols=2, fontsize=12)
    axes.set_title(f"who docks (at least {100 * DOCKS:.0f} %)")


def _frame(axes: Axes, found: GainDelayMap) -> None:
    """Label the cells; draw where gain times delay is 1, and the cell that resembles the paper."""
    gains, delays = np.array(found.gains), found.lag + np.array(found.latencies)
    axes.grid(visible=False)
    axes.set_xticks(range(len(delays)), [f"{1e3 * d:.0f}" for d in delays])
    axes.set_yticks(range(len(gains)), [f"{g:g}" for g in gains])
    axes.set_xlabel("total delay: latency + 1/kappa [ms]")
    extra = found.extra_gain
    fine = np.linspace(delays[0], delays[-1], 400)
    for more, style, text in ((extra, "--", "C2's gain x delay = 1"), (0.0, ":", "C1's gain x delay = 1")):
        gain = 1.0 / fine - more
        inside = (gain >= gains[0]) & (gain <= gains[-1])
        x = np.interp(fine[inside], delays, np.arange(len(delays)))
        y = np.interp(gain[inside], gains, np.arange(len(gains)))
        axes.plot(x, y, color="white", linewidth=4.0)
        axes.plot(x, y, color=PAPER, linestyle=style, linewidth=2.0, label=text)
    i, j = found.gains.index(found.paper_cell[0]), found.latencies.index(found.paper_cell[1])
    if not found.compensated:
        axes.add_patch(
            Rectangle(
                (j - 0.5, i - 0.5),
                1,
                1,
                fill=False,
                edgecolor=MARK,
                linewidth=4.0,
                label="most like the paper's final errors",
            )
        )
    axes.set_xlim(-0.5, len(delays) - 0.5)
    axes.set_ylim(-0.5, len(gains) - 0.5)
