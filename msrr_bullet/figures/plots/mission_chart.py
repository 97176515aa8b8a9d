"""Chart of a mission over time: a row for each unit with what it did, for whom it waited, and its events."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle
from matplotlib.text import Text

from msrr_bullet.figures.plots import curves
from msrr_bullet.figures.plots.axes import add_grid, halo
from msrr_bullet.timeline.mission_series import EventKind, Span, activity_spans, silent_spans, unit_events
from msrr_bullet.timeline.mission_snapshot import Activity
from msrr_bullet.timeline.palette import ACTIVITY_COLOURS, ALARM, BLACK, DARK, PLAN, css, unit_colours
from msrr_bullet.timeline.series import TrialSeries
from msrr_bullet.timeline.snapshot import Snapshot
from msrr_scenes.messages import seconds
from msrr_scenes.specs.scene import Scene

#: Heights of a row of the chart, of its legend and axis, and of the clearance below it [in].
_ROW_IN, _TEXT_IN, _CLEARANCE_IN = 0.44, 1.0, 1.3
#: Height of a bar, as a share of its row, and height of the mark of a silent radio below it.
_BAR, _SILENT = 0.72, 0.10
#: Shortest bar in which the unit is named for which another one waits, as a share of the whole time.
_MIN_NAMED = 0.035
_HATCH = "//////"

#: Marker and colour of every kind of event.
_MARKS = {
    EventKind.GRANTED: ("|", PLAN),
    EventKind.DOCKED: ("o", BLACK),
    EventKind.UNDOCKED: ("d", BLACK),
    EventKind.ATTEMPT_FAILED: ("x", ALARM),
    EventKind.LOST: ("v", ALARM),
    EventKind.FOUND: ("^", BLACK),
    EventKind.FAILED: ("X", ALARM),
}


def draw_mission_chart(axes: Axes, scene: Scene, snapshots: Sequence[Snapshot]) -> None:
    """Draw one row for each unit of a mission, the first unit at the top; there is at least one snapshot."""
    end = seconds(snapshots[-1].stamp_ns)
    colours = unit_colours(scene)
    kinds: set[EventKind] = set()
    activities: set[Activity] = set()
    silent = False
    for row, unit in enumerate(scene.units):
        for span in activity_spans(snapshots, unit):
            _draw_span(axes, row, span, end)
            activities.add(span.activity)
        for a, b in silent_spans(snapshots, unit):
            axes.broken_barh([(a, b - a)], (row + 0.5 * _BAR, _SILENT), facecolors=css(ALARM), linewidth=0.0)
            silent = True
        events = list(unit_events(snapshots, unit))
        for event in events:
            marker, colour = _MARKS[event.kind]
            size = 14.0 if event.kind is EventKind.GRANTED else 5.0
            axes.plot(event.time_s, row, marker, color=css(colour), markersize=size, zorder=4, clip_on=False)
            kinds.add(event.kind)
        granted = [event for event in events if event.kind is EventKind.GRANTED]
        spans = pairwise([*(event.time_s for event in granted), end])
        for event, (start, until) in zip(granted, spans, strict=True):
            label = _write(axes, start + 0.006 * end, row - 0.5 * _BAR, event.text, va="top")
            # It ends where the next one begins, which would be written over it.
            room = Rectangle((start, row - 0.5), until - start, 1.0, transform=axes.transData)
            label.set_clip_path(room)
    axes.set(xlim=(0.0, end or 1.0), ylim=(len(scene.units) - 0.45, -0.55))
    axes.set_yticks(range(len(scene.units)), list(scene.units), fontsize=9, fontweight="bold")
    for label, colour in zip(axes.get_yticklabels(), colours.values(), strict=True):
        label.set_color(css(colour))
    add_grid(axes, "x")
    handles = [*_bars(activities), *_marks(kinds, silent)]
    axes.legend(
        handles=handles,
        loc="lower right",  # the names of the units may be long
        bbox_to_anchor=(1.0, 1.0),
        ncols=3,
        fontsize=7,
        frameon=False,
        handlelength=1.6,
        columnspacing=1.2,
    )


def mission_height(scene: Scene) -> float:
    """Return the height that :func:`draw_mission` takes [in]."""
    return len(scene.units) * _ROW_IN + _TEXT_IN + _CLEARANCE_IN


def draw_mission(figure: Figure, region: SubplotSpec, scene: Scene, snapshots: Sequence[Snapshot]) -> None:
    """Draw the chart of a mission and below it the smallest clearance, over the same time."""
    clearance_share = _CLEARANCE_IN / mission_height(scene)
    rows = region.subgridspec(2, 1, height_ratios=(1.0 - clearance_share, clearance_share))
    lower = figure.add_subplot(rows[1])
    chart = figure.add_subplot(rows[0], sharex=lower)
    draw_mission_chart(chart, scene, snapshots)
    chart.tick_params(labelbottom=False)
    series = TrialSeries.of(scene, snapshots)
    curves.clearance(lower, series, scene)
    lower.set_xlabel("time [s]")


def _draw_span(axes: Axes, row: int, span: Span, end: float) -> None:
    waits = span.activity is Activity.WAITING
    axes.broken_barh(
        [(span.start_s, span.end_s - span.start_s)],
        (row - 0.5 * _BAR, _BAR),
        facecolors=css(ACTIVITY_COLOURS[span.activity]),
        edgecolor=css(DARK) if waits else "none",
        linewidth=0.0,
        hatch=_HATCH if waits else None,
    )
    if span.waits_for is not None and span.end_s - span.start_s > _MIN_NAMED * end:
        label = _write(axes, span.start_s + 0.004 * end, row + 0.28 * _BAR, f"for {span.waits_for}")
        room = Rectangle((span.start_s, row - 0.5), span.end_s - span.start_s, 1.0, transform=axes.transData)
        label.set_clip_path(room)


def _write(axes: Axes, x: float, y: float, text: str, ha: str = "left", va: str = "center") -> Text:
    return axes.text(x, y, text, fontsize=6.5, ha=ha, va=va, clip_on=True, zorder=5, path_effects=halo())


def _bars(activities: set[Activity]) -> list[Artist]:
    return [
        Patch(
            facecolor=css(ACTIVITY_COLOURS[activity]),
            edgecolor=css(DARK),
            linewidth=0.0 if activity is not Activity.WAITING else 0.3,
            hatch=_HATCH if activity is Activity.WAITING else None,
            label="waiting for another one" if activity is Activity.WAITING else activity.value,
        )
        for activity in Activity
        if activity in activities
    ]


def _marks(kinds: set[EventKind], silent: bool) -> list[Artist]:
    marks: list[Artist] = [
        Line2D([], [], marker=_MARKS[kind][0], color=css(_MARKS[kind][1]), linestyle="", label=kind.value)
        for kind in EventKind
        if kind in kinds
    ]
    if silent:
        marks.append(Patch(facecolor=css(ALARM), label="not heard by the base station"))
    return marks
