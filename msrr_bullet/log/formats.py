"""Which message type is written in which form, and read back."""

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
    CameraWindow,
    Clearance,
    Event,
    FrameLinks,
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


@dataclass(frozen=True, slots=True)
class Format:
    """How one message type is written.

    Attributes:
        kind: The message class.
        schema_name: Name of its JSON Schema: ``msrr.<class>`` or a well-known one of Foxglove.
        schema: The JSON Schema.
        encode: (message, topic) to JSON.
        decode: JSON to message.
    """

    kind: type
    schema_name: str
    schema: dict[str, Json]
    encode: Callable[[Any, str], Json]
    decode: Callable[[Json], Any]


def target_frame(unit: str) -> str:
    """Return the name of the dock frame D that ``unit`` is docking to, in the tree of frames."""
    return f"{unit}/target"


def _plain(kind: type) -> Format:
    own = codec(kind)
    return Format(kind, f"msrr.{log_name(kind)}", own.schema, lambda m, _: own.encode(m), own.decode)


def _well_known(kind: type, name: str, show: Callable[[Any, str], dict[str, Json]]) -> Format:
    own = codec(kind)
    return Format(
        kind,
        name,
        foxglove.schema(name, own.schema),
        lambda m, topic: {**show(m, topic), "msrr": own.encode(m)},
        lambda value: own.decode(value["msrr"]),
    )


def _show_estimate(m: PoseEstimate, topic: str) -> dict[str, Json]:
    return foxglove.pose_in_frame(m.stamp_ns, target_frame(topics.unit_of(topic)), m.X_DU)


def _show_body(m: GlobalPose | ObstacleEstimate, topic: str) -> dict[str, Json]:
    return foxglove.pose_in_frame(m.stamp_ns, foxglove.WORLD, m.X_WB)


def _show_links(m: FrameLinks, topic: str) -> dict[str, Json]:
    return {"transforms": [foxglove.frame_transform(m.stamp_ns, a.parent, a.child, a.X) for a in m.links]}


def to_png(pixels: Pixels) -> bytes:
    """Return mono8 pixels as PNG, lossless; little compression, as sensor noise hardly gives way to it."""
    done, data = cv2.imencode(".png", pixels, [cv2.IMWRITE_PNG_COMPRESSION, 1])
    if not done:
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
        *map(_plain, (Belief, Clearance, StepStart, StartPoses)),
        _well_known(PoseEstimate, "foxglove.PoseInFrame", _show_estimate),
        _well_known(GlobalPose, "foxglove.PoseInFrame", _show_body),
        _well_known(ObstacleEstimate, "foxglove.PoseInFrame", _show_body),
        _well_known(
            TruePose,
            "foxglove.FrameTransform",
            lambda m, _: foxglove.frame_transform(m.stamp_ns, foxglove.WORLD, m.name, m.X_WB),
        ),
        _well_known(FrameLinks, "foxglove.FrameTransforms", _show_links),
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
    """Return every type that a log can hold."""
    return tuple(_FORMATS)


def format_of(message: object) -> Format:
    """Return the format of a message.

    Raises:
        UnknownNameError: No log holds messages of this type.
    """
    found = _FORMATS.get(type(message))
    if found is None:
        raise UnknownNameError("message type", type(message).__name__, _BY_NAME)
    return found


def format_named(name: str) -> Format:
    """Return the format of the message class called ``name``.

    Raises:
        UnknownNameError: No such message class.
    """
    found = _BY_NAME.get(name)
    if found is None:
        raise UnknownNameError("message type", name, _BY_NAME)
    return found
