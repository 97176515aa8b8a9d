"""Well-known Foxglove messages in JSON, and the tree of coordinate frames, for viewing a log in Foxglove.

They are for display only. Each carries an exact copy of the project's own message under the extra key
``msrr``, and reading a log uses that copy.
(https://docs.foxglove.dev/docs/visualization/message-schemas/introduction)
"""

from __future__ import annotations

import math

import numpy as np

from msrr_bullet.log.codec import Json, number
from msrr_bullet.log.records import FrameLink, FrameLinks, StepStart
from msrr_scenes.geometry.pinhole import optical_pose
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3, rotation_from_rpy
from msrr_scenes.messages import NS_PER_S
from msrr_scenes.specs.scene import Scene

WORLD = "world"


def _object(**properties: Json) -> dict[str, Json]:
    return {"type": "object", "properties": properties}


_NUMBER = {"type": "number"}
_STRING = {"type": "string"}
_TIME = {"title": "time", **_object(sec={"type": "integer"}, nsec={"type": "integer"})}
_VECTOR = _object(x=_NUMBER, y=_NUMBER, z=_NUMBER)
_QUATERNION = _object(x=_NUMBER, y=_NUMBER, z=_NUMBER, w=_NUMBER)
_TRANSFORM = _object(
    timestamp=_TIME,
    parent_frame_id=_STRING,
    child_frame_id=_STRING,
    translation=_VECTOR,
    rotation=_QUATERNION,
)

SCHEMAS: dict[str, dict[str, Json]] = {
    "foxglove.FrameTransform": _TRANSFORM,
    "foxglove.FrameTransforms": _object(transforms={"type": "array", "items": _TRANSFORM}),
    "foxglove.PoseInFrame": _object(
        timestamp=_TIME, frame_id=_STRING, pose=_object(position=_VECTOR, orientation=_QUATERNION)
    ),
    "foxglove.CompressedImage": _object(
        timestamp=_TIME,
        frame_id=_STRING,
        data={"type": "string", "contentEncoding": "base64"},
        format=_STRING,
    ),
    "foxglove.Log": _object(
        timestamp=_TIME,
        level={"type": "integer"},
        message=_STRING,
        name=_STRING,
        file=_STRING,
        line={"type": "integer"},
    ),
}


def schema(name: str, exact: dict[str, Json]) -> dict[str, Json]:
    """Return the JSON Schema of a well-known message that carries ``exact`` under ``msrr``."""
    known = SCHEMAS[name]
    return {"title": name, **known, "properties": {**known["properties"], "msrr": exact}}


def time(stamp_ns: int) -> Json:
    """Return a time in the form of ``foxglove.Time``."""
    return {"sec": stamp_ns // NS_PER_S, "nsec": stamp_ns % NS_PER_S}


def _parts(X: SE2 | SE3) -> tuple[Json, Json]:
    X = SE3.from_se2(X) if isinstance(X, SE2) else X
    p, q = map(number, X.p), map(number, X.quaternion_xyzw())  # the pose of a diverged filter may be NaN
    return dict(zip("xyz", p, strict=True)), dict(zip("xyzw", q, strict=True))


def frame_transform(stamp_ns: int, parent: str, child: str, X: SE2 | SE3) -> dict[str, Json]:
    """Return ``foxglove.FrameTransform`` of ``X_parent_child``."""
    position, rotation = _parts(X)
    return {
        "timestamp": time(stamp_ns),
        "parent_frame_id": parent,
        "child_frame_id": child,
        "translation": position,
        "rotation": rotation,
    }


def pose_in_frame(stamp_ns: int, frame: str, X: SE2 | SE3) -> dict[str, Json]:
    """Return ``foxglove.PoseInFrame`` of a pose in ``frame``."""
    position, rotation = _parts(X)
    return {
        "timestamp": time(stamp_ns),
        "frame_id": frame,
        "pose": {"position": position, "orientation": rotation},
    }


def compressed_image(stamp_ns: int, frame: str, data_base64: str) -> dict[str, Json]:
    """Return ``foxglove.CompressedImage`` of a PNG file in base64."""
    return {"timestamp": time(stamp_ns), "frame_id": frame, "data": data_base64, "format": "png"}


def log_line(stamp_ns: int, level: int, source: str, text: str) -> dict[str, Json]:
    """Return ``foxglove.Log`` of an event."""
    return {
        "timestamp": time(stamp_ns),
        "level": level,
        "message": text,
        "name": source,
        "file": "",
        "line": 0,
    }


def target_frame(unit: str) -> str:
    """Return the name of the dock frame D of the port to which ``unit`` docks."""
    return f"{unit}/target"


def scene_frames(scene: Scene) -> FrameLinks:
    """Return the frames that are fixed to the units and to the world, from the nominal scene.

    The dock frame D of a port is called ``<unit>.<port>``, as in a plan. The optical frame of a camera has
    the name of the camera.
    """
    links: list[FrameLink] = []
    for unit in scene.units:
        geometry = scene.geometry(unit)
        for port in geometry.ports:
            links.append(FrameLink(unit, f"{unit}.{port}", SE3.from_se2(geometry.dock_frame(port))))
        if geometry.drives:
            links.append(FrameLink(unit, f"{unit}/onboard", optical_pose(geometry.frame("camera"))))
    overhead = scene.cameras.overhead
    if overhead is not None:
        # Image right is world x, image down is world -y: half a turn about x.
        down = rotation_from_rpy(math.pi, 0.0, 0.0)
        position = np.array([overhead.x_m, overhead.y_m, overhead.height_m])
        links.append(FrameLink(WORLD, "overhead", SE3(down, position)))
    return FrameLinks(0, tuple(links))


def step_frames(scene: Scene, start: StepStart) -> FrameLinks:
    """Return the dock frame in which the estimates of a step are given, ``<unit>/target``, if it has one."""
    step = start.step(scene)
    links = () if step is None else (FrameLink(step.to, target_frame(start.unit), SE3()),)
    return FrameLinks(start.stamp_ns, links)
