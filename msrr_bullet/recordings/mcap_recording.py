"""Recordings in MCAP files: images and calibration of Foxglove or ROS 2, wheels or odometry beside them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from msrr_bullet.recordings.images import pixels_of
from msrr_bullet.recordings.mcap_calibration import find_calibration
from msrr_bullet.recordings.mcap_messages import (
    DAMAGE,
    DecodedMessage,
    Undecoded,
    check_clock,
    read_channels,
    read_messages,
    stamp_of,
)
from msrr_bullet.recordings.recording import (
    LONGEST_LATENCY_NS,
    Item,
    RecordedFrame,
    Recording,
    RecordingError,
    WheelReading,
)
from msrr_bullet.recordings.wheels import JOINT_STATE, ODOMETRY, WHEELS, WheelReader
from msrr_perception.photographs.picture_files import PictureError
from msrr_scenes.messages import Pixels

IMAGES = (
    *("foxglove.CompressedImage", "foxglove.RawImage"),
    *("sensor_msgs/msg/CompressedImage", "sensor_msgs/msg/Image"),
)

#: Name of no topic, by which odometry is left out.
NONE = "none"


@dataclass(frozen=True, slots=True)
class _Topics:
    """Topics of images, and of odometry if there is any."""

    images: str
    odometry: str | None

    def all(self) -> list[str]:
        return [self.images, *((self.odometry,) if self.odometry else ())]


def open_mcap(
    path: Path,
    topic: str | None,
    odometry: str | None,
    wheels: Callable[[], WheelReader],
) -> Recording:
    """Return the recording in an MCAP file.

    The topic of the images may be None if only one has images, and that of the odometry if at most one has
    any; :data:`NONE` leaves it out. ``wheels`` returns a reader of wheel angles.

    Raises:
        RecordingError: The file cannot be read, a topic is not in it, or which one is meant is not said.
    """
    schemas = read_channels(path)
    joints = wheels().joints
    image_topic = _chosen(path, schemas, IMAGES, topic, "--topic")
    if image_topic is None:
        found = ", ".join(sorted(set(schemas.values()))) or "nothing"
        raise RecordingError(f"{path}: no images ({' or '.join(IMAGES)}); the file holds {found}")
    chosen = _Topics(
        image_topic,
        None if odometry == NONE else _chosen_odometry(path, schemas, odometry, joints is not None),
    )
    if next(iter(read_messages(path, [chosen.images])), None) is None:
        raise RecordingError(f"{path}: no message on {chosen.images}")
    check_clock(path, chosen.images)
    if chosen.odometry is not None:
        _check_wheels(path, chosen.odometry, wheels())
    start_ns = _earliest_ns(path, chosen)
    items = partial(_items, path, chosen, start_ns, wheels)
    calibrated_by, calibration = find_calibration(path, image_topic, schemas)
    source = f"{path}, {' and '.join(chosen.all())}"
    unread = ""
    if chosen.odometry is None and odometry != NONE and joints is None:
        unread = ", ".join(sorted(t for t, schema in schemas.items() if schema == JOINT_STATE))
        unread = unread and f"the joint states on {unread} are read if the target file has robot.wheel_joints"
    return Recording(
        source,
        items,
        calibration,
        chosen.odometry is not None,
        start_ns,
        unread=unread,
        calibrated_by=calibrated_by,
    )


def _chosen(
    path: Path, schemas: Mapping[str, str], kinds: Sequence[str], named: str | None, option: str
) -> str | None:
    """Return the topic of some kinds of messages that was named, or the only one; None if there is none."""
    known = sorted(topic for topic, schema in schemas.items() if schema in kinds)
    if named is not None and named not in known:
        text = f"{option} {named}: no such topic with {' or '.join(kinds)}"
        if schemas.get(named) == JOINT_STATE:
            text = f"{option} {named}: joint states are read if the target file has robot.wheel_joints"
        raise RecordingError(f"{path}: {text}; there are {', '.join(known) or 'none'}")
    if named is None and len(known) > 1:
        raise RecordingError(f"{path}: several topics; choose one of {', '.join(known)} by {option}")
    return named or next(iter(known), None)


def _chosen_odometry(path: Path, schemas: Mapping[str, str], named: str | None, joints: bool) -> str | None:
    """Return the topic of the odometry that was named, or the only one: joint states if joints are known."""
    kinds: tuple[str, ...] = (WHEELS, ODOMETRY)
    if joints and named is not None:
        kinds = (JOINT_STATE, *kinds)
    elif joints and JOINT_STATE in schemas.values():
        kinds = (JOINT_STATE,)
    return _chosen(path, schemas, kinds, named, "--odometry")


def _check_wheels(path: Path, topic: str, reader: WheelReader) -> None:
    """Refuse odometry that never tells of both wheels: without readings the robot would be taken to stand."""
    told: set[str] = set()
    for found in read_messages(path, [topic]):
        if _angles(path, reader, found) is not None:
            return
        told |= set(getattr(found.message, "name", ()))  # of joint states
    leave_out = f"or leave the odometry out by --odometry {NONE}"
    wanted = [joint.name for joint in reader.joints or ()]
    if not told or told.issuperset(wanted):
        raise RecordingError(f"{path}: {topic}: it tells of no motion; name another topic, {leave_out}")
    raise RecordingError(
        f"{path}: {topic}: no message tells of both {' and '.join(wanted)}, but there are "
        f"{', '.join(sorted(told))}; name two of these as robot.wheel_joints in the target file, {leave_out}"
    )


def _items(path: Path, topics: _Topics, start_ns: int, wheels: Callable[[], WheelReader]) -> Iterator[Item]:
    reader, number = wheels(), 0
    for found in read_messages(path, topics.all()):
        arrival_ns = found.log_ns - start_ns
        if found.topic == topics.images:
            yield _frame(path, found, start_ns, number)
            number += 1
            continue
        stamp_ns, angles = _stamp(path, found) - start_ns, _angles(path, reader, found)
        if angles is not None:
            yield WheelReading(arrival_ns, stamp_ns, *angles)


def _frame(path: Path, found: DecodedMessage, start_ns: int, number: int) -> RecordedFrame:
    """Return the frame of a message; one that is damaged, or of another time, cannot be read."""
    arrival_ns = found.log_ns - start_ns
    name = f"{path}: {found.topic} at {1e-9 * arrival_ns:.3f} s"
    if isinstance(found.message, Undecoded):
        return _lost_frame(name, arrival_ns, f"{name}: damaged: {found.message.reason}", number)
    try:
        stamp_ns = _stamp(path, found) - start_ns
    except RecordingError as error:
        return _lost_frame(name, arrival_ns, str(error), number)
    name = f"{path}: {found.topic} at {1e-9 * stamp_ns:.3f} s"
    decode = partial(pixels_of, found.message, name)
    return RecordedFrame(name, stamp_ns, max(arrival_ns, stamp_ns), decode, number)


def _lost_frame(name: str, arrival_ns: int, reason: str, number: int) -> RecordedFrame:
    def decode() -> Pixels:
        raise PictureError(reason)

    return RecordedFrame(name, arrival_ns, arrival_ns, decode, number)


def _angles(path: Path, reader: WheelReader, found: DecodedMessage) -> tuple[float, float] | None:
    """Return the angles of both wheels [rad], left first; None if a message does not tell of both."""
    if isinstance(found.message, Undecoded):
        raise RecordingError(f"{path}: {found.topic}: a damaged message: {found.message.reason}")
    try:
        angles = reader.angles(found.schema, found.message)
    except DAMAGE as error:
        raise RecordingError(f"{path}: {found.topic}: not a {found.schema}: {error}") from None
    return angles if angles is not None and all(map(math.isfinite, angles)) else None


def _earliest_ns(path: Path, topics: _Topics) -> int:
    """Return the earliest time of a recording, from which all others are counted [ns].

    A message is recorded at most :data:`LONGEST_LATENCY_NS` after its stamp, and its clock goes
    back by no more than that.

    Raises:
        RecordingError: A message that comes before all images cannot be used.
    """
    earliest_ns = next(iter(read_messages(path, topics.all()))).log_ns
    has_image, refused = False, None
    try:
        for found in read_messages(path, topics.all()):
            if found.log_ns > earliest_ns + 2 * LONGEST_LATENCY_NS:
                break
            try:
                stamp_ns = _stamp(path, found)
            except RecordingError as error:
                if found.topic != topics.images:
                    raise
                refused = refused or error  # a single one is a lost frame
                continue
            earliest_ns = min(earliest_ns, found.log_ns, stamp_ns)
            has_image |= found.topic == topics.images
    except RecordingError:
        if not has_image:
            raise
        # Else it is raised again, and told, where the recording is read: what comes before is worth having.
    if refused is not None and not has_image:
        raise refused
    return earliest_ns


def _stamp(path: Path, found: DecodedMessage) -> int:
    """Return the time stamp of a message; that of its recording where nobody has set it, or can read it."""
    if isinstance(found.message, Undecoded):
        return found.log_ns
    try:
        stamp_ns = stamp_of(found.message)
    except DAMAGE as error:
        raise RecordingError(f"{path}: {found.topic}: not a {found.schema}: {error}") from None
    if stamp_ns is None:
        return found.log_ns
    if abs(stamp_ns - found.log_ns) > LONGEST_LATENCY_NS:
        late_s = 1e-9 * (found.log_ns - stamp_ns)
        apart = f"{abs(late_s):.1f} s {'before' if late_s > 0.0 else 'after'} their recording"
        raise RecordingError(
            f"{path}: {found.topic}: its stamps are {apart}; with clocks that far apart nobody knows what "
            "belongs together; record with clocks that agree, or stamp it anew"
        )
    return stamp_ns
