"""Format of every message type in a log: its schema, and the conversion to JSON and back."""

from __future__ import annotations

import binascii
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from msrr_bullet.log import foxglove, topics
from msrr_bullet.log.codec import Json, LogError, codec, log_name
from msrr_bullet.log.records import (
    BuiltErrors,
    CameraWindow,
    ClearanceRecord,
    Event,
    FrameLinks,
    RadioReceipt,
    StartPoses,
    StepStart,
    TruePose,
)
from msrr_scenes.errors import UnknownNameError
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.messages import (
    Action,
    ArenaEstimate,
    AssemblyPath,
    AssemblyProgress,
    Belief,
    CollisionMonitorState,
    Detections,
    Exposure,
    GlobalPose,
    Localisation,
    LockFeedback,
    LosObservation,
    ObstacleEstimate,
    Pixels,
    PoseEstimate,
    PoseMeasurement,
    SeatSwitches,
    WheelOdometry,
)
from msrr_scenes.messages.coordination import Authority, MissionStatus, UnitReport


@dataclass(frozen=True, slots=True)
class Format:
    """Format of one message type.

    Attributes:
        kind: Message class.
        schema_name: Name of the JSON Schema: ``msrr.<class>`` or that of a well-known Foxglove message.
        schema: JSON Schema.
        encode: Conversion of (message, topic) to JSON.
        decode: Conversion of JSON to a message.
    """

    kind: type
    schema_name: str
    schema: dict[str, Json]
    encode: Callable[[Any, str], Json]
    decode: Callable[[Json], Any]


def _plain(kind: type) -> Format:
    own = codec(kind)
    return Format(kind, f"msrr.{log_name(kind)}", own.schema, lambda m, _: own.encode(m), own.decode)


def _well_known(kind: type, name: str, to_foxglove: Callable[[Any, str], dict[str, Json]]) -> Format:
    own = codec(kind)
    return Format(
        kind,
        name,
        foxglove.schema(name, own.schema),
        lambda m, topic: {**to_foxglove(m, topic), "msrr": own.encode(m)},
        lambda value: own.decode(value["msrr"]),
    )


def _estimate_to_foxglove(m: PoseEstimate, topic: str) -> dict[str, Json]:
    return foxglove.pose_in_frame(m.stamp_ns, foxglove.target_frame(topics.unit_of(topic)), m.X_DU)


def _body_to_foxglove(m: GlobalPose | ObstacleEstimate, topic: str) -> dict[str, Json]:
    return foxglove.pose_in_frame(m.stamp_ns, foxglove.WORLD, m.X_WB)


def _links_to_foxglove(m: FrameLinks, topic: str) -> dict[str, Json]:
    return {"transforms": [foxglove.frame_transform(m.stamp_ns, a.parent, a.child, a.X) for a in m.links]}


def to_png(pixels: Pixels) -> bytes:
    """Return mono8 pixels as PNG. The compression level is low because sensor noise hardly compresses."""
    encoded, data = cv2.imencode(".png", pixels, [cv2.IMWRITE_PNG_COMPRESSION, 1])
    if not encoded:
        raise LogError(f"cannot write an image of {pixels.dtype} and shape {pixels.shape} as PNG")
    return data.tobytes()


def from_png(data: bytes) -> Pixels:
    """Return the mono8 pixels of a PNG file."""
    pixels = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), cv2.IMREAD_GRAYSCALE)
    if pixels is None:
        raise LogError("an image in the log is not a PNG file")
    return pixels.astype(np.uint8, copy=False)


_EXPOSURE, _WINDOW = codec(Exposure), codec(Window)


def _encode_window(m: CameraWindow, topic: str) -> Json:
    data = binascii.b2a_base64(to_png(m.pixels), newline=False).decode("ascii")
    return {
        **foxglove.compressed_image(m.exposure.stamp_ns, m.exposure.camera, data),
        "msrr": {"exposure": _EXPOSURE.encode(m.exposure), "window": _WINDOW.encode(m.window)},
    }


def _decode_window(value: Json) -> CameraWindow:
    exact = value["msrr"]
    window = _WINDOW.decode(exact["window"])
    pixels = from_png(binascii.a2b_base64(value["data"]))
    if pixels.shape != (window.height, window.width):
        raise LogError(
            f"a window of {window.width} x {window.height} pixels holds an image of {pixels.shape}"
        )
    return CameraWindow(_EXPOSURE.decode(exact["exposure"]), window, pixels)


_WINDOW_PARTS: dict[str, Json] = {
    "type": "object",
    "properties": {"exposure": _EXPOSURE.schema, "window": _WINDOW.schema},
}

_FORMATS: dict[type, Format] = {
    f.kind: f
    for f in (
        *map(_plain, (WheelOdometry, SeatSwitches, LockFeedback, PoseMeasurement, Detections, Exposure)),
        *map(_plain, (Localisation, LosObservation, ArenaEstimate, Action, AssemblyProgress, AssemblyPath)),
        *map(_plain, (Belief, CollisionMonitorState, ClearanceRecord, StepStart, StartPoses, BuiltErrors)),
        *map(_plain, (Authority, UnitReport, MissionStatus, RadioReceipt)),
        _well_known(PoseEstimate, "foxglove.PoseInFrame", _estimate_to_foxglove),
        _well_known(GlobalPose, "foxglove.PoseInFrame", _body_to_foxglove),
        _well_known(ObstacleEstimate, "foxglove.PoseInFrame", _body_to_foxglove),
        _well_known(
            TruePose,
            "foxglove.FrameTransform",
            lambda m, _: foxglove.frame_transform(m.stamp_ns, foxglove.WORLD, m.name, m.X_WB),
        ),
        _well_known(FrameLinks, "foxglove.FrameTransforms", _links_to_foxglove),
        _well_known(
            Event,
            "foxglove.Log",
            lambda m, _: foxglove.log_line(m.stamp_ns, m.level.value, m.source, m.text),
        ),
        Format(
            CameraWindow,
            "foxglove.CompressedImage",
            foxglove.schema("foxglove.CompressedImage", _WINDOW_PARTS),
            _encode_window,
            _decode_window,
        ),
    )
}

_BY_NAME: dict[str, Format] = {log_name(kind): f for kind, f in _FORMATS.items()}


def message_types() -> tuple[type, ...]:
    """Return every message class that a log can hold."""
    return tuple(_FORMATS)


def format_of(message: object) -> Format:
    """Return the format of a message.

    Raises:
        UnknownNameError: Logs hold no messages of this type.
    """
    message_format = _FORMATS.get(type(message))
    if message_format is None:
        raise UnknownNameError("message type", type(message).__name__, _BY_NAME)
    return message_format


def format_named(name: str) -> Format:
    """Return the format of a message class by its name in logs.

    Raises:
        UnknownNameError: There is no such message class.
    """
    if name not in _BY_NAME:
        raise UnknownNameError("message type", name, _BY_NAME)
    return _BY_NAME[name]
