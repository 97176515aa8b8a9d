"""View of the whole scene from a camera that stands still beside and above it."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from msrr_bullet.figures.drawing.canvas import Canvas, Key
from msrr_bullet.figures.drawing.mission_marks import STEP_M, name_of
from msrr_bullet.figures.drawing.perspective import Perspective, Solids, on_floor
from msrr_bullet.figures.drawing.schematic import Drawing, draw_floor, ring
from msrr_bullet.figures.film.body_renderer import BodyRenderer
from msrr_bullet.figures.frames.annotation import AnnotatedFrame, DrawingContext, state_text
from msrr_bullet.figures.frames.overhead_frame import (
    MISSION_KEYS,
    NAME_SCALE,
    draw_links,
    draw_outline,
    draw_plan,
    draw_route,
    draw_sight,
)
from msrr_bullet.timeline.interpolation import SnapshotInterpolator
from msrr_bullet.timeline.palette import BELIEF, CLEARANCE, GRID, PATH, PLAN, SIGHT, VIEW_FROM
from msrr_bullet.timeline.snapshot import Snapshot
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.pinhole import PinholeCamera
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.messages import seconds

#: Horizontal field of view of the camera [rad], and share of the picture that is left free at each edge.
HFOV, MARGIN = math.radians(32.0), 0.06
#: Height above the floor at which ways and plans are drawn, and at which the clearance is, half-way up a unit
#: [m].
FLOOR_Z, CLEARANCE_Z = 0.002, 0.12
#: Distance from the top of a unit to its name [m].
NAME_GAP = 0.04
#: Every which snapshot is looked at to find the extent of the run.
_EXTENT_EVERY = 10

_LEGEND = (
    Key(PATH, "driven way, truth"),
    Key(BELIEF, "where bodies are believed to be"),
    Key(PLAN, "planned path", dashed=True),
    Key(SIGHT, "line of sight"),
    Key(CLEARANCE, "smallest clearance"),
)
#: Legend of a recording, of which nobody knows the truth.
_RECORDING_LEGEND = (Key(BELIEF, "where the robot believes it is, and its way"), Key(SIGHT, "line of sight"))
_MISSION_LEGEND = (*MISSION_KEYS, Key(BELIEF, "where units under way believe they are"))


class SceneView:
    """Draws a run instant by instant, in order of time: the ways grow from one picture to the next."""

    #: Number of lines of the title of a picture.
    LINES = 2

    def __init__(self, context: DrawingContext, trial: SnapshotInterpolator, width: int, height: int) -> None:
        """Place the camera so that it sees all that happens.

        Raises:
            GeometryError: A mesh of a unit cannot be read.
        """
        self._context, self._trial = context, trial
        self._heights = {name: _height(solids) for name, solids in context.solids.items()}
        extent = self._extent(trial.snapshots[::_EXTENT_EVERY] + trial.snapshots[-1:])
        self.perspective = look_at_all(extent, PinholeCamera.from_hfov(width, height, HFOV))
        self._bodies = BodyRenderer(context.scene, context.built)
        self._ground = Drawing(Canvas(width, height, 1, GRID), self.perspective)
        draw_floor(self._ground, context.scene.arena)
        self._upcoming = 0
        self._ends: dict[str, Array] = {}  # of the ways that are drawn, (2,) in W [m]

    @staticmethod
    def legend_of(context: DrawingContext) -> tuple[Key, ...]:
        """Return the legend of the pictures of a run."""
        if context.seed is None:
            return _RECORDING_LEGEND
        return _MISSION_LEGEND if context.scene.coordinated else _LEGEND

    def _extent(self, snapshots: Sequence[Snapshot]) -> Array:
        """Return the corners of boxes around all bodies at some instants, shape (N, 3) in W [m]."""
        places = {(name, X.x, X.y) for s in snapshots for name, X in (*s.shown.items(), *s.obstacles.items())}
        corners = [(i, j, k) for i in (-1.0, 1.0) for j in (-1.0, 1.0) for k in (0.0, 1.0)]
        boxes = {}
        for name, solids in self._context.solids.items():
            radius = float(np.linalg.norm(solids.points[:, :2], axis=1).max())
            boxes[name] = np.array(corners) * [radius, radius, self._heights[name]]
        return np.concatenate([[x, y, 0.0] + boxes[name] for name, x, y in places])

    def draw(self, stamp_ns: int) -> AnnotatedFrame:
        """Return the picture of an instant, which is not before that of the last call."""
        context, perspective, snapshot = self._context, self.perspective, self._trial.at(stamp_ns)
        self._extend_ways(stamp_ns)
        ground = self._ground.canvas.image.copy()
        self._draw_plans(Drawing(Canvas.of(ground), perspective), snapshot)
        poses = {**snapshot.shown, **snapshot.obstacles}
        canvas = Canvas.of(self._bodies.draw(perspective, poses, ground))
        drawing = Drawing(canvas, perspective)
        for step in snapshot.steps:
            if step.estimate is not None:
                draw_outline(drawing, context, step.unit, step.estimate, BELIEF, 1)
        if snapshot.clearance is not None and snapshot.clearance.distance > 0.0:
            ends = on_floor([snapshot.clearance.point_a, snapshot.clearance.point_b], CLEARANCE_Z)
            drawing.line(ends, CLEARANCE, 2)
        if snapshot.mission is not None:
            draw_links(drawing, context, snapshot, snapshot.mission)
        for unit, X_WU in snapshot.shown.items():
            self._write_name(canvas, snapshot, unit, X_WU)
        title = f"{context.origin}    {seconds(stamp_ns):.2f} s"
        lines = title, state_text(context, snapshot)
        return AnnotatedFrame(canvas.image, lines, title, self.legend_of(context))

    def _extend_ways(self, stamp_ns: int) -> None:
        """Draw on the ground what has been driven since the last picture."""
        past = self._trial.until(stamp_ns)
        for snapshot in past[self._upcoming :]:
            self._extend_way(snapshot)
        self._upcoming = len(past)

    def _extend_way(self, snapshot: Snapshot) -> None:
        led = snapshot.mission is not None
        for unit in snapshot.units if led else {step.unit for step in snapshot.steps}:
            X_WU = snapshot.shown.get(unit)
            if X_WU is None:
                continue
            end = self._ends.setdefault(unit, X_WU.translation)
            if math.dist(end, X_WU.translation) >= STEP_M:
                driven = BELIEF if self._context.seed is None else PATH
                colour = self._context.colours[unit] if led else driven
                points = on_floor([end, X_WU.translation], FLOOR_Z)
                self._ground.line(points, colour, 3)
                self._ends[unit] = X_WU.translation

    def _draw_plans(self, ground: Drawing, snapshot: Snapshot) -> None:
        """Draw on the floor what is granted, planned, believed of obstacles, and seen."""
        context = self._context
        if snapshot.mission is not None:
            for unit in context.colours:
                draw_route(ground, context, snapshot.mission, unit, FLOOR_Z)
            _draw_obstacle_beliefs(ground, snapshot)
            return
        for single in snapshot.apart():
            draw_plan(ground, single, FLOOR_Z)
            _draw_obstacle_beliefs(ground, single)
            draw_sight(ground, context, single, FLOOR_Z)

    def _write_name(self, canvas: Canvas, snapshot: Snapshot, unit: str, X_WU: SE2) -> None:
        """Write the name of a unit above its body."""
        top = on_floor(X_WU.translation, self._heights[unit] + NAME_GAP)
        text, ink = name_of(unit, snapshot.mission)
        canvas.text(self.perspective.pixels(top)[0], text, ink, scale=NAME_SCALE)


def _draw_obstacle_beliefs(ground: Drawing, snapshot: Snapshot) -> None:
    for obstacle in () if snapshot.first.situation is None else snapshot.first.situation.obstacles:
        ground.line(ring(obstacle.X_WB, obstacle.radius, FLOOR_Z), BELIEF, 2)


def look_at_all(points_W: Array, camera: PinholeCamera) -> Perspective:
    """Return the camera that sees all points from :data:`VIEW_FROM`, as near as it can.

    The picture of the points is in the middle, with :data:`MARGIN` around it.

    Args:
        points_W: Points, shape (N, 3) in W [m].
        camera: Intrinsics.
    """
    forward = -np.array(VIEW_FROM) / np.linalg.norm(VIEW_FROM)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    R_WC = np.column_stack([right, np.cross(forward, right), forward])
    points = points_W @ R_WC
    # The camera at p sees the slope (x - p_x) / (z - p_z) up to t: x - t z <= p_x - t p_z for every point at
    # one edge of the picture, and the same with -x at the other.
    position = np.zeros(3)
    depth = math.inf
    for axis, pixels in ((0, camera.width), (1, camera.height)):
        t = (0.5 - MARGIN) * pixels / camera.focal
        high = float((points[:, axis] - t * points[:, 2]).max())
        low = float((-points[:, axis] - t * points[:, 2]).max())
        position[axis] = 0.5 * (high - low)
        depth = min(depth, -0.5 * (high + low) / t)
    position[2] = depth
    return Perspective(camera, SE3(R_WC, R_WC @ position))


def _height(solids: Solids) -> float:
    """Return the height of a body with its tags [m]."""
    return max(float(solids.points[:, 2].max()), *(float(tag.X_BT.p[2]) for tag in solids.tags), 0.0)
