"""A frame of the docking unit's camera with what the robot makes of it drawn on top."""

from __future__ import annotations

import math

import numpy as np

from msrr_bullet.figures.canvas import Canvas, Key
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
from msrr_bullet.figures.perspective import Perspective
from msrr_bullet.timeline.camera_views import CameraView
from msrr_bullet.timeline.palette import BELIEF, SIGHT
from msrr_bullet.timeline.snapshot import Snapshot
from msrr_perception.pose.target import TargetModel
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.messages import LosObservation, LosStatus

#: Colour of the bounds of the line-of-sight cone.
CONE = 0x37424D

_LEGEND = (
    READ_KEY,
    DETECTION_KEY,
    Key(BELIEF, "tags where the estimate has them"),
    Key(SIGHT, "edges of the target, seen"),
    Key(SIGHT, "predicted", dashed=True),
    Key(CONE, "line-of-sight cone, outer"),
    Key(CONE, "inner", dashed=True),
)


def draw_onboard(stagecraft: DrawingContext, view: CameraView, moment: Snapshot) -> Picture:
    """Draw on a frame of the docking unit's camera.

    Args:
        stagecraft: What to draw with.
        view: The frame.
        moment: The trial at the time of exposure.
    """
    scene, step = stagecraft.scene, moment.step
    unit = view.exposure.camera.partition("/")[0]
    look = Perspective.onboard(scene, unit, moment.units[unit])
    canvas = prepared(stagecraft, view, look, moment)
    for limit, dashed in ((scene.los.inner, True), (scene.los.outer, False)):
        for side in (1.0, -1.0):
            _upright(canvas, view, side * limit, CONE, 2, dashed)
    if step is not None and step.unit == unit:
        target = stagecraft.targets[step]
        if moment.estimate is not None:
            X_WD = moment.units[step.target_unit] @ scene.geometry(step.target_unit).dock_frame(
                step.target_port
            )
            _believed_tags(canvas, target, X_WD.inverse() @ moment.estimate)
        if moment.los is not None and moment.los.status is not LosStatus.LOST:
            dashed = moment.los.status is LosStatus.PREDICTED
            for angle in (moment.los.left, moment.los.right):
                _upright(canvas, view, angle, SIGHT, 2, dashed)
    title = (*heading(stagecraft, view, moment), f"{looked_at(view)}; {_sight(moment.los)}")
    return Picture(view.stamp_ns, canvas.image, title, caption(view, moment), _LEGEND)


def _upright(canvas: Canvas, view: CameraView, angle: float, colour: int, width: int, dashed: bool) -> None:
    """Draw the upright line that lies at a horizontal ``angle`` [rad] from the axis of a level camera."""
    if not math.isfinite(angle) or abs(angle) >= 0.5 * math.pi:
        return
    column = view.camera.cx - view.camera.focal * math.tan(angle)
    ends = [[column, -0.5], [column, view.camera.height - 0.5]]
    canvas.line(ends, colour, width, dashed=dashed)


def _believed_tags(canvas: Canvas, target: TargetModel, X_DU: SE2) -> None:
    """Outline the tags that would face the camera if the estimate were true."""
    X_CD = target.X_CU @ SE3.from_se2(X_DU.inverse())
    look = Perspective(target.camera, X_CD.inverse())
    for corners_D in target.corners_D.values():
        bottom_left, bottom_right, _, top_left = corners_D
        into = np.cross(bottom_right - bottom_left, bottom_left - top_left)  # x right, y down: z into the tag
        seen = look.pixels(corners_D)
        if float(into @ (corners_D.mean(axis=0) - look.X_WC.p)) > 0.0 and np.isfinite(seen).all():
            canvas.line(seen, BELIEF, 1, closed=True)


def _sight(los: LosObservation | None) -> str:
    if los is None or los.status is LosStatus.LOST:
        return "line of sight lost"
    left, right = math.degrees(los.left), math.degrees(los.right)
    return f"line of sight {los.status.value}, {left:+.1f} to {right:+.1f} deg"
