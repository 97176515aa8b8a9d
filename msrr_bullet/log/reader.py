"""Reader of a log, which returns its messages in the order in which they were written."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from functools import cached_property
from json import loads
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeVar

from mcap.records import Attachment, Channel, Message, Metadata

from msrr_bullet.log import topics
from msrr_bullet.log.codec import LogError
from msrr_bullet.log.formats import Format, format_named, window_in
from msrr_bullet.log.frames import FRAMES_OF, LoggedFrame
from msrr_bullet.log.header import LIBRARY, METADATA, LogHeader
from msrr_bullet.log.mcap_records import mcap_records
from msrr_bullet.log.records import CameraWindow
from msrr_scenes.errors import MsrrError, UnknownNameError

T = TypeVar("T")

#: Name of the log in a run folder.
LOG_NAME = "trial.mcap"

#: First and last bytes of an MCAP file.
MAGIC = b"\x89MCAP0\r\n"


@dataclass(frozen=True, eq=False)
class LogRecord:
    """One message of a log.

    Attributes:
        log: MCAP file that holds it, for messages to the user.
        topic: Topic of the message.
        stamp_ns: Simulated time at which the message was sent or arrived.
        sequence: Position in the log, counted from 0 over all topics.
        data: JSON text. Equal messages have equal texts.
        format: Format by which the text is decoded.
        frame: The frame that holds the pixels of a window; None for all else.
    """

    log: Path
    topic: str
    stamp_ns: int
    sequence: int
    data: bytes
    format: Format
    frame: LoggedFrame | None = None

    @property
    def kind(self) -> type:
        """Class of the message."""
        return self.format.kind

    @cached_property
    def message(self) -> Any:
        """Decoded message.

        Raises:
            LogError: The text is not a message of this class, or its pixels are not in the frame.
        """
        place = f"{self.log}: message {self.sequence} on {self.topic}"
        try:
            value = loads(self.data)
            return self.format.decode(value) if self.frame is None else window_in(value, self.frame)
        except (AttributeError, LookupError, TypeError, ValueError) as error:
            raise LogError(f"{place} is not a {self.kind.__name__}: {error!r}") from error
        except LogError as error:
            raise LogError(f"{place}: {error}") from error


@dataclass(frozen=True, eq=False)
class _Frame:
    """A whole frame of a camera: the message for clients, which holds the pixels of the windows before it."""

    camera: str
    stamp_ns: int
    data: bytes


class _WindowsAndFrames:
    """Joins windows with their frame, which comes behind them, and keeps the order of the messages."""

    def __init__(self) -> None:
        self._waiting: list[LogRecord] = []

    def add(self, record: LogRecord | _Frame) -> Iterator[LogRecord]:
        """Take the next record, and yield the messages that are complete."""
        if isinstance(record, _Frame):
            frame, topic = LoggedFrame(record.data), topics.window(record.camera)
            self._waiting = [
                replace(w, frame=frame) if _lacks_frame(w) and w.topic == topic else w for w in self._waiting
            ]
        else:
            self._waiting.append(record)
        if not any(map(_lacks_frame, self._waiting)):
            complete, self._waiting = self._waiting, []
            yield from complete

    def rest(self) -> Iterator[LogRecord]:
        """Yield what is left at the end; the windows of a log that ended before their frame are lost."""
        yield from (record for record in self._waiting if not _lacks_frame(record))


def _lacks_frame(record: LogRecord) -> bool:
    """Return whether a record is a window without pixels, which old logs do not have."""
    return (
        record.kind is CameraWindow and record.frame is None and not record.data.startswith(b'{"timestamp"')
    )


@dataclass(frozen=True, eq=False)
class Log:
    """Log on disk. Every iteration reads the file anew, and the messages are never all in memory.

    Attributes:
        path: MCAP file.
        header: Scene, seed, versions, URDFs.
        complete: Whether the file was finished. The log of a killed trial is not, and ends early.
    """

    path: Path
    header: LogHeader
    complete: bool

    def records(
        self, *patterns: str, start_ns: int | None = None, end_ns: int | None = None
    ) -> Iterator[LogRecord]:
        """Iterate over the messages in the order in which they were written.

        Patterns are topics, with ``*`` for any text (``/sensors/*``); without one all topics count. The time
        range includes its start and not its end.

        Raises:
            LogError: The file is damaged. An early end is no damage.
        """
        joined = _WindowsAndFrames()
        for record in self._raw_records(patterns):
            if start_ns is not None and record.stamp_ns < start_ns:
                continue
            if end_ns is not None and record.stamp_ns >= end_ns:
                continue
            yield from joined.add(record)
        yield from joined.rest()

    def end_ns(self) -> int:
        """Return the simulated time of the last message; 0 if there is none.

        Raises:
            LogError: The file is damaged.
        """
        return max((record.stamp_ns for record in self.records()), default=0)

    def _raw_records(self, patterns: tuple[str, ...]) -> Iterator[LogRecord | _Frame]:
        """Iterate over exact messages on topics that match, and over the frames of all cameras."""
        topic_and_format: dict[int, tuple[str, Format | None]] = {}  # of the channels that are read
        for record in mcap_records(self.path, self.complete, topic_and_format):
            if isinstance(record, Channel):
                message_format, camera = self._format_of(record, patterns), record.metadata.get(FRAMES_OF)
                if message_format is not None:
                    topic_and_format[record.id] = record.topic, message_format
                elif camera is not None:
                    topic_and_format[record.id] = camera, None
            elif isinstance(record, Message):
                name, message_format = topic_and_format[record.channel_id]
                if message_format is None:
                    yield _Frame(name, record.log_time, record.data)
                else:
                    own = record.log_time, record.sequence, record.data, message_format
                    yield LogRecord(self.path, name, *own)

    def _format_of(self, channel: Channel, patterns: tuple[str, ...]) -> Format | None:
        """Return the format of an exact message on a topic that matches the patterns; None for all else."""
        kind = channel.metadata.get("type")
        if kind is None or (patterns and not any(fnmatchcase(channel.topic, p) for p in patterns)):
            return None
        try:
            return format_named(kind)
        except UnknownNameError as error:
            raise LogError(
                f"{self.path}: {channel.topic}: {error} Another version wrote it, and reads it"
            ) from error

    def messages(self, kind: type[T], *patterns: str) -> Iterator[tuple[int, T]]:
        """Iterate over (stamp, message) of all messages of one class, on topics that match the patterns."""
        for record in self.records(*patterns):
            if record.kind is kind:
                yield record.stamp_ns, record.message


def read_log(path: str | Path) -> Log:
    """Open a log: an MCAP file, or the run folder that holds ``trial.mcap``.

    Raises:
        LogError: The file does not exist or is not a log of this program.
    """
    path = Path(path)
    path = path / LOG_NAME if path.is_dir() else path
    try:
        with path.open("rb") as file:
            start = file.read(len(MAGIC))
            size = file.seek(0, os.SEEK_END)
            file.seek(max(0, size - len(MAGIC)))
            complete = size > len(MAGIC) and file.read() == MAGIC
    except OSError as error:
        mend = f"; name a run folder, or the {LOG_NAME} in one" if error.errno == errno.ENOENT else ""
        raise LogError(f"{path}: cannot read the log: {error.strerror}{mend}") from error
    if start != MAGIC:
        raise LogError(f"{path}: not an MCAP file; name a run folder, or the {LOG_NAME} in one")
    metadata: dict[str, str] | None = None
    files: dict[str, bytes] = {}
    for record in mcap_records(path, complete, ()):
        if isinstance(record, Metadata) and record.name == METADATA:
            metadata = record.metadata
        elif isinstance(record, Attachment):
            files[record.name] = record.data
        elif isinstance(record, Channel):
            break  # the header comes before the first message
    if metadata is None:
        raise LogError(
            f"{path}: this file has no header of a trial; was it written by `msrr dock`, or by "
            "`msrr perceive` for a recording?"
        )
    try:
        return Log(path, LogHeader.from_metadata(metadata, files), complete)
    except LogError as error:
        raise LogError(f"{path}: {error}") from error


def begun_by_msrr(path: Path) -> bool:
    """Return whether this program began to write the log at ``path``, of whatever version, however it ended.

    An empty file counts: it is what a trial leaves that was killed at once.

    Raises:
        LogError: The file cannot be read.
    """
    try:
        with path.open("rb") as file:
            start = file.read(64)
    except OSError as error:
        raise LogError(f"{path}: cannot read the log: {error.strerror}") from error
    return not start or (start.startswith(MAGIC) and LIBRARY.encode() in start)


@contextmanager
def unpacked_log(path: str | Path) -> Iterator[Log]:
    """Open a log as :func:`read_log` does, with its URDFs in a temporary folder for the ``with`` block.

    Raises:
        LogError: The log cannot be read, or a file in it has an unsafe name.
    """
    with unpacked(read_log(path)) as log:
        yield log


@contextmanager
def unpacked(log: Log) -> Iterator[Log]:
    """Unpack the URDFs of a log into a temporary folder for the duration of the ``with`` block.

    Raises:
        LogError: A file in the log has an unsafe name, or an error in the block names one of these files, and
            so a folder that is gone by now.
    """
    with TemporaryDirectory(prefix="msrr-log-") as name:
        folder = Path(name).resolve()
        try:
            yield replace(log, header=log.header.unpacked(folder))
        except MsrrError as error:
            if f"{folder}/" not in str(error):
                raise
            named, text = f"{log.path}: ", str(error).replace(f"{folder}/", "")
            raise LogError(text if text.startswith(named) else named + text) from error
