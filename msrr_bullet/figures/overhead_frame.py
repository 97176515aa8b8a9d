"""A frame of the camera above the arena with what the robot makes of it drawn on top."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from msrr_bullet.figures.canvas import PAPER, Canvas, Key
from msrr_bullet.figures.drawing import (
    DETECTION_KEY,
    READ_KEY,
    DrawingContext,
    Picture,
    caption,
    heading,
    looked_at,
    prepared,
)
from msrr_bullet.figures.perspective import Perspective, on_floor
from msrr_bullet.figures.schematic import draw_line, ring
from msrr_bullet.timeline.camera_views import CameraView
from msrr_bullet.timeline.palette import BELIEF, CLEARANCE, PATH, PLAN, SIGHT
from msrr_bullet.timeline.snapshot import Snapshot
from msrr_bullet.viewer.scene_graph import SIGHT_RANGE
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.messages import LosStatus

#: Height at which lines are drawn [m]: about that of the tags on top, so that they meet what one sees there.
PLANE = 0.2

_LEGEND = (
    READ_KEY,
    DETECTION_KEY,
    Key(PATH, "docking unit and its way, truth"),
    Key(BELIEF, "where bodies are believed; obstacles: circle about their footprint"),
    Key(PLAN, "planned path and desired point", dashed=True),
    Key(CLEARANCE, "smallest clearance"),
    Key(SIGHT, "line of sight"),
)


def draw_overhead(
    stagecraft: DrawingContext, view: CameraView, moment: Snapshot, past: Sequence[Snapshot]
) -> Picture:
    """Draw on a frame of the camera above the arena.

    Args:
        stagecraft: What to draw with.
        view: The frame.
        moment: The trial at the time of exposure.
        past: The trial up to then.
    """
    look = Perspective.overhead(stagecraft.scene)
    canvas = prepared(stagecraft, view, look, moment)
    _plan(canvas, look, moment)
    if moment.step is not None:
        unit = moment.step.unit
        driven = [f.units[unit].translation for f in past if f.step == moment.step]
        points = [*driven, moment.units[unit].translation]
        draw_line(canvas, look, on_floor(points, PLANE), PATH, 2)
        _outline(canvas, look, stagecraft, unit, moment.units[unit], PATH, 2)
    _belief(canvas, look, stagecraft, moment)
    _sight(canvas, look, stagecraft, moment)
    if moment.clearance is not None and moment.clearance.distance > 0.0:
        a, b = on_floor([moment.clearance.point_a, moment.clearance.point_b], PLANE)
        draw_line(canvas, look, np.stack([a, b]), CLEARANCE, 2)
        words = f"{1e3 * moment.clearance.distance:.0f} mm"
        canvas.text(look.pixels(0.5 * (a + b)[None])[0], words, CLEARANCE)
    title = (*heading(stagecraft, view, moment), looked_at(view) + _tracking(moment))
    return Picture(view.stamp_ns, canvas.image, title, caption(view, moment), _LEGEND)


def _outline(
    canvas: Canvas,
    look: Perspective,
    stagecraft: DrawingContext,
    unit: str,
    X_WU: SE2,
    colour: int,
    width: int,
    dashed: bool = False,
) -> None:
    """Outline a unit as the camera sees it, its body and the tag on top."""
    solids, X = stagecraft.solids[unit], SE3.from_se2(X_WU)
    canvas.line(look.hull(X.act(solids.points)), colour, width, closed=True, dashed=dashed)
    for X_WT, _, square in solids.squares(X_WU):
        if look.faces(X_WT) and X_WT.R[2, 2] < -0.5:
            canvas.line(look.pixels(square), colour, 1, closed=True)


def _belief(canvas: Canvas, look: Perspective, stagecraft: DrawingContext, moment: Snapshot) -> None:
    if moment.estimate is not None and moment.step is not None:
        _outline(canvas, look, stagecraft, moment.step.unit, moment.estimate, BELIEF, 1)
    if moment.situation is None:
        return
    for other in (moment.situation.target, *moment.situation.others):
        _outline(canvas, look, stagecraft, other.name, other.X_WB, BELIEF, 1)
    avoiding = moment.assembly.avoiding if moment.assembly else None
    for obstacle in moment.situation.obstacles:
        avoided = obstacle.name == avoiding
        draw_line(canvas, look, ring(obstacle.X_WB, obstacle.radius, PLANE), BELIEF, 3 if avoided else 2)
        edge = obstacle.X_WB.translation - np.array([0.0, obstacle.radius + 0.07])
        words = f"{obstacle.name} (avoided)" if avoided else obstacle.name
        canvas.text(look.pixels(on_floor(edge, PLANE))[0], words, BELIEF)


def _plan(canvas: Canvas, look: Perspective, moment: Snapshot) -> None:
    if moment.assembly is None:
        return
    if moment.path is not None and len(moment.path.points) > 1:
        draw_line(canvas, look, on_floor(moment.path.points, PLANE), PLAN, 2, dashed=True, halo=PAPER)
    tip, desired = look.pixels(on_floor([moment.assembly.tip, moment.assembly.desired], PLANE))
    canvas.line([tip, desired], PLAN, 1)
    canvas.dot(desired, PLAN, 5.0, halo=PAPER)
    canvas.dot(tip, BELIEF, 3.5, halo=PAPER)


def _sight(canvas: Canvas, look: Perspective, stagecraft: DrawingContext, moment: Snapshot) -> None:
    """Draw where the unit believes the edges of its target, as lines on the floor from below its camera."""
    if moment.los is None or moment.estimate is None or moment.step is None:
        return
    if moment.los.status is LosStatus.LOST:
        return
    X_WF = moment.estimate @ stagecraft.scene.geometry(moment.step.unit).frame("camera").to_se2()
    dashed = moment.los.status is LosStatus.PREDICTED
    for angle in (moment.los.left, moment.los.right):
        ends = X_WF.act([[0.0, 0.0], [SIGHT_RANGE * math.cos(angle), SIGHT_RANGE * math.sin(angle)]])
        draw_line(canvas, look, on_floor(ends, PLANE), SIGHT, 1, dashed=dashed)


def _tracking(moment: Snapshot) -> str:
    if moment.assembly is None or moment.path is None:
        return ""
    tip, desired = np.array(moment.assembly.tip), np.array(moment.assembly.desired)
    off = 1e3 * float(np.linalg.norm(tip - desired))
    path = f"path {moment.path.number} ({moment.path.shape})"
    return f"; {path}, {moment.assembly.s:.2f} of {moment.assembly.length:.2f} m, {off:.0f} mm off"
