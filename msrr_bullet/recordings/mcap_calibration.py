"""The calibration of the camera in an MCAP file, by a message of Foxglove or ROS 2."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

from msrr_bullet.recordings.mcap_messages import DAMAGE, Undecoded, read_messages
from msrr_bullet.recordings.recording import RecordingError
from msrr_scenes.errors import SceneError
from msrr_scenes.loading.calibration_file import calibration_of
from msrr_scenes.specs.sensors import CalibrationSpec

CALIBRATIONS = ("foxglove.CameraCalibration", "sensor_msgs/msg/CameraInfo")

#: Names of images that were rectified: ``image_rect``, ``image_rect_color``, ``image_rectified``.
_RECTIFIED = re.compile(r"image_rect(ified)?(_.*)?")


def find_calibration(
    path: Path, images: str, schemas: Mapping[str, str]
) -> tuple[str, Callable[[], CalibrationSpec] | None]:
    """Return the topic of the calibration of some images, and what reads it.

    Args:
        path: MCAP file.
        images: Topic of the images.
        schemas: Kind of the messages of every topic.

    Returns:
        An empty topic if no calibration is that of the images by its name, with what refuses the others; and
        with None if there is none at all. What reads or refuses raises a :class:`RecordingError`.
    """
    known = [topic for topic, schema in schemas.items() if schema in CALIBRATIONS]
    topic = _nearest(images, known)
    if topic is not None:
        return topic, partial(_read_calibration, path, topic, _is_rectified(images))
    return "", partial(_refuse_others, path, images, known) if known else None


def _nearest(topic: str, candidates: Sequence[str]) -> str | None:
    """Return the topic of the calibration that belongs to images; None without one, or where several may.

    Its folder holds the images, or has their name, and no other one is nearer: ``/camera/camera_info`` is
    that of ``/camera/image_raw`` and of ``/camera/image_raw/compressed``. One in another folder beside the
    images is of another camera.
    """
    name = topic.split("/")
    places = {other: other.split("/")[:-1] for other in candidates}
    steps = {
        other: abs(len(place) - len(name) + 1)
        for other, place in places.items()
        if place == name[: len(place)]
    }
    nearest = [other for other, count in steps.items() if count == min(steps.values())]
    return nearest[0] if len(nearest) == 1 else None


def _refuse_others(path: Path, topic: str, candidates: Sequence[str]) -> CalibrationSpec:
    """Refuse calibrations of which none is by its name that of the images."""
    raise RecordingError(
        f"{path}: which of {', '.join(sorted(candidates))} is the calibration of {topic}, their names do not "
        "tell; give --calibration FILE"
    )


def _is_rectified(topic: str) -> bool:
    """Return whether images are rectified, by the names that ``image_proc`` of ROS gives to their topics.

    Compressed images have the name of their transport behind that.
    """
    return any(_RECTIFIED.fullmatch(part) for part in topic.split("/")[-2:])


def _read_calibration(path: Path, topic: str, rectified: bool) -> CalibrationSpec:
    """Return the calibration of raw images, K and D, or that of rectified ones, which is in P.

    It is that of the first message that has one.

    Raises:
        RecordingError: There is none, or one that cannot be used.
    """
    which, name = "P" if rectified else "K", f"{path}: {topic}"
    found = None
    for found in read_messages(path, [topic]):  # the first ones may be of a driver that was not ready
        with suppress(*DAMAGE):
            if any(_field(found.message, which)):
                break
    if found is None:
        raise RecordingError(f"{name}: no message; give --calibration FILE")
    message: Any = found.message
    if isinstance(message, Undecoded):
        raise RecordingError(f"{name}: damaged: {message.reason}; give --calibration FILE")
    try:
        size = int(message.width), int(message.height)
        matrix = [float(number) for number in _field(message, which)]
        lens = [] if rectified else [float(number) for number in _field(message, "D")]
        model = "" if rectified else str(message.distortion_model)
        whole = _shows_all(message, size)
    except DAMAGE as error:
        raise RecordingError(f"{name}: not a {found.schema}: {error}") from None
    if not any(matrix):
        text = "P, by which rectified images are read," if rectified else "K"
        raise RecordingError(f"{name}: the camera is not calibrated: {text} is 0; give --calibration FILE")
    if not whole:
        raise RecordingError(f"{name}: of binned or cut pictures; give --calibration FILE for what they are")
    if rectified:
        matrix = [*matrix[0:3], *matrix[4:7], *matrix[8:11]]
    try:
        return calibration_of(size, matrix, lens, model, name)
    except SceneError as error:
        raise RecordingError(f"{error}; give --calibration FILE") from None


def _field(message: Any, name: str) -> Any:
    """Return a field of a calibration, whose name ROS 2 writes in small letters."""
    return getattr(message, name) if hasattr(message, name) else getattr(message, name.lower())


def _shows_all(message: Any, size: tuple[int, int]) -> bool:
    """Return whether the images show all pixels of the sensor, each by itself; zeros say so as well."""
    if max(getattr(message, "binning_x", 0), getattr(message, "binning_y", 0)) > 1:
        return False
    region = getattr(message, "roi", None)
    if region is None:
        return True
    place, extent = (region.x_offset, region.y_offset), (region.width, region.height)
    return place == (0, 0) and extent in ((0, 0), size)
