"""Log of a trial: one MCAP file with every message, from which everything else in a run folder is derived.

What reads the file is loaded when it is first asked for, for a check of a scene and a trial read none. What
writes it is :mod:`msrr_bullet.log.mcap_recorder`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from msrr_bullet.log import topics
from msrr_bullet.log.codec import LogError
from msrr_bullet.log.header import LogHeader
from msrr_bullet.log.recorder import MemoryRecorder, NullRecorder, Recorder
from msrr_bullet.log.records import (
    BuiltErrors,
    CameraWindow,
    ClearanceRecord,
    Event,
    FrameLink,
    FrameLinks,
    Level,
    StartPoses,
    StepStart,
    TruePose,
)

if TYPE_CHECKING:
    from msrr_bullet.log.reader import LOG_NAME, Log, LogRecord, read_log, unpacked_log

__all__ = [
    "LOG_NAME",
    "BuiltErrors",
    "CameraWindow",
    "ClearanceRecord",
    "Event",
    "FrameLink",
    "FrameLinks",
    "Level",
    "Log",
    "LogError",
    "LogHeader",
    "LogRecord",
    "MemoryRecorder",
    "NullRecorder",
    "Recorder",
    "StartPoses",
    "StepStart",
    "TruePose",
    "read_log",
    "topics",
    "unpacked_log",
]

_OF_READER = {"LOG_NAME", "Log", "LogRecord", "read_log", "unpacked_log"}


def __getattr__(name: str) -> Any:
    if name in _OF_READER:
        from msrr_bullet.log import reader

        return getattr(reader, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
