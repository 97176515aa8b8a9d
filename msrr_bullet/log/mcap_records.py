"""The records of an MCAP file, read in order."""

from __future__ import annotations

import struct
from collections.abc import Container, Iterator
from io import BytesIO
from pathlib import Path

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile, McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, McapRecord, Message
from mcap.stream_reader import CRCValidationError, StreamReader, get_chunk_data_stream

from msrr_bullet.log.codec import LogError

#: Errors that the MCAP reader raises when a record is cut off or damaged.
_DAMAGE = (McapError, CRCValidationError, struct.error, zstandard.ZstdError, UnicodeDecodeError)

#: Opcode and length of an MCAP record, and what a message begins with: channel, sequence, two times [ns].
_HEAD, _MESSAGE_HEAD = struct.Struct("<BQ"), struct.Struct("<HIQQ")


def mcap_records(path: Path, complete: bool, channels: Container[int]) -> Iterator[McapRecord]:
    """Iterate over the records of an MCAP file, those in its chunks included.

    Args:
        path: The file.
        complete: Whether the file was finished. One that was not may end anywhere.
        channels: Numbers of the channels whose messages are yielded; the caller may add some on the way.

    Raises:
        LogError: The file cannot be read, or is complete and damaged.
    """
    try:
        with path.open("rb") as file:
            for record in StreamReader(file, emit_chunks=True, validate_crcs=True).records:
                if isinstance(record, Chunk):
                    yield from _in_chunk(record, channels)
                elif not isinstance(record, Message) or record.channel_id in channels:
                    yield record
    except OSError as error:
        raise LogError(f"{path}: cannot read the log: {error.strerror}") from error
    except _DAMAGE as error:
        if complete:
            raise LogError(f"{path}: the log is damaged: {_in_words(error)}") from error


def _in_words(error: Exception) -> str:
    if isinstance(error, CRCValidationError):
        return "the checksum of a part of it is not that of the bytes there"
    return str(error) or "a record of it is cut off"  # EndOfFile has no text


def _in_chunk(chunk: Chunk, channels: Container[int]) -> Iterator[McapRecord]:
    """Iterate over the channels of a chunk, and over its messages on ``channels``.

    mcap makes an object of every message, also of those that nobody asks for, which takes most of the time.
    """
    stream, size = get_chunk_data_stream(chunk, validate_crc=True)
    data, end = stream.read(size), 0
    while end < size:
        opcode, length = _HEAD.unpack_from(data, end)
        start = end + _HEAD.size
        end = start + length
        if end > size:
            raise EndOfFile()
        if opcode == Opcode.MESSAGE:
            channel, sequence, logged, published = _MESSAGE_HEAD.unpack_from(data, start)
            if channel in channels:
                text = data[start + _MESSAGE_HEAD.size : end]
                yield Message(channel, logged, text, published, sequence)
        elif opcode == Opcode.CHANNEL:
            yield Channel.read(ReadDataStream(BytesIO(data[start:end])))
