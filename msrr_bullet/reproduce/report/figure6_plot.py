"""The paper's Fig. 6: C1 and C2 over each other in time, a column for each plant."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from textwrap import fill

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes

from msrr_bullet.figures.plots.style import FAINT, PAPER, controller_style, new_figure, save, styled
from msrr_bullet.studies.series import Figure6, Series
from msrr_scenes.arrays import Array

_ROWS = ("x [m]", "y [m]", "heading [deg]", "v [m/s]", "w [rad/s]")


def draw_figure6(figures: Sequence[Figure6], path: Path) -> Path:
    """Draw position, heading and speeds of both laws, with the reference before and after its correction."""
    with styled():
        sheet = new_figure(9.5 * len(figures) + 1.0, 20.0)
        grid = sheet.subplots(len(_ROWS), len(figures), squeeze=False, sharex="col", sharey="row")
        for column, figure in enumerate(figures):
            for axes, label in zip(grid[:, column], _ROWS, strict=True):
                _draw_row(axes, figure, label)
                axes.set_ylabel(label)
            grid[0, column].set_title(fill(f"{figure.plant}: {figure.description}", 72), pad=14.0)
            grid[-1, column].set_xlabel("time [s]")
        handles: dict[str, Artist] = {}
        for axes in grid.flat:
            handles.update({str(line.get_label()): line for line in axes.get_lines()})
        columns = min(2 * len(figures), 3)  # three are wider than a sheet with one column of axes
        sheet.legend(handles=list(handles.values()), loc="outside lower center", ncols=columns, frameon=False)
        sheet.suptitle("C1 and C2 (our reading) at the setting most like the paper's")
        return save(sheet, path)


def _draw_row(axes: Axes, figure: Figure6, row: str) -> None:
    for k, (label, series) in enumerate(figure.series.items()):
        colour, t = controller_style(label)[0], np.array(series.time)
        style = ("-", "--")[k % 2]
        values = _values(series, row)
        if row in ("x [m]", "y [m]"):
            component = _ROWS.index(row)
            nominal, corrected = np.array(series.reference), np.array(series.corrected)
            ink, text = (PAPER, FAINT)[k % 2], f"reference, nominal, {label}"
            axes.plot(t, nominal[:, component], color=ink, linestyle=style, linewidth=1.2, label=text)
            text = f"reference with LOS correction, {label}"
            axes.plot(t, corrected[:, component], color=colour, linestyle=":", linewidth=2.4, label=text)
        if row in ("v [m/s]", "w [rad/s]"):
            component = ("v [m/s]", "w [rad/s]").index(row)
            command = np.array(series.command)[:, component]
            axes.plot(t, command, color=colour, linewidth=0.8, alpha=0.6, label=f"{label}, commanded")
        axes.plot(t, values, color=colour, linestyle=style, label=label)


def _values(series: Series, row: str) -> Array:
    heading = np.degrees([error[2] for error in series.error])
    columns = [*np.array(series.tip).T, heading, *np.array(series.twist).T]
    values: Array = columns[_ROWS.index(row)]
    return values
