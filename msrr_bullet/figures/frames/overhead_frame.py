"""Annotated frame of the overhead camera: ways, plans, estimates, clearance, line of sight, the mission."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from msrr_bullet.figures.drawing.canvas import PAPER, Key
from msrr_bullet.figures.drawing.mission_marks import docked_pairs, driven_way, name_of
from msrr_bullet.figures.drawing.perspective import Perspective, on_floor
from msrr_bullet.figures.drawing.schematic import Drawing, ring
from msrr_bullet.figures.frames.annotation import (
    DETECTION_KEY,
    READ_KEY,
    AnnotatedFrame,
    DrawingContext,
    annotate,
    draw_frame,
)
from msrr_bullet.timeline.camera_views import CameraView
from msrr_bullet.timeline.mission_snapshot import MissionSnapshot
from msrr_bullet.timeline.palette import ALARM, BELIEF, BLACK, CLEARANCE, DARK, PATH, PLAN, SIGHT, SIGHT_RANGE
from msrr_bullet.timeline.routes import part_of
from msrr_bullet.timeline.snapshot import Snapshot, step_histories
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.messages import LosStatus

#: Size of the names of the units of a mission.
NAME_SCALE = 0.85
#: Every which snapshot is a point of a driven way, of which there are many in every frame of a film.
_WAY_EVERY = 5

_LEGEND = (
    READ_KEY,
    DETECTION_KEY,
    Key(PATH, "docking units and their ways, truth"),
    Key(BELIEF, "where bodies are believed to be; obstacles: circle about their footprint"),
    Key(PLAN, "planned path and desired point", dashed=True),
    Key(CLEARANCE, "smallest clearance"),
    Key(SIGHT, "line of sight"),
)

#: What all pictures of a mission of a base station show, whose units have colours of their own.
MISSION_KEYS = (
    Key(DARK, "way of a unit, truth"),
    Key(DARK, "its route, thick as far as it is granted", dashed=True),
    Key(ALARM, "waits for"),
    Key(BLACK, "docked pair"),
    Key(CLEARANCE, "smallest clearance"),
)
_MISSION_LEGEND = (
    READ_KEY,
    DETECTION_KEY,
    *MISSION_KEYS,
    Key(BELIEF, "where units under way believe they are; obstacles: circle about their footprint"),
)


def draw_overhead(
    context: DrawingContext, view: CameraView, snapshot: Snapshot, past: Sequence[Snapshot]
) -> AnnotatedFrame:
    """Annotate a frame of the overhead camera, with the trial at the time of exposure and up to it."""
    perspective = Perspective.overhead(context.scene, context.built)
    drawing = draw_frame(context, view, perspective, snapshot)
    if snapshot.mission is not None:
        _draw_mission(drawing, context, snapshot, snapshot.mission, past)
    else:
        _draw_steps(drawing, context, snapshot, past)
    if snapshot.clearance is not None and snapshot.clearance.distance > 0.0:
        a, b = on_floor([snapshot.clearance.point_a, snapshot.clearance.point_b], context.top_tags_m)
        drawing.line(np.stack([a, b]), CLEARANCE, 2)
        text = f"{1e3 * snapshot.clearance.distance:z.0f} mm"
        drawing.canvas.text(drawing.perspective.pixels(0.5 * (a + b)[None])[0], text, CLEARANCE)
    if snapshot.mission is not None:
        return annotate(context, view, snapshot, drawing, "", _MISSION_LEGEND)
    return annotate(context, view, snapshot, drawing, _path_text(snapshot), _LEGEND)


def _draw_steps(
    drawing: Drawing, context: DrawingContext, snapshot: Snapshot, past: Sequence[Snapshot]
) -> None:
    """Draw the units under way, one after the other."""
    histories = step_histories(past)
    for single in snapshot.apart():
        draw_plan(drawing, single, context.top_tags_m)
        for step in single.steps:
            unit = step.unit
            driven = [at.units[unit].translation for at, _ in histories.get(step.key, ())]
            points = [*driven, single.units[unit].translation]
            drawing.line(on_floor(points, context.top_tags_m), PATH, 2)
            draw_outline(drawing, context, unit, single.units[unit], PATH, 2)
        _draw_belief(drawing, context, single)
        draw_sight(drawing, context, single, context.top_tags_m)


def _draw_mission(
    drawing: Drawing,
    context: DrawingContext,
    snapshot: Snapshot,
    mission: MissionSnapshot,
    past: Sequence[Snapshot],
) -> None:
    """Draw the ways and routes of all units, who waits for whom, and docked pairs."""
    for unit, colour in context.colours.items():
        way = driven_way([*past[::_WAY_EVERY], snapshot], unit)
        drawing.line(on_floor(way, context.top_tags_m), colour, 3, halo=PAPER)
        draw_route(drawing, context, mission, unit, context.top_tags_m)
    for step in snapshot.steps:
        if step.estimate is not None:
            draw_outline(drawing, context, step.unit, step.estimate, BELIEF, 1)
    _draw_obstacle_beliefs(drawing, context, snapshot)
    draw_links(drawing, context, snapshot, mission)
    for unit, colour in context.colours.items():
        X_WU = snapshot.units[unit]
        draw_outline(drawing, context, unit, X_WU, colour, 2)
        middle = drawing.perspective.pixels(on_floor(X_WU.translation, context.top_tags_m))[0]
        below = drawing.perspective.hull(SE3.from_se2(X_WU).act(context.solids[unit].points))[:, 1].max()
        text, ink = name_of(unit, mission)
        drawing.canvas.text([middle[0], below + 28.0 / drawing.canvas.zoom], text, ink, scale=NAME_SCALE)


def draw_route(
    drawing: Drawing, context: DrawingContext, mission: MissionSnapshot, unit: str, plane: float
) -> None:
    """Draw the route of a unit that is under way, thick as far as it is granted."""
    authority = mission.granted(unit)
    if authority is None:
        return
    route, colour = context.routes.of(authority), context.colours[unit]
    ahead = on_floor(part_of(route, mission.of(unit).progress, authority.limit), plane)
    drawing.line(ahead, colour, 5, dashed=True, halo=PAPER)
    beyond = on_floor(part_of(route, authority.limit, mission.of(unit).length), plane)
    drawing.line(beyond, colour, 1, dashed=True)


def draw_links(
    drawing: Drawing, context: DrawingContext, snapshot: Snapshot, mission: MissionSnapshot
) -> None:
    """Draw a bar across every docked pair, and an arrow from a unit that waits to the one it waits for."""
    for ends in docked_pairs(context.scene, snapshot).values():
        drawing.line(on_floor(ends, context.top_tags_m), BLACK, 4, halo=PAPER)
    for unit, X_WU in snapshot.units.items():
        other = mission.waits_for(unit)
        if other is not None:
            ends = on_floor([X_WU.translation, snapshot.units[other].translation], context.top_tags_m)
            start, end = drawing.perspective.pixels(ends)
            drawing.canvas.arrow(start, end, ALARM, halo=PAPER)


def draw_outline(
    drawing: Drawing, context: DrawingContext, unit: str, X_WU: SE2, colour: int, width: int
) -> None:
    """Outline the body of a unit and its top tag as the camera sees them."""
    solids, X = context.solids[unit], SE3.from_se2(X_WU)
    drawing.canvas.line(drawing.perspective.hull(X.act(solids.points)), colour, width, closed=True)
    for X_WT, _, square in solids.squares(X_WU):
        if drawing.perspective.sees_front(X_WT) and X_WT.R[2, 2] < -0.5:
            drawing.canvas.line(drawing.perspective.pixels(square), colour, 1, closed=True)


def _draw_belief(drawing: Drawing, context: DrawingContext, snapshot: Snapshot) -> None:
    first = snapshot.first
    if first.estimate is not None and first.step is not None:
        draw_outline(drawing, context, first.step.unit, first.estimate, BELIEF, 1)
    if first.situation is None:
        return
    target = () if first.situation.target is None else (first.situation.target,)
    for other in (*target, *first.situation.others):
        draw_outline(drawing, context, other.name, other.X_WB, BELIEF, 1)
    _draw_obstacle_beliefs(drawing, context, snapshot)


def _draw_obstacle_beliefs(drawing: Drawing, context: DrawingContext, snapshot: Snapshot) -> None:
    """Draw a circle about the believed footprint of every obstacle, with its name."""
    situation, assembly = snapshot.first.situation, snapshot.first.assembly
    if situation is None:
        return
    avoiding = assembly.avoiding if assembly else None
    for obstacle in situation.obstacles:
        avoided = obstacle.name == avoiding
        drawing.line(ring(obstacle.X_WB, obstacle.radius, context.top_tags_m), BELIEF, 3 if avoided else 2)
        edge = obstacle.X_WB.translation - np.array([0.0, obstacle.radius + 0.07])
        text = f"{obstacle.name} (avoided)" if avoided else obstacle.name
        drawing.canvas.text(drawing.perspective.pixels(on_floor(edge, context.top_tags_m))[0], text, BELIEF)


def draw_plan(drawing: Drawing, snapshot: Snapshot, plane: float) -> None:
    """Draw the planned path of the first step under way, with its desired point and the controlled one."""
    assembly, path = snapshot.first.assembly, snapshot.first.path
    if assembly is None:
        return
    if path is not None and len(path.points) > 1:
        drawing.line(on_floor(path.points, plane), PLAN, 2, dashed=True, halo=PAPER)
    tip, desired = drawing.perspective.pixels(on_floor([assembly.tip, assembly.desired], plane))
    drawing.canvas.line([tip, desired], PLAN, 1)
    drawing.canvas.dot(desired, PLAN, 5.0, halo=PAPER)
    drawing.canvas.dot(tip, BELIEF, 3.5, halo=PAPER)


def draw_sight(drawing: Drawing, context: DrawingContext, snapshot: Snapshot, plane: float) -> None:
    """Draw the angles of the target's edges as lines from the estimated position of the camera."""
    first = snapshot.first
    if first.los is None or first.estimate is None or first.step is None:
        return
    if first.los.status is LosStatus.LOST:
        return
    X_WF = first.estimate @ context.scene.geometry(first.step.unit).frame("camera").to_se2()
    dashed = first.los.status is LosStatus.PREDICTED
    for angle in (first.los.left, first.los.right):
        ends = X_WF.act([[0.0, 0.0], [SIGHT_RANGE * math.cos(angle), SIGHT_RANGE * math.sin(angle)]])
        drawing.line(on_floor(ends, plane), SIGHT, 1, dashed=dashed)


def _path_text(snapshot: Snapshot) -> str:
    first = snapshot.first
    if first.path is None or first.assembly is None:
        return ""
    return f"path {first.path.number} ({first.path.shape}), {first.path_text}"
