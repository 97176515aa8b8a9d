"""View of a trial from above: bodies, and the driven, believed and planned paths."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence, Set
from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes

from msrr_bullet.collision.footprint import obstacle_parts, unit_parts
from msrr_bullet.figures.plots.axes import add_grid, draw_body
from msrr_bullet.figures.plots.mission_view import draw_mission_view
from msrr_bullet.timeline.mission_series import AFTER_FAILURE, ATTEMPT
from msrr_bullet.timeline.palette import BELIEF, OBSTACLE, PATH, PLAN, css, unit_colours
from msrr_bullet.timeline.snapshot import Snapshot, planned_paths, step_histories
from msrr_scenes.messages import Phase
from msrr_scenes.specs.scene import Scene

#: Free space around the bodies and paths [m].
MARGIN = 0.08


def draw_top_view(axes: Axes, scene: Scene, snapshots: Sequence[Snapshot], title: bool = True) -> None:
    """Draw a trial from above. The limits of the axes are those of :func:`extent`."""
    marks = _marks(snapshots, {step.unit for step in scene.docks})
    for name, X in snapshots[-1].obstacles.items():
        draw_body(axes, obstacle_parts(scene.obstacles[name]), X, OBSTACLE, 1.0)
    if scene.coordinated:
        draw_mission_view(axes, scene, snapshots)
    else:
        _draw_units(axes, scene, snapshots[-1], marks)
        _draw_paths(axes, snapshots)
        for name, X in snapshots[0].units.items():
            axes.annotate(name, (X.x, X.y), ha="center", va="center", fontsize=10, fontweight="bold")
    _name_obstacles(axes, scene, snapshots)
    x, y = extent(scene, snapshots)
    axes.set(xlabel="x in W [m]", ylabel="y in W [m]", xlim=x, ylim=y, aspect="equal")
    add_grid(axes)
    if title and scene.coordinated:
        axes.set_title("from above: start and end", fontsize=9)
    elif title:
        counts = Counter(event for event, _, _ in marks)
        events = ", ".join(f"{event} ({n})" if n > 1 else event for event, n in counts.items())
        axes.set_title(f"from above: {events}", fontsize=9)


def extent(scene: Scene, snapshots: Sequence[Snapshot]) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the ranges of x and y in W [m] of all bodies at 200 instants, and of the planned paths."""
    reach = {name: scene.geometry(name).circumradius for name in scene.units}
    reach |= {name: spec.radius_m for name, spec in scene.obstacles.items()}
    discs = {
        (X.x, X.y, reach[name])
        for snapshot in (snapshots[0], *snapshots[:: max(1, len(snapshots) // 200)], snapshots[-1])
        for name, X in (*snapshot.shown.items(), *snapshot.obstacles.items())
    }
    discs |= {(x, y, 0.0) for path in planned_paths(snapshots) for x, y in path.points}
    x, y, r = np.array(sorted(discs)).T
    low = np.min(x - r) - MARGIN, np.min(y - r) - MARGIN
    high = np.max(x + r) + MARGIN, np.max(y + r) + MARGIN
    return (float(low[0]), float(high[0])), (float(low[1]), float(high[1]))


def _marks(snapshots: Sequence[Snapshot], docking: Set[str]) -> list[tuple[str, Snapshot, set[str]]]:
    """Return the instants at which units are drawn: the event that the title names, and the units."""
    start = next((s for s in snapshots if docking <= s.shown.keys()), snapshots[0])
    marks = [("start", start, set(docking))]
    for step, history in step_histories(snapshots).items():
        for (before_at, before), (at, after) in pairwise(history):
            if before.phase is Phase.ASSEMBLE and after.phase is Phase.HAND_OVER:
                marks.append(("hand-over", at, {step.unit}))
            elif before.phase in ATTEMPT and after.phase in AFTER_FAILURE:
                marks.append(("failed attempt", before_at, {step.unit}))
    marks.sort(key=lambda mark: mark[1].stamp_ns)
    return [*marks, ("end", snapshots[-1], set(docking))]


def _draw_units(
    axes: Axes, scene: Scene, last: Snapshot, marks: Sequence[tuple[str, Snapshot, set[str]]]
) -> None:
    """Draw the units that dock at every mark, the later the darker, and the others once."""
    docking, colours = marks[0][2], unit_colours(scene)
    for name, X in last.units.items():
        if name not in docking:
            draw_body(axes, unit_parts(scene.geometry(name)), X, colours[name], 1.0)
    for i, (_, snapshot, shown) in enumerate(marks):
        poses = snapshot.shown
        for name in filter(shown.__contains__, poses):
            opacity = 0.25 + 0.65 * i / (len(marks) - 1)
            colour = colours[name] if name in snapshot.units else BELIEF
            draw_body(axes, unit_parts(scene.geometry(name)), poses[name], colour, opacity)


def _draw_paths(axes: Axes, snapshots: Sequence[Snapshot]) -> None:
    for i, path in enumerate(planned_paths(snapshots)):
        points = np.array(path.points)
        label = None if i else "planned"
        axes.plot(*points.T, color=css(PLAN), linestyle="--", linewidth=1.2, label=label)
    histories = step_histories(snapshots)
    for colour, width, label in ((PATH, 2.2, "driven (truth)"), (BELIEF, 1.1, "believed")):
        for i, (step, history) in enumerate(histories.items()):
            poses = [s.estimate if colour == BELIEF else at.units.get(step.unit) for at, s in history]
            points = np.array([(X.x, X.y) if X else (np.nan, np.nan) for X in poses])
            if np.isfinite(points).any():  # a recording has no truth
                axes.plot(*points.T, color=css(colour), linewidth=width, label=None if i else label)
    if axes.get_legend_handles_labels()[1]:  # none in a recording whose target was not found
        axes.legend(loc="best", fontsize=8, framealpha=0.9)


def _name_obstacles(axes: Axes, scene: Scene, snapshots: Sequence[Snapshot]) -> None:
    for name, X in snapshots[-1].obstacles.items():
        spec = scene.obstacles[name]
        axes.annotate(
            name if spec.tag_id is None else f"{name}\ntag {spec.tag_id}",
            (X.x, X.y),
            ha="center",
            va="center",
            fontsize=7,
            bbox={"facecolor": "white", "alpha": 0.6, "linewidth": 0.0, "pad": 0.5},
        )
