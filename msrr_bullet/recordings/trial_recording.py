"""Recordings that are logs of trials, whose onboard camera delivered whole frames."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import TypeVar

from msrr_bullet.log import topics
from msrr_bullet.log.codec import LogError
from msrr_bullet.log.reader import Log, read_log
from msrr_bullet.log.records import CameraWindow
from msrr_bullet.recordings.recording import (
    Decision,
    Item,
    RecordedFrame,
    Recording,
    RecordingError,
    WheelReading,
)
from msrr_scenes.messages import (
    OVERHEAD,
    Action,
    Detections,
    Exposure,
    Pixels,
    WheelOdometry,
    onboard_camera,
    seconds,
)

T = TypeVar("T")


def open_trial(path: Path, topic: str | None, odometry: bool = True) -> Recording:
    """Return the recording in the log of a trial: frames, wheels and decisions of one unit.

    The path is that of the log or of the run folder. The topic is that of the exposures of the camera; None
    if the log has those of one unit. Wheel readings are used only with ``odometry``.

    Raises:
        LogError: The log cannot be read.
        RecordingError: Its cameras delivered windows of frames, or nothing, or several of them have frames.
    """
    log = read_log(path)
    exposures = _before_damage(log.messages(Exposure, "/camera/*"))
    cameras = {m.camera for _, m in exposures if m.camera != OVERHEAD}
    known = sorted(topics.exposure(camera) for camera in cameras)
    if not known and not log.complete:
        raise RecordingError(f"{log.path}: the log ends early, before the first frame of an onboard camera")
    if not known:
        raise RecordingError(
            f"{log.path}: no frames of an onboard camera; run a trial in which a unit uses its camera, with "
            "perception: images and --set cameras.onboard.readout=frames"
        )
    if topic is None and len(known) == 1:
        topic = known[0]
    if topic not in known:
        text = f"no frames on {topic}" if topic else "which camera is meant is not said"
        raise RecordingError(f"{log.path}: {text}; --topic is one of {', '.join(known)}")
    unit = topics.unit_of(topic)
    camera = onboard_camera(unit)
    if log.header.scene.cameras.onboard.readout != "frames":
        raise RecordingError(
            f"{log.path}: its camera delivered windows of frames; run the trial with "
            "--set cameras.onboard.readout=frames"
        )
    return Recording(f"{log.path}, {camera}", partial(_items, log, unit, odometry), None, odometry)


def _items(log: Log, unit: str, odometry: bool) -> Iterator[Item]:
    try:
        yield from _items_before_damage(log, unit, odometry)
    except LogError as error:
        raise RecordingError(str(error)) from None
    if not log.complete:
        raise RecordingError(f"{log.path}: the log ends early, at {seconds(log.end_ns()):.3f} s")


def _items_before_damage(log: Log, unit: str, odometry: bool) -> Iterator[Item]:
    camera = onboard_camera(unit)
    detections = log.messages(Detections, topics.sensor(unit, Detections(Exposure("", 0, 0), (), ())))
    arrivals = {m.exposure: t for t, m in _before_damage(detections) if m.exposure.camera == camera}
    wheels = topics.sensor(unit, WheelOdometry(unit, 0, 0.0, 0.0))
    exposure: Exposure | None = None
    for record in log.records(topics.exposure(camera), topics.window(camera), wheels, topics.action(unit)):
        if record.kind is Exposure:
            exposure = record.message
        elif record.kind is CameraWindow and exposure in arrivals:
            arrival_ns = arrivals[exposure]
            decode = partial(_pixels, record.message)
            name = f"{log.path}: frame {exposure.frame}"
            yield RecordedFrame(name, exposure.stamp_ns, arrival_ns, decode, exposure.frame)
            del arrivals[exposure]  # what is read of it again is the same
        elif record.kind is WheelOdometry and odometry:
            reading: WheelOdometry = record.message
            yield WheelReading(record.stamp_ns, reading.stamp_ns, reading.left, reading.right)
        elif record.kind is Action:
            yield Decision(record.stamp_ns)


def _before_damage(messages: Iterator[tuple[int, T]]) -> Iterator[tuple[int, T]]:
    """Yield what comes before a log is damaged, which is told when its frames have been read so far."""
    with suppress(LogError):
        yield from messages


def _pixels(window: CameraWindow) -> Pixels:
    return window.pixels
