"""The tornado plot: what one step of each effect adds to the error at contact, and how far docking holds."""

from __future__ import annotations

from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from msrr_bullet.figures.plots.style import SMALL, new_figure, save, styled
from msrr_bullet.timeline.palette import BLUE, ORANGE, VERMILLION, css
from msrr_bullet.tolerance.effects import RANGE
from msrr_bullet.tolerance.model import EffectResult, ToleranceStudy
from msrr_bullet.tolerance.wording import with_unit
from msrr_scenes.specs.as_built import GRADES

#: Largest number of effects in the figure.
MAX_ROWS = 26

_ROW_IN, _WIDTH_IN = 0.36, 10.0

#: Edge of the left half, over its longest bar.
_EDGE = 1.6

#: Width of a bar of the right half [pt].
_BAR = 7.0


def draw_tornado(study: ToleranceStudy, path: Path, *, dark: bool = False) -> Path:
    """Draw as PNG the effects that matter most, the one that adds most to the lateral error on top.

    Those matter that add most to the lateral error, and those that keep the unit from docking first. ``dark``
    is whether the page behind the figure is dark.
    """
    most = max(map(_added_mm, study.effects)) or 1.0
    first = max(map(_used, study.effects)) or 1.0
    ranked = sorted(study.effects, key=lambda e: max(_added_mm(e) / most, _used(e) / first), reverse=True)
    shown = sorted(ranked[:MAX_ROWS], key=_added_mm, reverse=True)
    with styled(dark=dark):
        figure = new_figure(_WIDTH_IN, 2.4 + _ROW_IN * len(shown))
        added, reach = figure.subplots(1, 2, sharey=True)
        _draw_added(added, shown)
        _draw_reach(reach, shown)
        added.set_yticks(range(len(shown)), [f"{e.name}, {with_unit(e.step, e)}" for e in shown])
        added.tick_params(axis="y", labelsize=SMALL)
        added.set_ylim(len(shown) - 0.4, -0.6)
        left_out = len(study.effects) - len(shown)
        more = f" ({left_out} that matter less are left out)" if left_out else ""
        figure.suptitle(f"{study.scene}: each effect alone{more}")
        figure.legend(loc="outside lower center", ncols=2, frameon=False, fontsize=SMALL)
        return save(figure, path)


def _added_mm(effect: EffectResult) -> float:
    return effect.lateral.rms * effect.step if effect.lateral is not None else 0.0


def _used(effect: EffectResult) -> float:
    return 0.0 if effect.threshold is None else min(effect.step / effect.threshold, 1.0)


def _draw_added(axes: Axes, shown: list[EffectResult]) -> None:
    ends = [effect.step * effect.lateral.high for effect in shown if effect.lateral is not None]
    edge = _EDGE * max(map(_added_mm, shown))
    for graded, label in ((True, "one sigma of careful"), (False, "a size that no grade has")):
        rows = [(i, e) for i, e in enumerate(shown) if e.graded is graded and e.lateral is not None]
        if not rows:
            continue
        values = [_added_mm(effect) for _, effect in rows]
        below = [e.step * (e.lateral.rms - e.lateral.low) for _, e in rows if e.lateral is not None]
        above = [e.step * (e.lateral.high - e.lateral.rms) for _, e in rows if e.lateral is not None]
        axes.barh(
            [i for i, _ in rows],
            values,
            height=0.68,
            facecolor=css(BLUE) if graded else "none",
            edgecolor=css(BLUE),
            linewidth=1.5,
            hatch=None if graded else "////",
            label=label,
            xerr=[below, above],
            error_kw={"ecolor": css(ORANGE), "elinewidth": 2.0},
        )
    cut = max(ends, default=0.0) > edge > 0.0  # an interval of a few trials would leave the bars no room
    axes.set_xlim(0.0, edge if cut else None)
    axes.grid(visible=False, axis="y")
    axes.set_xlabel("adds laterally, RMS [mm]" + ("\n(longer intervals are cut)" if cut else ""))


def _draw_reach(axes: Axes, shown: list[EffectResult]) -> None:
    least = 0.1
    reached = [(i, max(e.holds / e.step, least), e) for i, e in enumerate(shown)]
    rows, holds, _ = zip(*reached, strict=True)
    axes.hlines(rows, least, holds, color=css(BLUE), alpha=0.45, linewidth=_BAR)
    limited = [(i, low, e.fails / e.step) for i, low, e in reached if e.fails]
    if limited:
        rows, low, high = zip(*limited, strict=True)
        text = "docking falls below 95 %"
        axes.hlines(rows, low, high, color=css(VERMILLION), linewidth=_BAR, label=text)
    free = [(low, i) for i, low, e in reached if e.fails is None]
    if free:
        text = "docks at the largest size tried"
        axes.plot(*zip(*free, strict=True), ">", color=css(BLUE), markersize=9, label=text)
    sigmas = [factor for factor in GRADES.values() if factor]
    text = "one sigma of careful, workshop, rough"
    axes.vlines(sigmas, -0.6, len(shown) - 0.4, color="0.5", linestyle="--", linewidth=1.2, label=text)
    axes.set_xscale("log")
    axes.set_xlim(least, 1.15 * RANGE)
    axes.xaxis.set_major_locator(FixedLocator([least, *sigmas, RANGE]))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
    axes.grid(visible=False)
    axes.set_xlabel("docks up to [steps]")
