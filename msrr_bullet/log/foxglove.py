"""The well-known Foxglove messages that fit, in JSON, so that Foxglove shows a log without a plugin.

They are for looking at. What is computed from a log is read from the exact copy of the message that each of
them carries under the extra key ``msrr``.
(https://docs.foxglove.dev/docs/visualization/message-schemas/introduction)
"""

from __future__ import annotations

from msrr_bullet.log.codec import Json, number
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.messages import NS_PER_S

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
    p, q = (
        map(number, X.p),
        map(number, X.quaternion_xyzw()),
    )  # a filter that diverged is logged like any other
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
    """Return ``foxglove.PoseInFrame`` of a pose seen from ``frame``."""
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
    """Return ``foxglove.Log``."""
    return {
        "timestamp": time(stamp_ns),
        "level": level,
        "message": text,
        "name": source,
        "file": "",
        "line": 0,
    }
