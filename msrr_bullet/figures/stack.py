"""Curves one above the other, with one axis of time."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec

from msrr_bullet.figures import curves
from msrr_bullet.timeline.series import Series


def draw_stack(
    figure: Figure, place: SubplotSpec, series: Series, drawn: Sequence[Callable[[Axes], None]]
) -> None:
    """Draw curves into a part of a figure; the top one names the phases, the lowest has the times."""
    rows = place.subgridspec(len(drawn), 1)
    lowest = figure.add_subplot(rows[len(drawn) - 1])
    stack = [figure.add_subplot(rows[i], sharex=lowest) for i in range(len(drawn) - 1)]
    for axes, draw in zip((*stack, lowest), drawn, strict=True):
        draw(axes)
        curves.shade_phases(axes, series, named=axes is (*stack, lowest)[0])
        axes.yaxis.set_label_coords(-0.085, 0.5)
    for axes in stack:
        axes.tick_params(labelbottom=False)
    lowest.set_xlabel("time [s]")
