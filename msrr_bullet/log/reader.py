"""Reads a log back, in the order in which it was written."""

from __future__ import annotations

import os
import struct
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from functools import cached_property
from json import JSONDecodeError, loads
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeVar

import zstandard
from mcap.exceptions import McapError
from mcap.records import Attachment, Channel, McapRecord, Message, Metadata
from mcap.stream_reader import CRCValidationError, StreamReader

from msrr_bullet.log.codec import LogError
from msrr_bullet.log.formats import Format, format_named
from msrr_bullet.log.header import METADATA, LogHeader

T = TypeVar("T")

#: Name of the log in a run folder.
LOG_NAME = "trial.mcap"

_MAGIC = b"\x89MCAP0\r\n"

#: What the MCAP reader raises when a record is cut off or damaged.
_DAMAGE = (McapError, CRCValidationError, struct.error, zstandard.ZstdError, UnicodeDecodeError)


@dataclass(frozen=True, eq=False)
class LogRecord:
    """One message of a log.

    Attributes:
        topic: Where it was written.
        stamp_ns: Simulated time at which it happened or arrived.
        sequence: Its place in the log, counted from 0 over all topics.
        data: The JSON text; equal messages have equal texts.
        form: How it is decoded.
    """

    topic: str
    stamp_ns: int
    sequence: int
    data: bytes
    form: Format

    @property
    def kind(self) -> type:
        """The class of the message."""
        return self.form.kind

    @cached_property
    def message(self) -> Any:
        """The message.

        Raises:
            LogError: The text is not such a message.
        """
        try:
            return self.form.decode(loads(self.data))
        except (KeyError, TypeError, ValueError, JSONDecodeError) as error:
            raise LogError(
                f"message {self.sequence} on {self.topic} is not a {self.kind.__name__}: {error!r}"
            ) from error


@dataclass(frozen=True, eq=False)
class Log:
    """A log on disk. It is read anew by every iteration, and never held in memory.

    Attributes:
        path: The file.
        header: Scene, seed, versions, URDFs.
        complete: The file was finished; False when its trial was killed. Such a log ends early, and reads up
            to there.
    """

    path: Path
    header: LogHeader
    complete: bool

    def records(
        self, *patterns: str, start_ns: int | None = None, end_ns: int | None = None
    ) -> Iterator[LogRecord]:
        """Iterate over the messages in the order in which they were written.

        Args:
            patterns: Topics, with ``*`` for any text (``/sensors/*``); none means all.
            start_ns: First time that is wanted.
            end_ns: First time that is no longer wanted.

        Raises:
            LogError: The file is damaged, other than by an early end.
        """
        forms: dict[int, tuple[str, Format] | None] = {}
        for record in _records(self.path, self.complete):
            if isinstance(record, Channel):
                forms[record.id] = _form(record, patterns)
            elif isinstance(record, Message):
                wanted = forms.get(record.channel_id)
                if wanted is None or (start_ns is not None and record.log_time < start_ns):
                    continue
                if end_ns is not None and record.log_time >= end_ns:
                    continue
                yield LogRecord(wanted[0], record.log_time, record.sequence, record.data, wanted[1])

    def messages(self, kind: type[T], *patterns: str) -> Iterator[tuple[int, T]]:
        """Iterate over (stamp, message) of all messages of one class, on topics that match ``patterns``."""
        for record in self.records(*patterns):
            if record.kind is kind:
                yield record.stamp_ns, record.message

    def topics(self) -> Collection[str]:
        """Return the topics that hold a message, sorted."""
        return sorted({record.topic for record in self.records()})


def read_log(path: Path) -> Log:
    """Open a log.

    Args:
        path: An MCAP file, or the run folder that holds ``trial.mcap``.

    Raises:
        LogError: No such file, or not a log of this program.
    """
    path = path / LOG_NAME if path.is_dir() else path
    try:
        with path.open("rb") as file:
            start = file.read(len(_MAGIC))
            size = file.seek(0, os.SEEK_END)
            file.seek(max(0, size - len(_MAGIC)))
            complete = size > len(_MAGIC) and file.read() == _MAGIC
    except OSError as error:
        raise LogError(f"{path}: cannot read the log: {error.strerror}") from error
    if start != _MAGIC:
        raise LogError(f"{path}: not an MCAP file")
    metadata: dict[str, str] | None = None
    files: dict[str, bytes] = {}
    for record in _records(path, complete):
        if isinstance(record, Metadata) and record.name == METADATA:
            metadata = record.metadata
        elif isinstance(record, Attachment):
            files[record.name] = record.data
        elif isinstance(record, Channel):
            break  # the head comes before the first message
    if metadata is None:
        raise LogError(f"{path}: no head of a trial in this file; was it written by `msrr dock`?")
    try:
        return Log(path, LogHeader.from_metadata(metadata, files), complete)
    except LogError as error:
        raise LogError(f"{path}: {error}") from error


@contextmanager
def unpacked_log(path: Path) -> Iterator[Log]:
    """Open a log with the units' URDFs that it holds, for as long as the ``with`` block lasts.

    Args:
        path: As for :func:`read_log`.

    Raises:
        LogError: As :func:`read_log` does, and when a file in the log has an unsafe name.
    """
    log = read_log(path)
    with TemporaryDirectory(prefix="msrr-log-") as folder:
        yield replace(log, header=log.header.unpacked(Path(folder)))


def _records(path: Path, complete: bool) -> Iterator[McapRecord]:
    """Iterate over the MCAP records; a file that is not complete may stop anywhere."""
    try:
        with path.open("rb") as file:
            yield from StreamReader(file, validate_crcs=True).records
    except OSError as error:
        raise LogError(f"{path}: cannot read the log: {error.strerror}") from error
    except _DAMAGE as error:
        if complete:
            raise LogError(f"{path}: the log is damaged: {error!r}") from error


def _form(channel: Channel, patterns: tuple[str, ...]) -> tuple[str, Format] | None:
    kind = channel.metadata.get("type")
    if kind is None or (patterns and not any(fnmatchcase(channel.topic, p) for p in patterns)):
        return None
    return channel.topic, format_named(kind)
