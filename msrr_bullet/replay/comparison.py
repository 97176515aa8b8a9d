"""The report of a replay: what was compared between a log and the robot that ran again, and what differed."""

from __future__ import annotations

import json
from pathlib import Path

from pydantic import BaseModel

from msrr_bullet.log.codec import to_bytes
from msrr_bullet.log.formats import format_of
from msrr_bullet.log.reader import LogRecord
from msrr_scenes.errors import MsrrError
from msrr_scenes.wording import counted

#: Number of differences after which a replay ends.
MAX_MISMATCHES = 20

#: Number of values that a difference between two messages names.
_SHOWN_VALUES = 3


class ReplayError(MsrrError):
    """A replay cannot be made."""


class Diverged(Exception):
    """The robot left the log, so that nothing after that can be compared."""


class Mismatch(BaseModel, frozen=True):
    """One difference between a trial and the replay.

    Attributes:
        what: ``command``, ``estimate``, ``los``, ``situation``, ``collision_monitor``, ``assembly``,
            ``path``, ``belief``, ``report``, ``status``, ``authority``, ``detections``, ``window``,
            ``event`` or ``log``.
        sequence: Number of the log message at which the difference was found.
        time_s: Simulated time [s].
        logged: Message or window of the trial; None when there was none. Of ``log``, what is wrong with it.
        replayed: Message or window of the replay; None when there was none.
    """

    what: str
    sequence: int
    time_s: float
    logged: str | None
    replayed: str | None

    def __str__(self) -> str:
        """Return the difference in words: of two messages only the values that differ."""
        if self.what == "log":
            return f"{self.time_s:.3f} s, log: {self.logged}"
        logged, replayed = (_values(text) for text in (self.logged, self.replayed))
        keys = [key for key in logged | replayed if logged.get(key) != replayed.get(key)]
        told = [f"{k} logged {logged.get(k)}, replayed {replayed.get(k)}" for k in keys[:_SHOWN_VALUES]]
        if not logged or not replayed:
            told = [f"logged {self.logged}, replayed {self.replayed}"]
        elif len(keys) > _SHOWN_VALUES:
            told.append(f"and {counted(len(keys) - _SHOWN_VALUES, 'value')} more")
        return f"{self.time_s:.3f} s, {self.what}: {'; '.join(told)}"


def _values(text: str | None) -> dict[str, object]:
    """Return the values of a message by their dotted keys; none of a text that is no message."""
    try:
        todo: list[tuple[str, object]] = [("", json.loads(text or "null"))]
    except json.JSONDecodeError:
        return {}
    found: dict[str, object] = {}
    for key, value in todo:  # the list grows while it is walked
        if isinstance(value, dict | list):
            items = value.items() if isinstance(value, dict) else enumerate(value)
            todo += [(f"{key}.{name}" if key else str(name), item) for name, item in items]
        elif key:
            found[key] = value
    return found


class ReplayReport(BaseModel, frozen=True):
    """The result of a replay.

    Attributes:
        log: Path of the log file.
        complete: Whether the log was finished; that of a killed trial is compared as far as it was written.
        judged: Whether the log ends with the verdict on the trial; that of an interrupted trial does not.
        left: Whether the replay ended where the robot left the log, so that nothing after that was compared.
        end_s: Simulated time of the last message that was read [s].
        steps: Number of steps that began.
        sensor_messages: Number of messages given to robots and base station, without detections and radio.
        commands: Number of actions compared.
        estimates: Number of pose estimates, lines of sight, beliefs and other estimates compared.
        windows: Number of window requests compared.
        detections: Number of sets of detections compared.
        reports: Number of reports to the base station compared.
        statuses: Number of mission statuses of the base station compared.
        authorities: Number of authorities compared.
        mismatches: The first differences.
        own_classes: Import paths of the classes of the run that are none of this project.
        written_with: What the header of the log says of versions and machine; see :class:`LogHeader`.
    """

    log: Path
    complete: bool
    judged: bool
    left: bool = False
    end_s: float
    steps: int
    sensor_messages: int
    commands: int
    estimates: int
    windows: int
    detections: int
    reports: int = 0
    statuses: int = 0
    authorities: int = 0
    mismatches: tuple[Mismatch, ...]
    own_classes: tuple[str, ...] = ()
    written_with: dict[str, str] = {}

    @property
    def identical(self) -> bool:
        """Whether at least one decision was compared and everything was equal, bit for bit."""
        return not self.mismatches and self.commands + self.statuses > 0


#: What a replay counts.
COUNTS = tuple(name for name, field in ReplayReport.model_fields.items() if field.annotation is int)


class ReplayComparison:
    """Collects the differences between the messages of a log and those of a replay."""

    def __init__(self) -> None:
        """Start without a difference."""
        self.mismatches: list[Mismatch] = []

    def compare(self, what: str, record: LogRecord, replayed: object | None) -> bool:
        """Compare a message of a replay with a logged one; return whether they are equal, bit for bit.

        The replay may have none. ``what`` is the kind of the message, for the report.
        """
        data = None if replayed is None else encoded(replayed)
        # Old logs write some messages in another form, so that only what was read can be compared.
        if data == record.data or data == encoded(record.message):
            return True
        self.add(what, record, record.data.decode(), None if data is None else data.decode())
        return False

    def add(self, what: str, record: LogRecord, logged: str | None, replayed: str | None) -> None:
        """Add a difference.

        Raises:
            Diverged: There are too many differences.
        """
        time_s = record.stamp_ns * 1e-9
        self.mismatches.append(
            Mismatch(what=what, sequence=record.sequence, time_s=time_s, logged=logged, replayed=replayed)
        )
        if len(self.mismatches) >= MAX_MISMATCHES:
            raise Diverged


def encoded(message: object) -> bytes:
    """Return the bytes that the recorder writes for a message; equal bytes mean equal bits."""
    return to_bytes(format_of(message).encode(message))
