"""The records of an MCAP file, read in order."""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Container, Iterator
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile, McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Footer, McapRecord, Message
from mcap.stream_reader import MAGIC_SIZE, CRCValidationError, StreamReader, get_chunk_data_stream

from msrr_bullet.log.codec import LogError

#: Errors that the MCAP reader raises when a record is cut off or damaged.
_DAMAGE = (
    *(McapError, CRCValidationError, struct.error, zstandard.ZstdError, ValueError),
    *(OverflowError, MemoryError, RuntimeError),  # of lengths that cannot be, and of LZ4
)

#: Opcode and length of an MCAP record, and what a message begins with: channel, sequence, two times [ns].
_HEAD, _MESSAGE_HEAD = struct.Struct("<BQ"), struct.Struct("<HIQQ")

#: Size of the checksum with which the footer ends [bytes].
_CHECKSUM_SIZE = 4


def mcap_records(path: Path, complete: bool, channels: Container[int]) -> Iterator[McapRecord]:
    """Iterate over the records of an MCAP file, those in its chunks included.

    One that is not ``complete`` may end anywhere. ``channels`` are the numbers of those whose messages are
    yielded; the caller may add some on the way.

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
            if complete:
                assert isinstance(record, Footer), "the reader ends with it"
                _check_summary(file, record)
    except OSError as error:
        raise LogError(f"{path}: cannot read the log: {error.strerror}") from error
    except _DAMAGE as error:
        if complete:
            raise LogError(f"{path}: the log is damaged: {_in_words(error)}") from error


def _check_summary(file: BinaryIO, footer: Footer) -> None:
    """Check what mcap does not: the schemas, channels and indices at the end, by which others read the file.

    Raises:
        CRCValidationError: Their checksum is not that of the bytes there.
    """
    if footer.summary_crc == 0:  # it was not computed
        return
    end = file.seek(-MAGIC_SIZE - _CHECKSUM_SIZE, os.SEEK_END)
    start = file.seek(min(footer.summary_start, end))
    found = zlib.crc32(file.read(end - start))
    if found != footer.summary_crc:
        raise CRCValidationError(expected=footer.summary_crc, actual=found, record=footer)


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
