"""The plot of a variation: success rate and error at contact over the values that were varied."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from msrr_bullet.figures.plots.style import check_format, legend_above, new_figure, save, styled
from msrr_bullet.statistics import Quantiles
from msrr_bullet.sweep.summary import SweepSummary
from msrr_bullet.sweep.variation import Level, Variation, values_text
from msrr_bullet.timeline.palette import BLACK, BLUE, GREEN, ORANGE, PURPLE, SKY, VERMILLION, css
from msrr_scenes.errors import SceneError

#: Colour and marker of every curve; the marker tells curves apart without colour.
_STYLES = tuple(
    zip(
        (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY, BLACK),
        ("o", "s", "^", "D", "v", "P", "X"),
        strict=True,
    )
)

#: Distance of the curves from each other where they have a value in common, over the width of the axes.
_APART = 0.008

#: Number of characters of a label that the width of the figure has room for.
_LABEL = 70

#: Shortest line of a value at the axis, in characters; where there is less room, values stand upright.
_SHORTEST_LINE = 12

#: Room for a value that stands upright [in].
_UPRIGHT_IN = 0.27

#: From this ratio of the largest to the smallest value on, the axis of the values is logarithmic.
_LOGARITHMIC = 20.0


def check_plot(choices: Sequence[dict[str, str]], path: Path) -> None:
    """Refuse a plot before the trials are run.

    Raises:
        MsrrError: The ending of the file names no format of figures.
        SceneError: There would be more curves than can be told apart.
    """
    check_format(path)
    curves = len({_others(choice) for choice in choices})
    if curves > len(_STYLES):
        raise SceneError(
            f"{path}: {curves} curves, one for each choice of the later keys; at most {len(_STYLES)} "
            "can be told apart. Name the key with the most values first"
        )


def plot_variation(variation: Variation, path: str | Path) -> Path:
    """Plot the success rate and the lateral error at contact over the values of the first key.

    Each choice of values of the other keys has curves of its own. Bars are 95 % confidence intervals. A scene
    with several docking steps has one part of the figure for each of them.

    Args:
        variation: The variation.
        path: PNG, PDF or SVG file to write.

    Raises:
        MsrrError: As :func:`check_plot` raises it, or the file cannot be written.
    """
    check_plot([level.values for level in variation.levels], Path(path))
    curves: dict[str, list[Level]] = {}
    for level in variation.levels:
        curves.setdefault(_others(level.values), []).append(level)
    key, values = _first_key(variation)
    numbers = _numbers(values)
    steps = variation.steps
    with styled():
        columns = 1 if max(map(len, curves)) > _LABEL // 2 else 2
        lines = sum(-(-len(label) // _LABEL) for label in curves) / columns
        width, below = 9.0, 0.0
        if numbers is None:
            width = max(width, _UPRIGHT_IN * len(values))
            below = 0.1 * min(_LABEL // 2, max(map(len, values))) if _upright(values) else 0.0
        figure = new_figure(width, 3.2 * (1 + len(steps)) + 0.28 * lines + below)
        rates, *errors = figure.subplots(1 + len(steps), sharex=True, squeeze=False)[:, 0]
        place = _scale(errors[-1], values, numbers)
        for i, (label, levels) in enumerate(curves.items()):
            if numbers is not None:
                levels.sort(key=lambda level: numbers[values.index(level.values[key])])
            aside = _APART * (i - 0.5 * (len(curves) - 1))
            x = [place(values.index(level.values[key]), aside) for level in levels]
            colour, marker = _STYLES[i]
            style = {"color": css(colour), "marker": marker, "linestyle": "-" if numbers else "none"}
            _draw_rates(rates, x, [level.summary for level in levels], fill(label, _LABEL), style)
            for axes, name in zip(errors, steps, strict=True):
                figures = [dict(level.summary.docking_steps).get(name) for level in levels]
                _draw_errors(axes, x, [None if f is None else f.contact_lateral_mm for f in figures], style)
        rates.set(ylabel=f"share of trials\n{variation.goal}", ylim=(-0.03, 1.05))
        for axes, name in zip(errors, steps, strict=True):
            axes.set(ylabel="lateral error\nat contact [mm]", title=name if len(steps) > 1 else "")
            if not any(np.isfinite(np.asarray(line.get_ydata(), dtype=float)).any() for line in axes.lines):
                axes.set_yticks([])
                axes.text(0.5, 0.5, "no contact", transform=axes.transAxes, ha="center", va="center")
            axes.set_ylim(0.0, 1.05 * axes.get_ylim()[1])
            axes.plot([], [], "o", color="0.4", label="median")
            axes.plot([], [], "o", color="0.4", label="95 %", markerfacecolor="none")
            legend_above(axes)
        if len(curves) > 1:
            figure.legend(*rates.get_legend_handles_labels(), loc="outside upper center", ncols=columns)
        errors[-1].set_xlabel(key)
        return save(figure, Path(path))


def _scale(
    axes: Axes, values: Sequence[str], numbers: Sequence[float] | None
) -> Callable[[int, float], float]:
    """Set the axis of the values, which are numbers or not, with ticks at the values alone.

    The function returns the place of a value, by its index and by how far aside it is shown, over the width
    of the axes.
    """
    if numbers is None:
        upright = _upright(values)
        axes.set(xticks=range(len(values)), xlim=(-0.5, len(values) - 0.5))
        axes.set_xticklabels(
            [fill(value, _LABEL // (2 if upright else len(values))) for value in values],
            rotation=90.0 if upright else 0.0,
        )
        return lambda index, aside: index + aside * len(values)
    low, high = min(numbers), max(numbers)
    logarithmic = low > 0.0 and high / low >= _LOGARITHMIC
    width = (high - low) or 1.0
    along = [math.log(n / low, high / low) if logarithmic else (n - low) / width for n in numbers]
    shown = _with_room(values, along)
    axes.set(
        xscale="log" if logarithmic else "linear",
        xticks=[numbers[i] for i in shown],
        xticklabels=[values[i] for i in shown],
    )
    axes.minorticks_off()
    if logarithmic:
        return lambda index, aside: numbers[index] * (high / low) ** aside
    return lambda index, aside: numbers[index] + aside * width


def _with_room(values: Sequence[str], along: Sequence[float]) -> list[int]:
    """Return the indices of the values whose labels have room beside each other, from left to right.

    ``along`` is where each stands on the axis, from 0 at its left end to 1 at its right end.
    """
    shown: list[int] = []
    for index in sorted(range(len(values)), key=along.__getitem__):
        last = shown[-1] if shown else None
        apart = math.inf if last is None else along[index] - along[last]
        if last is None or _LABEL * apart > 1 + 0.5 * (len(values[index]) + len(values[last])):
            shown.append(index)
    return shown


def _upright(values: Sequence[str]) -> bool:
    """Return whether values that are no numbers stand upright at the axis."""
    room = _LABEL // len(values)
    return room < _SHORTEST_LINE and max(map(len, values)) > room


def _draw_rates(
    axes: Axes, x: Sequence[float], summaries: Sequence[SweepSummary], label: str, style: Mapping[str, Any]
) -> None:
    """Draw success rates with their intervals, where a trial has ended at all."""
    success = [s.success if s.trials else None for s in summaries]
    values = [math.nan if s is None else s.rate for s in success]
    bars = [(0.0, 0.0) if s is None else (s.rate - s.low, s.high - s.rate) for s in success]
    axes.errorbar(x, values, np.transpose(bars), capsize=4.0, label=label or None, **style)


def _draw_errors(
    axes: Axes, x: Sequence[float], errors: Sequence[Quantiles | None], style: Mapping[str, Any]
) -> None:
    """Draw median and 95th percentile with their intervals, where there is the step, and contact in it."""
    for q, face, thick in (("p50", style["color"], 2.4), ("p95", "none", 1.0)):
        values = [math.nan if (v := getattr(e, q, None)) is None else v for e in errors]
        bars = np.zeros((2, len(x)))
        for i, e in enumerate(errors):
            low, high = getattr(e, f"{q}_interval", (None, None))
            if low is not None and high is not None:
                bars[:, i] = values[i] - low, high - values[i]
        axes.errorbar(x, values, bars, markerfacecolor=face, elinewidth=thick, **style)


def _first_key(variation: Variation) -> tuple[str, list[str]]:
    """Return the key of the horizontal axis, and its values in their order."""
    key = next(iter(variation.levels[0].values))
    return key, list(dict.fromkeys(level.values[key] for level in variation.levels))


def _others(values: dict[str, str]) -> str:
    """Return what tells the curve of a level: all of its values but the first."""
    _, *others = values.items()
    return values_text(dict(others))


def _numbers(values: Sequence[str]) -> list[float] | None:
    """Return the values as numbers; None if one is no finite number."""
    try:
        numbers = [float(value) for value in values]
    except ValueError:
        return None
    return numbers if all(map(math.isfinite, numbers)) else None
