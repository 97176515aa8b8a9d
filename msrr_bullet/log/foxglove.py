"""Messages of Foxglove's schemas in protobuf, built by its SDK, from values of this project.

Source: https://docs.foxglove.dev/docs/sdk/schemas
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from foxglove.messages import (
    CameraCalibration,
    Color,
    CompressedImage,
    CubePrimitive,
    CylinderPrimitive,
    FrameTransform,
    LinePrimitive,
    LinePrimitiveLineType,
    Log,
    LogLevel,
    Point2,
    Point3,
    PointsAnnotation,
    PointsAnnotationType,
    Pose,
    PoseInFrame,
    Quaternion,
    SceneEntity,
    SpherePrimitive,
    TextAnnotation,
    Timestamp,
    Vector3,
)

from msrr_bullet.log.records import Event, Level
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.lens import Lens
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.solid import Solid
from msrr_scenes.messages import NS_PER_S

_LEVELS = {
    Level.DEBUG: LogLevel.Debug,
    Level.INFO: LogLevel.Info,
    Level.WARNING: LogLevel.Warning,
    Level.ERROR: LogLevel.Error,
}

#: Width of lines on the floor, and in images [m, px].
_LINE_M, _LINE_PX = 0.01, 1.5


def colour(rgb: int, opacity: float = 1.0) -> Color:
    """Return a colour from ``0xRRGGBB``."""
    r, g, b = (float(rgb >> shift & 255) / 255.0 for shift in (16, 8, 0))
    return Color(r=r, g=g, b=b, a=opacity)


def timestamp(stamp_ns: int) -> Timestamp:
    """Return a simulated time."""
    return Timestamp(stamp_ns // NS_PER_S, stamp_ns % NS_PER_S)


def _vector(xyz: Iterable[float]) -> Vector3:
    x, y, z = xyz
    return Vector3(x=float(x), y=float(y), z=float(z))


def _quaternion(X: SE2 | SE3) -> Quaternion:
    if isinstance(X, SE2):
        return Quaternion(x=0.0, y=0.0, z=math.sin(0.5 * X.yaw), w=math.cos(0.5 * X.yaw))
    x, y, z, w = X.quaternion_xyzw().tolist()
    return Quaternion(x=x, y=y, z=z, w=w)


def _place(X: SE2 | SE3) -> Vector3:
    return Vector3(x=X.x, y=X.y, z=0.0) if isinstance(X, SE2) else _vector(X.p.tolist())


def pose(X: SE2 | SE3) -> Pose:
    """Return a pose."""
    return Pose(position=_place(X), orientation=_quaternion(X))


def frame_transform(stamp_ns: int, parent: str, child: str, X: SE2 | SE3) -> FrameTransform:
    """Return ``X_parent_child``."""
    return FrameTransform(
        timestamp=timestamp(stamp_ns),
        parent_frame_id=parent,
        child_frame_id=child,
        translation=_place(X),
        rotation=_quaternion(X),
    )


def pose_in_frame(stamp_ns: int, frame: str, X: SE2) -> PoseInFrame:
    """Return a pose in ``frame``."""
    return PoseInFrame(timestamp=timestamp(stamp_ns), frame_id=frame, pose=pose(X))


def compressed_image(stamp_ns: int, frame: str, png: bytes) -> CompressedImage:
    """Return a PNG file as an image of the camera whose optical frame is ``frame``."""
    return CompressedImage(timestamp=timestamp(stamp_ns), frame_id=frame, data=png, format="png")


def camera_calibration(frame: str, lens: Lens) -> CameraCalibration:
    """Return what a robot is told of its camera."""
    camera, d = lens.camera, lens.distortion
    K = [camera.focal, 0.0, camera.cx, 0.0, camera.focal * d.aspect, camera.cy, 0.0, 0.0, 1.0]
    return CameraCalibration(
        timestamp=timestamp(0),
        frame_id=frame,
        width=camera.width,
        height=camera.height,
        distortion_model="plumb_bob",
        D=[d.k1, d.k2, d.p1, d.p2, d.k3],
        K=K,
        R=np.eye(3).ravel().tolist(),
        P=[*K[:3], 0.0, *K[3:6], 0.0, *K[6:], 0.0],
    )


def log_line(event: Event) -> Log:
    """Return an event as a line of a log."""
    return Log(
        timestamp=timestamp(event.stamp_ns),
        level=_LEVELS[event.level],
        message=event.text,
        name=event.source,
    )


def line(stamp_ns: int, pixels: Array, shade: Color, *, closed: bool = False) -> PointsAnnotation:
    """Return a line through pixels, shape (N, 2), in an image."""
    return PointsAnnotation(
        timestamp=timestamp(stamp_ns),
        type=PointsAnnotationType.LineLoop if closed else PointsAnnotationType.LineStrip,
        points=[Point2(x=u, y=v) for u, v in pixels.tolist()],
        outline_color=shade,
        thickness=_LINE_PX,
    )


def label(stamp_ns: int, pixel: Array, text: str, shade: Color) -> TextAnnotation:
    """Return a text at a pixel, shape (2,), in an image."""
    u, v = pixel.tolist()
    return TextAnnotation(
        timestamp=timestamp(stamp_ns),
        position=Point2(x=u, y=v),
        text=text,
        font_size=12.0,
        text_color=shade,
        background_color=colour(0xFFFFFF, 0.6),
    )


def line_entity(
    stamp_ns: int, name: str, frame: str, points: Array, shade: Color, *, closed: bool = False
) -> SceneEntity:
    """Return a line in space, through points of shape (N, 3) [m] in ``frame``."""
    kind = LinePrimitiveLineType.LineLoop if closed else LinePrimitiveLineType.LineStrip
    line = LinePrimitive(
        type=kind,
        pose=pose(SE3()),
        thickness=_LINE_M,
        points=[Point3(x=x, y=y, z=z) for x, y, z in points.tolist()],
        color=shade,
    )
    return SceneEntity(timestamp=timestamp(stamp_ns), frame_id=frame, id=name, lines=[line])


def solids_entity(stamp_ns: int, body: str, solids: Iterable[Solid], shade: Color) -> SceneEntity:
    """Return the shape of a body in its frame: boxes, cylinders, spheres, and of a mesh the box about it."""
    cubes, cylinders, spheres = [], [], []
    for solid in solids:
        X = solid.X_UG
        if solid.kind == "cylinder":
            radius, length = solid.size
            size = _vector((2.0 * radius, 2.0 * radius, length))
            cylinders.append(
                CylinderPrimitive(pose=pose(X), size=size, bottom_scale=1.0, top_scale=1.0, color=shade)
            )
        elif solid.kind == "sphere":
            spheres.append(
                SpherePrimitive(pose=pose(X), size=_vector([2.0 * solid.size[0]] * 3), color=shade)
            )
        elif solid.kind == "box":
            cubes.append(CubePrimitive(pose=pose(X), size=_vector(solid.size), color=shade))
        else:
            points = solid.points()
            low, high = points.min(axis=0), points.max(axis=0)
            middle = SE3(p=0.5 * (low + high))
            cubes.append(CubePrimitive(pose=pose(middle), size=_vector((high - low).tolist()), color=shade))
    return SceneEntity(
        timestamp=timestamp(stamp_ns),
        frame_id=body,
        id=body,
        frame_locked=True,
        cubes=cubes,
        cylinders=cylinders,
        spheres=spheres,
    )
