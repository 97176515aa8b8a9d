"""Messages of MCAP files in the encodings of Foxglove and of ROS 2: JSON, protobuf and CDR."""

from __future__ import annotations

import json
import os
import struct
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace
from typing import IO, Any, NamedTuple

import zstandard
from google.protobuf.message import DecodeError
from mcap.decoder import DecoderFactory
from mcap.exceptions import McapError
from mcap.reader import McapReader, NonSeekingReader, SeekingReader
from mcap.records import Channel, Schema
from mcap_protobuf.decoder import DecoderFactory as ProtobufDecoderFactory
from mcap_ros2.decoder import DecoderFactory as Ros2DecoderFactory

from msrr_bullet.log.reader import MAGIC
from msrr_bullet.recordings.recording import LONGEST_LATENCY_NS, RecordingError
from msrr_scenes.messages import NS_PER_S

#: What decoders raise on bytes that are no message, and what is raised where a message lacks a field.
DAMAGE = (
    *(McapError, zstandard.ZstdError, struct.error, DecodeError, EOFError, OSError),
    *(ValueError, TypeError, KeyError, IndexError, AttributeError, OverflowError, MemoryError),
    RuntimeError,  # of LZ4, and of what is nested too deep
)


class Undecoded(NamedTuple):
    """Stands for a message that its decoder refuses, with the reason in words."""

    reason: str


class DecodedMessage(NamedTuple):
    """A message of an MCAP file, with its fields as attributes, and the time at which it was recorded.

    A message that cannot be decoded is :class:`Undecoded`.
    """

    topic: str
    schema: str
    log_ns: int
    message: Any


class _JsonDecoderFactory(DecoderFactory):
    """Decodes messages in JSON."""

    def decoder_for(self, message_encoding: str, schema: Schema | None) -> Callable[[bytes], Any] | None:
        """Return the decoder of messages in JSON; None for others."""
        return _from_json if message_encoding == "json" else None


class _Ros2DecoderFactory(Ros2DecoderFactory):
    """Decodes messages in CDR, and tells of a definition that is none as of other damage."""

    def decoder_for(self, message_encoding: str, schema: Schema | None) -> Callable[[bytes], Any] | None:
        """Return the decoder of messages in CDR; None for others.

        Raises:
            McapError: The definition cannot be parsed.
        """
        try:
            return super().decoder_for(message_encoding, schema)
        except Exception as error:  # errors of its parser have no other class in common
            raise McapError(f"the definition of {_name(schema)}: {error}") from error


def _from_json(data: bytes) -> Any:
    return json.loads(data, object_hook=lambda fields: SimpleNamespace(**fields))


def read_channels(path: Path) -> dict[str, str]:
    """Return the topics of an MCAP file, each with the name of its schema.

    Raises:
        RecordingError: The file cannot be read, or is none.
    """
    try:
        with path.open("rb") as file:
            reader, _ = _reader(file)
            summary = reader.get_summary() if isinstance(reader, SeekingReader) else None
            if summary is not None and summary.channels:
                return {c.topic: _name(summary.schemas.get(c.schema_id)) for c in summary.channels.values()}
            return {channel.topic: _name(schema) for schema, channel in _channels_of(reader)}
    except DAMAGE as error:
        raise RecordingError(f"{path}: cannot be read as MCAP: {error}") from None


def _reader(file: IO[bytes]) -> tuple[McapReader, bool]:
    """Return a reader of a file, and whether the file is whole.

    One that was cut off or has no full index is read from its beginning.
    """
    start, size = file.read(len(MAGIC)), file.seek(0, os.SEEK_END)
    file.seek(max(0, size - len(MAGIC)))
    end = file.read()
    file.seek(0)
    if start != MAGIC:
        raise ValueError("its first bytes are others")
    if size > len(MAGIC) and end == MAGIC:
        reader = SeekingReader(file, validate_crcs=True)
        summary = reader.get_summary()
        # Channels and schemas need not be repeated behind the messages, nor need there be an index of these.
        if summary is not None and summary.chunk_indexes and summary.channels and summary.schemas:
            return reader, True
    file.seek(0)
    return NonSeekingReader(file, validate_crcs=True), end == MAGIC


def _decoder(schema: Schema | None, channel: Channel) -> Callable[[bytes], Any]:
    """Return the decoder of the messages on a channel.

    Raises:
        McapError: Their encoding is not known, or their definition cannot be parsed.
    """
    for factory in (_JsonDecoderFactory(), ProtobufDecoderFactory(), _Ros2DecoderFactory()):
        decoder = factory.decoder_for(channel.message_encoding, schema)
        if decoder is not None:
            return decoder
    raise McapError(f"no decoder for {_name(schema)} in the encoding {channel.message_encoding!r}")


def _channels_of(reader: McapReader) -> Iterator[tuple[Schema | None, Channel]]:
    """Yield the channels of a file without a summary, as far as it goes."""
    try:
        for schema, channel, _ in reader.iter_messages(log_time_order=False):
            yield schema, channel
    except DAMAGE:
        return  # the file was cut off; reading its messages will say so


def _name(schema: Schema | None) -> str:
    return "" if schema is None else schema.name


def read_messages(path: Path, topics: list[str]) -> Iterator[DecodedMessage]:
    """Yield the messages on some topics in the order of their recording.

    Raises:
        RecordingError: The file is damaged from some message on, or cut off there; those before were yielded.
    """
    count, decoders = 0, dict[int, Callable[[bytes], Any]]()
    try:
        with path.open("rb") as file:
            reader, whole = _reader(file)
            # One that was cut off ends in an error: what comes before it cannot wait to be sorted.
            for schema, channel, record in reader.iter_messages(topics=topics, log_time_order=whole):
                if channel.id not in decoders:
                    decoders[channel.id] = _decoder(schema, channel)
                message: Any
                try:
                    message = decoders[channel.id](record.data)
                except DAMAGE as error:
                    message = Undecoded(_in_words(error))
                yield DecodedMessage(channel.topic, _name(schema), record.log_time, message)
                count += 1
    except DAMAGE as error:
        text = f"damaged, cut off or of an unknown encoding behind message {count}"
        raise RecordingError(f"{path}: {text}: {_in_words(error)}") from None


def _in_words(error: Exception) -> str:
    return f"{type(error).__name__} {error}"[:200].strip()


def check_clock(path: Path, topic: str) -> None:
    """Refuse a file whose clock was set back while it was recorded: nobody knows what belongs together.

    Messages are read in the order of their times, which would mix those before with those behind. The
    messages of the topic are looked at in the order of the file.

    Raises:
        RecordingError: A message was recorded more than :data:`LONGEST_LATENCY_NS` before an earlier one.
    """
    latest_ns = 0
    with suppress(*DAMAGE), path.open("rb") as file:  # reading the messages will tell of damage
        for _, _, record in _reader(file)[0].iter_messages(topics=[topic], log_time_order=False):
            back_ns = latest_ns - record.log_time
            if back_ns > LONGEST_LATENCY_NS:
                raise RecordingError(
                    f"{path}: its clock goes back by {1e-9 * back_ns:.1f} s while {topic} is recorded; cut "
                    "the file there, and read the parts by themselves"
                )
            latest_ns = max(latest_ns, record.log_time)


def stamp_of(message: Any) -> int | None:
    """Return the time stamp of a message [ns]: ``timestamp`` of Foxglove, ``header.stamp`` of ROS 2, or ours.

    It is None where nobody has set it.
    """
    if hasattr(message, "stamp_ns"):
        return int(message.stamp_ns)
    time = message.timestamp if hasattr(message, "timestamp") else message.header.stamp
    whole = time.sec if hasattr(time, "sec") else time.seconds
    (rest,) = (getattr(time, name) for name in ("nanosec", "nsec", "nanos") if hasattr(time, name))
    return int(whole) * NS_PER_S + int(rest) or None
