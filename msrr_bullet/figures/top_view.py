"""A trial from above: bodies, the ways driven, believed and planned."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Polygon

from msrr_bullet.collision.footprint import Part, obstacle_parts, unit_parts
from msrr_bullet.timeline.palette import BELIEF, DARK, DOCKING_UNIT, OBSTACLE, PATH, PLAN, css, unit_colour
from msrr_bullet.timeline.series import acting_pose
from msrr_bullet.timeline.snapshot import Snapshot, planned_paths
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import Phase
from msrr_scenes.specs.scene import Scene

#: Free space around everything that is drawn [m].
MARGIN = 0.08
#: Phases of a docking run.
_RUN = (Phase.DOCK, Phase.LOCK, Phase.VERIFY)
#: Phases that follow one which failed.
_BACK = (Phase.RETREAT, Phase.ASSEMBLE, Phase.HAND_OVER, Phase.FAILED)


def draw_top_view(axes: Axes, scene: Scene, frames: Sequence[Snapshot], title: bool = True) -> None:
    """Draw a trial from above; the axes get the limits that :func:`extent` gives."""
    docking = {step.unit for step in scene.plan}
    last = frames[-1]
    for name, X in last.obstacles.items():
        _body(axes, obstacle_parts(scene.obstacles[name]), X, OBSTACLE, 1.0)
    for index, (name, X) in enumerate(last.units.items()):
        if name not in docking:
            _body(axes, unit_parts(scene.geometry(name)), X, unit_colour(index, docks=False), 1.0)
    marks = _marks(frames)
    for i, (_, frame) in enumerate(marks):
        for name in docking & frame.units.keys():
            opacity = 0.25 + 0.65 * i / (len(marks) - 1)
            _body(axes, unit_parts(scene.geometry(name)), frame.units[name], DOCKING_UNIT, opacity)
    _ways(axes, frames)
    _names(axes, scene, frames)
    x, y = extent(scene, frames)
    axes.set(xlabel="x in W [m]", ylabel="y in W [m]", xlim=x, ylim=y, aspect="equal")
    axes.grid(True, color="#e4e7ea", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=8)
    if title:
        axes.set_title("from above: " + ", ".join(name for name, _ in marks), fontsize=9)


def extent(scene: Scene, frames: Sequence[Snapshot]) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the ranges of x and y in W [m] that hold every body at every instant, and the planned paths."""
    reach = {name: scene.geometry(name).circumradius for name in scene.units}
    reach |= {name: spec.radius_m for name, spec in scene.obstacles.items()}
    discs = {
        (X.x, X.y, reach[name])
        for frame in (frames[0], *frames[:: max(1, len(frames) // 200)], frames[-1])
        for name, X in (*frame.units.items(), *frame.obstacles.items())
    }
    discs |= {(x, y, 0.0) for path in planned_paths(frames) for x, y in path.points}
    x, y, r = np.array(sorted(discs)).T
    low = np.min(x - r) - MARGIN, np.min(y - r) - MARGIN
    high = np.max(x + r) + MARGIN, np.max(y + r) + MARGIN
    return (float(low[0]), float(high[0])), (float(low[1]), float(high[1]))


def _marks(frames: Sequence[Snapshot]) -> list[tuple[str, Snapshot]]:
    """Return the instants at which docking units are drawn: start, hand-over, end of failed attempts, end."""
    marks = [("start", frames[0])]
    for before, after in pairwise(frames):
        if before.step != after.step and after.step is not None:
            marks.append((f"start of {after.step.unit}", after))
        elif before.phase is Phase.ASSEMBLE and after.phase is Phase.HAND_OVER:
            marks.append(("hand-over", after))
        elif before.phase in _RUN and after.phase in _BACK:
            marks.append((f"end of attempt {before.attempt}", before))
    return [*marks, ("end", frames[-1])]


def _ways(axes: Axes, frames: Sequence[Snapshot]) -> None:
    for i, path in enumerate(planned_paths(frames)):
        points = np.array(path.points)
        label = None if i else "planned"
        axes.plot(*points.T, color=css(PLAN), linestyle="--", linewidth=1.2, label=label)
    for poses, colour, width, label in (
        ([acting_pose(f) for f in frames], PATH, 2.2, "driven (truth)"),
        ([f.estimate for f in frames], BELIEF, 1.1, "believed"),
    ):
        points = np.array([(X.x, X.y) if X else (np.nan, np.nan) for X in poses])
        # From one step of the plan to the next another unit takes over: no line joins the two.
        for i, (a, b) in enumerate(pairwise(frames)):
            if a.step != b.step:
                points[i] = np.nan
        axes.plot(*points.T, color=css(colour), linewidth=width, label=label)
    axes.legend(loc="best", fontsize=8, framealpha=0.9)


def _names(axes: Axes, scene: Scene, frames: Sequence[Snapshot]) -> None:
    for name, X in frames[0].units.items():
        axes.annotate(name, (X.x, X.y), ha="center", va="center", fontsize=10, fontweight="bold")
    (low, high), _ = extent(scene, frames)
    for name, X in frames[-1].obstacles.items():
        spec = scene.obstacles[name]
        words = name if spec.tag_id is None else f"{name} (tag {spec.tag_id})"
        side = 1.0 if X.x < 0.5 * (low + high) else -1.0  # towards the middle, where there is room
        place = (X.x + side * (spec.radius_m + 0.02), X.y)
        axes.annotate(
            words,
            place,
            ha="left" if side > 0.0 else "right",
            va="center",
            fontsize=7,
            bbox={"facecolor": "white", "alpha": 0.6, "linewidth": 0.0, "pad": 0.5},
        )


def _body(axes: Axes, parts: Sequence[Part], X_WB: SE2, colour: int, alpha: float) -> None:
    for part in parts:
        patch = _patch(part, X_WB)
        patch.set(facecolor=css(colour), edgecolor=css(DARK), linewidth=0.8, alpha=alpha)
        axes.add_patch(patch)


def _patch(part: Part, X_WB: SE2) -> Polygon | Circle:
    core = X_WB.act(part.core)
    if len(core) == 1:
        return Circle((float(core[0, 0]), float(core[0, 1])), part.radius)
    return Polygon([(float(x), float(y)) for x, y in core])
