"""Log of a trial: one MCAP file with every message, from which everything else in a run folder is derived."""

from msrr_bullet.log import topics
from msrr_bullet.log.codec import LogError
from msrr_bullet.log.header import LogHeader
from msrr_bullet.log.reader import LOG_NAME, Log, LogRecord, read_log, unpacked_log
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
