"""View of a mission from above: every unit with its way and its routes, docked pairs, who waits for whom."""

from __future__ import annotations

import math
from collections.abc import Sequence

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.transforms import ScaledTranslation

from msrr_bullet.collision.footprint import unit_parts
from msrr_bullet.figures.drawing.mission_marks import docked_pairs, driven_way, name_of, short_name
from msrr_bullet.figures.plots.axes import draw_body, halo
from msrr_bullet.timeline.palette import ALARM, BLACK, DARK, css, unit_colours
from msrr_bullet.timeline.routes import Routes, part_of
from msrr_bullet.timeline.snapshot import Snapshot
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages.coordination import Authority
from msrr_scenes.specs.scene import Scene

#: Widths of a driven way and of the band of a granted route [pt].
_WAY_PT, _BAND_PT = 1.8, 8.0
#: Height of the labels below the axes [pt].
_LABELS_PT = 30.0


def draw_mission_view(axes: Axes, scene: Scene, snapshots: Sequence[Snapshot]) -> None:
    """Draw units and ways of a mission; obstacles, limits and labels of the axes are the caller's."""
    colours, first, last = unit_colours(scene), snapshots[0], snapshots[-1]
    for unit, colour in colours.items():
        parts = unit_parts(scene.geometry(unit))
        draw_body(axes, parts, first.units[unit], colour, 0.25)
        draw_body(axes, parts, last.units[unit], colour, 0.85)
    for unit, colour in colours.items():
        way = driven_way(snapshots, unit)
        axes.plot(*way.T, color=css(colour), linewidth=_WAY_PT, solid_capstyle="round", zorder=2.2)
    never_granted = _draw_routes(axes, scene, snapshots)
    pairs = docked_pairs(scene, last)
    for ends in pairs.values():
        axes.plot(*ends.T, color=css(BLACK), linewidth=3.0, solid_capstyle="butt", zorder=3.0)
    waits = _draw_waits(axes, last)
    for unit, colour in colours.items():
        if math.dist(first.units[unit].translation, last.units[unit].translation) >= 0.1:
            _write(axes, first.units[unit], short_name(unit), css(colour), 9)
        text, ink = name_of(unit, last.mission)
        _write(axes, last.units[unit], text, css(ink), 10)
    below = ScaledTranslation(0.0, -_LABELS_PT / 72.0, axes.figure.dpi_scale_trans)
    axes.legend(  # below the axes and their labels: units may start anywhere in them
        handles=_legend(never_granted, bool(pairs), waits),
        loc="upper center",
        bbox_to_anchor=(0.5, 0.0),
        bbox_transform=axes.transAxes + below,
        frameon=False,
        fontsize=7,
        ncols=3,
    )


def _draw_routes(axes: Axes, scene: Scene, snapshots: Sequence[Snapshot]) -> bool:
    """Draw every route as far as it was granted, and the rest dotted; return whether there is a rest."""
    newest: dict[tuple[str, int], Authority] = {}
    for snapshot in snapshots:
        for authority in () if snapshot.mission is None else snapshot.mission.authorities.values():
            newest[authority.unit, authority.route] = authority
    routes, colours, rest = Routes(scene), unit_colours(scene), False
    for authority in newest.values():
        route = routes.of(authority)
        granted = part_of(route, 0.0, min(max(authority.limit, 0.0), route.length))
        colour = css(colours[authority.unit])
        axes.plot(
            *granted.T, color=colour, linewidth=_BAND_PT, alpha=0.28, solid_capstyle="round", zorder=2.1
        )
        if authority.limit < route.length - 1e-6:
            beyond = part_of(route, max(authority.limit, 0.0), route.length)
            axes.plot(*beyond.T, color=colour, linestyle=":", linewidth=_WAY_PT, zorder=2.1)
            rest = True
    return rest


def _draw_waits(axes: Axes, snapshot: Snapshot) -> bool:
    """Draw an arrow from every unit that waits to the one for which it waits; return whether there is one."""
    drawn = False
    for unit, X in snapshot.units.items():
        other = None if snapshot.mission is None else snapshot.mission.waits_for(unit)
        if other is not None:
            style = {"arrowstyle": "-|>", "color": css(ALARM), "linewidth": 1.4, "shrinkA": 8, "shrinkB": 8}
            target = snapshot.units[other]
            axes.annotate("", (target.x, target.y), (X.x, X.y), arrowprops=style, zorder=3.5)
            drawn = True
    return drawn


def _write(axes: Axes, X: SE2, text: str, colour: str, size: float) -> None:
    axes.text(
        X.x,
        X.y,
        text,
        color=colour,
        fontsize=size,
        fontweight="bold",
        ha="center",
        va="center",
        zorder=4.0,
        path_effects=halo(2.5),
    )


def _legend(never_granted: bool, docked: bool, waits: bool) -> list[Artist]:
    entries: list[Artist] = [
        Patch(facecolor=css(DARK), alpha=0.3, label="start"),
        Patch(facecolor=css(DARK), alpha=0.9, label="end"),
        Line2D([], [], color=css(DARK), linewidth=_WAY_PT, label="driven (truth)"),
        Line2D([], [], color=css(DARK), linewidth=_BAND_PT, alpha=0.28, label="route, granted"),
    ]
    if never_granted:
        entries.append(
            Line2D([], [], color=css(DARK), linestyle=":", linewidth=_WAY_PT, label="route, not granted")
        )
    if docked:
        entries.append(Line2D([], [], color=css(BLACK), linewidth=3.0, label="docked pair"))
    if waits:
        entries.append(Line2D([], [], color=css(ALARM), linewidth=1.4, label="waits for"))
    return entries
