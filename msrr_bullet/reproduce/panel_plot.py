"""The six panels of the paper's Fig. 6: one trial of each controller over time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle
from numpy.typing import NDArray

from msrr_bullet.reproduce.measures import SETTLED_M, measure
from msrr_bullet.reproduce.model import Panels, Series
from msrr_bullet.reproduce.style import FAINT, FIRST, LIMIT, PAPER, SECOND, THIRD, new_figure, save, styled

Array = NDArray[np.float64]

_LINES = ("-", "--", ":")


def draw_panels(panels: Panels, name: str, path: Path, cone_deg: tuple[float, float]) -> Path:
    """Draw one controller's trial.

    Args:
        panels: Series of the phase.
        name: Which of them.
        path: PNG to write.
        cone_deg: Inner and outer bound of the line of sight.
    """
    one = panels.series[name]
    with styled():
        figure = new_figure(15.0, 9.0)
        axes = figure.subplots(2, 3)
        t = np.array(one.time)
        _above(axes[0, 0], one, panels.phase)
        _errors(axes[0, 1], t, one, panels.phase)
        _speed(axes[0, 2], t, one, 0, "v [m/s]")
        _speed(axes[1, 2], t, one, 1, "w [rad/s]")
        if panels.phase == "long":
            _distance(axes[1, 0], t, one)
        else:
            _angles(axes[1, 0], t, one, cone_deg)
        _auxiliary(axes[1, 1], t, one)
        for a in axes.flat[1:]:
            a.set_xlabel("time [s]")
            a.set_xlim(0.0, t[-1])
        figure.suptitle(f"{name}, {panels.phase} phase, {panels.setting}", fontsize=16, fontweight="bold")
        return save(figure, path)


def _above(axes: Axes, one: Series, phase: str) -> None:
    tip, reference = np.array(one.tip), np.array(one.reference)
    what = "desired path" if phase == "long" else "guidance"
    axes.plot(*reference.T, color=FAINT, linestyle="--", label=what)
    axes.plot(*tip.T, color=FIRST, label="controlled point")
    axes.plot(*tip[0], color=FIRST, marker="o", markersize=8)
    if one.obstacle is not None:
        x, y, radius = one.obstacle
        axes.add_patch(Circle((x, y), radius, color=SECOND, alpha=0.85, label="obstacle"))
        axes.set_aspect("equal", adjustable="datalim")
    else:
        axes.axvline(0.0, color=PAPER, linewidth=1.4, label="face of the port")
        low, high = float(tip[:, 1].min()), float(tip[:, 1].max())
        axes.set_ylim(min(low, -0.02) - 0.02, max(high, 0.02) + 0.05)
    axes.set(xlabel="x [m]", ylabel="y [m]", title="from above")
    axes.legend(loc="best")


def _errors(axes: Axes, t: Array, one: Series, phase: str) -> None:
    error = np.array(one.error)
    axes.plot(t, error[:, 0], color=FIRST, label="x [m]", linestyle=_LINES[0])
    axes.plot(t, error[:, 1], color=SECOND, label="y [m]", linestyle=_LINES[1])
    axes.plot(t, error[:, 2], color=THIRD, label="heading [rad]", linestyle=_LINES[2])
    bound = measure("amplitude").paper_c1 if phase == "long" else SETTLED_M
    if bound is not None:
        text = "paper's amplitude" if phase == "long" else "paper's 15 mm"
        for sign in (1.0, -1.0):
            axes.axhline(sign * bound, color=PAPER, linewidth=1.2, label=text if sign > 0 else None)
    axes.set(ylabel="error", title="tracking errors")
    _legend_above(axes)


def _speed(axes: Axes, t: Array, one: Series, which: int, label: str) -> None:
    axes.plot(t, np.array(one.command)[:, which], color=SECOND, linewidth=1.3, label="commanded")
    axes.plot(t, np.array(one.twist)[:, which], color=FIRST, label="behind the limits")
    most = one.limits[which]
    for sign in (1.0, -1.0):
        axes.axhline(sign * most, color=LIMIT, linestyle=":", label="limit" if sign > 0 else None)
    axes.set(ylabel=label, title="speed" if which == 0 else "turn rate")
    axes.set_ylim(-1.2 * most, 1.2 * most)
    _legend_above(axes)


def _distance(axes: Axes, t: Array, one: Series) -> None:
    axes.plot(t, one.distance, color=FIRST, label="from the body to the obstacle's middle")
    if one.obstacle is not None:
        axes.axhline(one.obstacle[2], color=SECOND, linestyle="--", label="its radius")
    axes.set(ylabel="distance [m]", title="distance to the obstacle")
    axes.set_ylim(bottom=0.0)
    _legend_above(axes, columns=1)


def _angles(axes: Axes, t: Array, one: Series, cone_deg: tuple[float, float]) -> None:
    angles = np.degrees(np.array(one.angles))
    axes.plot(t, angles[:, 0], color=FIRST, label="left edge")
    axes.plot(t, angles[:, 1], color=SECOND, linestyle="--", label="right edge")
    for bound, style, text in zip(cone_deg, (":", "-"), ("inner bound", "outer bound"), strict=True):
        for sign in (1.0, -1.0):
            axes.axhline(
                sign * bound, color=PAPER, linestyle=style, linewidth=1.2, label=text if sign > 0 else None
            )
    axes.set(ylabel="angle [deg]", title="line of sight")
    top = 1.1 * max(cone_deg[1], float(np.abs(angles).max()))
    axes.set_ylim(-top, top)
    _legend_above(axes)


def _auxiliary(axes: Axes, t: Array, one: Series) -> None:
    axes.set(ylabel="auxiliary state", title="auxiliary states")
    if not one.auxiliary:
        axes.text(0.5, 0.5, "this law has none", transform=axes.transAxes, ha="center", color=FAINT)
        return
    for colour, (name, values) in zip((FIRST, SECOND, THIRD), one.auxiliary.items(), strict=False):
        for axis, style in ((0, "-"), (1, "--")):
            axes.plot(
                t, np.array(values)[:, axis], color=colour, linestyle=style, label=f"{name}, {'xy'[axis]}"
            )
    _legend_above(axes)


def _legend_above(axes: Axes, columns: int = 2) -> None:
    """Put the legend over the curves: make room for it at the top."""
    low, high = axes.get_ylim()
    lines = -(-len(axes.get_legend_handles_labels()[1]) // columns)
    axes.set_ylim(low, high + (0.10 + 0.105 * lines) * (high - low))
    axes.legend(loc="upper center", ncols=columns, columnspacing=0.8, handlelength=1.6)
