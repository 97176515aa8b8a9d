"""A recording: what a camera and wheel encoders said, in the order of time."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import pairwise
from statistics import median

from msrr_scenes.errors import MsrrError
from msrr_scenes.messages import NS_PER_S, Pixels
from msrr_scenes.specs.sensors import CalibrationSpec


class RecordingError(MsrrError):
    """A recording that cannot be read."""


@dataclass(frozen=True, slots=True, eq=False)
class RecordedFrame:
    """A picture of the camera.

    It was exposed at ``stamp_ns`` and reached the computer at ``arrival_ns``. ``decode`` returns the pixels,
    mono8 of shape (height, width), or raises a
    :class:`~msrr_perception.photographs.picture_files.PictureError`.
    """

    name: str
    stamp_ns: int
    arrival_ns: int
    decode: Callable[[], Pixels]
    number: int


@dataclass(frozen=True, slots=True)
class WheelReading:
    """Angles that the wheels have turned, left and right [rad], and the time at which this was known."""

    arrival_ns: int
    stamp_ns: int
    left: float
    right: float


@dataclass(frozen=True, slots=True)
class Decision:
    """An instant at which the robot of the recording decided, for which estimates are wanted as well."""

    stamp_ns: int


#: What a recording holds.
Item = RecordedFrame | WheelReading | Decision


@dataclass(frozen=True, eq=False)
class Recording:
    """A recording.

    Attributes:
        source: Where it comes from, in words.
        items: Returns what it holds, in the order of arrival; those that come at the same time as they were
            written.
        calibration: Returns the calibration of the camera, or raises a :class:`RecordingError` if what the
            recording says of it cannot be used; None if it says nothing.
        has_odometry: Whether it holds wheel readings.
        start_ns: Time on the clock of the recording that is 0 here.
        has_times: Whether it says itself when its frames were exposed.
        unread: What else it says of the wheels, and how that would be read; empty for nothing.
        calibrated_by: Topic of the calibration; empty without one.
    """

    source: str
    items: Callable[[], Iterable[Item]]
    calibration: Callable[[], CalibrationSpec] | None = None
    has_odometry: bool = False
    start_ns: int = 0
    has_times: bool = True
    unread: str = ""
    calibrated_by: str = ""


@dataclass(frozen=True, slots=True, order=True)
class Moment:
    """Something that happens at a time: a frame is exposed or has been read, wheels are read, or a decision.

    At the same time wheels are read first, and decisions come last, as in a trial.
    """

    at_ns: int
    rank: int
    order: int
    item: Item = field(compare=False)

    @property
    def exposes(self) -> bool:
        """Whether a frame is exposed, and not delivered."""
        return isinstance(self.item, RecordedFrame) and self.rank == _EXPOSED


#: Number of frames whose stamps tell the time between frames: ten seconds and more of most cameras.
_FRAMES = 250


def frame_period_s(recording: Recording) -> float | None:
    """Return the time between the exposures of two frames, the median over the first ones [s].

    It is None where fewer than two frames, or equal stamps, do not tell it. Damage ends what is looked at.
    """
    stamps: list[int] = []
    with suppress(RecordingError):  # it is raised again, and told, where the recording is read
        for item in recording.items():
            if isinstance(item, RecordedFrame):
                stamps.append(item.stamp_ns)
            if len(stamps) == _FRAMES:
                break
    apart = [later - earlier for earlier, later in pairwise(sorted(stamps))]
    return 1e-9 * median(apart) or None if apart else None


_READ, _EXPOSED, _DELIVERED, _DECIDED = range(4)

#: Time by which a frame may arrive after its exposure. Moments are put in order over that time, of which all
#: pictures are in memory.
LONGEST_LATENCY_NS = 2 * NS_PER_S


def moments(items: Iterable[Item]) -> Iterator[Moment]:
    """Yield all that happens in the order of time: every frame twice, at its exposure and at its arrival.

    Perception chooses what to read of a frame by what is known when it is exposed, and uses the tags when
    they arrive, as on the robot. The items are in the order of arrival.

    Raises:
        RecordingError: The recording is damaged from some item on; all that happened before was yielded.
    """
    waiting: list[Moment] = []
    damage: RecordingError | None = None
    try:
        for order, item in enumerate(items):
            for moment in _moments_of(item, order):
                heapq.heappush(waiting, moment)
            arrival_ns = item.stamp_ns if isinstance(item, Decision) else item.arrival_ns
            while waiting and waiting[0].at_ns < arrival_ns - LONGEST_LATENCY_NS:
                yield heapq.heappop(waiting)
    except RecordingError as error:
        damage = error
    while waiting:
        yield heapq.heappop(waiting)
    if damage is not None:
        raise damage


def _moments_of(item: Item, order: int) -> Iterator[Moment]:
    if isinstance(item, RecordedFrame):
        yield Moment(item.stamp_ns, _EXPOSED, order, item)
        yield Moment(item.arrival_ns, _DELIVERED, order, item)
    elif isinstance(item, WheelReading):
        yield Moment(item.arrival_ns, _READ, order, item)
    else:
        yield Moment(item.stamp_ns, _DECIDED, order, item)
