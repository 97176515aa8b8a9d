"""Annotated frame of the onboard camera: line of sight, cone, and tags at their estimated positions."""

from __future__ import annotations

import math

import numpy as np

from msrr_bullet.figures.drawing.canvas import Canvas, Key
from msrr_bullet.figures.drawing.perspective import Perspective
from msrr_bullet.figures.frames.annotation import (
    DETECTION_KEY,
    READ_KEY,
    RECORDED_KEY,
    AnnotatedFrame,
    DrawingContext,
    annotate,
    draw_frame,
)
from msrr_bullet.timeline.camera_views import CameraView
from msrr_bullet.timeline.palette import BELIEF, CONE, SIGHT
from msrr_bullet.timeline.snapshot import Snapshot
from msrr_bullet.timeline.snapshot_builder import target_frame
from msrr_perception.pose.target import TargetModel
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.messages import LosObservation, LosStatus, carrier_of

_LEGEND = (
    READ_KEY,
    DETECTION_KEY,
    Key(BELIEF, "tags where the estimate has them"),
    Key(SIGHT, "edges of the target, seen"),
    Key(SIGHT, "predicted", dashed=True),
    Key(CONE, "line-of-sight cone, outer"),
    Key(CONE, "inner", dashed=True),
)


def draw_onboard(context: DrawingContext, view: CameraView, snapshot: Snapshot) -> AnnotatedFrame:
    """Annotate a frame of the onboard camera of a unit, with the trial at the time of exposure."""
    unit = carrier_of(view.exposure.camera) or ""
    snapshot = snapshot.of_unit(unit)
    scene, first, step = context.scene, snapshot.first, snapshot.first.step
    perspective = Perspective.onboard(scene, context.built, unit, snapshot.shown.get(unit, SE2()))
    drawing = draw_frame(context, view, perspective, snapshot)
    canvas = drawing.canvas
    for limit, dashed in ((scene.los.inner, True), (scene.los.outer, False)):
        for side in (1.0, -1.0):
            _draw_vertical(canvas, view, side * limit, CONE, dashed)
    if step is not None:
        target = context.target(step)
        if first.estimate is not None:
            X_DW = target_frame(scene, step, snapshot.units).inverse()
            _draw_believed_tags(canvas, target, X_DW @ first.estimate)
        if first.los is not None and first.los.status is not LosStatus.LOST:
            dashed = first.los.status is LosStatus.PREDICTED
            for angle in (first.los.left, first.los.right):
                _draw_vertical(canvas, view, angle, SIGHT, dashed)
    legend = (RECORDED_KEY, *_LEGEND[1:]) if context.seed is None else _LEGEND
    return annotate(context, view, snapshot, drawing, _los_text(first.los), legend)


def _draw_vertical(canvas: Canvas, view: CameraView, angle: float, colour: int, dashed: bool) -> None:
    """Draw the vertical line at a horizontal ``angle`` [rad] from the axis of a level camera."""
    if not math.isfinite(angle) or abs(angle) >= 0.5 * math.pi:
        return
    column = view.camera.cx - view.camera.focal * math.tan(angle)
    ends = [[column, -0.5], [column, view.camera.height - 0.5]]
    canvas.line(ends, colour, 2, dashed=dashed)


def _draw_believed_tags(canvas: Canvas, target: TargetModel, X_DU: SE2) -> None:
    """Outline the tags that the camera would see from in front if the estimate were exact."""
    X_CD = target.X_CU @ SE3.from_se2(X_DU.inverse())
    perspective = Perspective(target.camera, X_CD.inverse())
    for corners_D in target.corners_D.values():
        bottom_left, bottom_right, _, top_left = corners_D
        inward = np.cross(
            bottom_right - bottom_left, bottom_left - top_left
        )  # x right, y down: z into the tag
        outline = perspective.pixels(corners_D)
        if float(inward @ (corners_D.mean(axis=0) - perspective.X_WC.p)) > 0.0 and np.isfinite(outline).all():
            canvas.line(outline, BELIEF, 1, closed=True)


def _los_text(los: LosObservation | None) -> str:
    if los is None or los.status is LosStatus.LOST:
        return "line of sight lost"
    left, right = math.degrees(los.left), math.degrees(los.right)
    return f"line of sight {los.status.value}, {left:+z.1f} to {right:+z.1f} deg"
