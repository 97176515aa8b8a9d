"""Format of every message type in a log: its schema, and the conversion to JSON and back."""

from __future__ import annotations

import binascii
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from msrr_bullet.log.codec import Json, LogError, codec, log_name
from msrr_bullet.log.frames import LoggedFrame, from_png
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
    PoseEstimate,
    PoseMeasurement,
    SeatSwitches,
    WheelOdometry,
)
from msrr_scenes.messages.coordination import Authority, MissionStatus, UnitReport


@dataclass(frozen=True, slots=True)
class Format:
    """Format of one message type; its JSON Schema has the title ``msrr.<class>``."""

    kind: type
    schema: dict[str, Json]
    encode: Callable[[Any], Json]
    decode: Callable[[Json], Any]


def _plain(kind: type) -> Format:
    own = codec(kind)
    assert own.schema is not None, "a message is an object, which every schema can tell"
    return Format(kind, own.schema, own.encode, lambda value: own.decode(_exact(value)))


def _exact(value: Json) -> Json:
    """Return an exact message, which logs of version 0.1.0 carry inside one of Foxglove's."""
    return value["msrr"] if isinstance(value, dict) and "msrr" in value else value


_EXPOSURE, _WINDOW = codec(Exposure), codec(Window)


def _encode_window(m: CameraWindow) -> Json:
    """Return what identifies a window; its pixels are in the frame, the next image of the camera."""
    return {"exposure": _EXPOSURE.encode(m.exposure), "window": _WINDOW.encode(m.window)}


def window_in(value: Json, frame: LoggedFrame) -> CameraWindow:
    """Return a window whose pixels are in a frame.

    Raises:
        LogError: The frame is damaged, or the window is not inside it.
    """
    window = _WINDOW.decode(value["window"])
    return CameraWindow(_EXPOSURE.decode(value["exposure"]), window, frame.crop(window))


def _decode_window(value: Json) -> CameraWindow:
    """Return a window of a log of version 0.1.0, which holds the pixels of each window by itself."""
    exact = value["msrr"]
    window = _WINDOW.decode(exact["window"])
    pixels = from_png(binascii.a2b_base64(value["data"]))
    if pixels.shape != (window.height, window.width):
        raise LogError(
            f"a window of {window.width} x {window.height} pixels holds an image of {pixels.shape}"
        )
    return CameraWindow(_EXPOSURE.decode(exact["exposure"]), window, pixels)


_FORMATS: dict[type, Format] = {
    f.kind: f
    for f in (
        *map(_plain, (WheelOdometry, SeatSwitches, LockFeedback, PoseMeasurement, Detections, Exposure)),
        *map(_plain, (Localisation, LosObservation, ArenaEstimate, Action, AssemblyProgress, AssemblyPath)),
        *map(_plain, (Belief, CollisionMonitorState, ClearanceRecord, StepStart, StartPoses, BuiltErrors)),
        *map(_plain, (Authority, UnitReport, MissionStatus, RadioReceipt)),
        *map(_plain, (PoseEstimate, GlobalPose, ObstacleEstimate, TruePose, FrameLinks, Event)),
        Format(
            CameraWindow,
            {
                "title": "msrr.CameraWindow",
                "type": "object",
                "properties": {"exposure": _EXPOSURE.schema, "window": _WINDOW.schema},
            },
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
