"""Recorder that writes the log of a trial as MCAP.

Messages are encoded at once, in the thread of the caller. One worker thread writes them to the file in
batches and in order; it also encodes pixels as PNG and compresses, which releases the interpreter lock, so
that the trial continues meanwhile. The bytes of the file depend neither on the scheduling of the two threads
nor on the wall clock.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import BinaryIO

from mcap.writer import CompressionType, IndexType, Writer

from msrr_bullet.log import topics
from msrr_bullet.log.codec import LogError, log_name, to_bytes
from msrr_bullet.log.formats import Format, format_of
from msrr_bullet.log.foxglove import scene_frames, step_frames
from msrr_bullet.log.header import LIBRARY, METADATA, LogHeader
from msrr_bullet.log.records import CameraWindow, StepStart
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.messages import NS_PER_S, Exposure, Pixels

#: Size of a batch, and number of batches that may wait for the worker. Together they bound the memory.
_BATCH_BYTES = 1 << 18
_BATCHES_WAITING = 8

#: Approximate overhead of a message in memory [bytes].
_OVERHEAD_BYTES = 256


@dataclass(frozen=True, slots=True, eq=False)
class _Entry:
    """Message that waits to be written: encoded, or with pixels that the worker has yet to encode."""

    topic: str
    format: Format
    stamp_ns: int
    sequence: int
    content: bytes | CameraWindow


class McapRecorder:
    """Recorder to an MCAP file, of which at most the last second is lost if the process dies."""

    def __init__(self, path: Path, header: LogHeader, flush_every_s: float = 1.0) -> None:
        """Open the file, overwriting an existing one, and write the header.

        Args:
            path: File to write, in an existing folder.
            header: Scene, seed, versions.
            flush_every_s: Simulated time between two flushes to the disk [s].

        Raises:
            LogError: The file cannot be written.
        """
        self._path = path
        self._sequence = 0
        self._flush_every_ns = round(flush_every_s * NS_PER_S)
        self._flush_at = self._flush_every_ns
        self._batch: list[_Entry] = []
        self._batch_bytes = 0
        self._waiting: deque[Future[None]] = deque()
        self._failed: LogError | None = None
        self._closed = False
        try:
            self._file: BinaryIO = path.open("wb")
        except OSError as error:
            raise LogError(f"{path}: cannot write the log: {error.strerror}") from error
        self._writer = _Writer(self._file)
        self._worker = ThreadPoolExecutor(max_workers=1, thread_name_prefix="msrr-log")
        self._submit(self._writer.start, header)
        self._await_batches(0)
        self._scene = header.scene
        self.write(topics.FRAMES, 0, scene_frames(header.scene))

    def write(self, topic: str, stamp_ns: int, message: object) -> None:
        """Record a message; see :class:`~msrr_bullet.log.recorder.Recorder`.

        The start of a step is followed by the frame in which the estimates of that step are given.
        """
        message_format = format_of(message)
        if isinstance(message, CameraWindow):
            # The camera may overwrite its buffer before the worker encodes the pixels.
            copy = CameraWindow(message.exposure, message.window, message.pixels.copy())
            self._append(topic, message_format, stamp_ns, copy, copy.pixels.nbytes)
        else:
            content = to_bytes(message_format.encode(message, topic))
            self._append(topic, message_format, stamp_ns, content, len(content))
        if isinstance(message, StepStart) and (frames := step_frames(self._scene, message)).links:
            self.write(topics.FRAMES, stamp_ns, frames)

    def window(self, exposure: Exposure, window: Window, pixels: Pixels) -> None:
        """Record the pixels that were read from a window of an exposure."""
        self.write(topics.window(exposure.camera), exposure.stamp_ns, CameraWindow(exposure, window, pixels))

    def close(self) -> None:
        """Write the waiting messages, the index and the end of the file.

        Raises:
            LogError: The file cannot be written. It is closed nevertheless.
        """
        if self._closed:
            return
        self._closed = True
        try:
            if self._failed is None:
                self._send()
                self._submit(self._writer.finish)
                self._await_batches(0)
        finally:
            self._worker.shutdown()
            try:
                self._file.close()
            except OSError as error:
                # After a failed write the buffer cannot be flushed either. That failure was already reported.
                if self._failed is None:
                    raise LogError(f"{self._path}: cannot write the log: {error.strerror}") from error

    def __enter__(self) -> McapRecorder:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close."""
        self.close()

    def _append(
        self, topic: str, message_format: Format, stamp_ns: int, content: bytes | CameraWindow, size: int
    ) -> None:
        if self._closed:
            raise LogError(f"{self._path}: the log is closed")
        if self._failed is not None:
            raise self._failed
        if stamp_ns >= self._flush_at:
            self._send(flush=True)
            self._flush_at = (stamp_ns // self._flush_every_ns + 1) * self._flush_every_ns
        self._batch.append(_Entry(topic, message_format, stamp_ns, self._sequence, content))
        self._sequence += 1
        self._batch_bytes += size + _OVERHEAD_BYTES
        if self._batch_bytes >= _BATCH_BYTES:
            self._send()

    def _send(self, flush: bool = False) -> None:
        batch, self._batch, self._batch_bytes = self._batch, [], 0
        self._submit(self._writer.write, batch, flush)
        self._await_batches(_BATCHES_WAITING)

    def _submit(self, task: Callable[..., None], *args: object) -> None:
        self._waiting.append(self._worker.submit(task, *args))

    def _await_batches(self, allowed: int) -> None:
        """Wait until at most ``allowed`` batches are being written, and raise the error of a failed one."""
        while self._waiting and (len(self._waiting) > allowed or self._waiting[0].done()):
            try:
                self._waiting.popleft().result()
            except OSError as error:
                self._failed = LogError(f"{self._path}: cannot write the log: {error.strerror or error}")
                raise self._failed from error


class _Writer:
    """Writer of the MCAP file. All of its methods run in the worker thread, in the order of recording."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._mcap = Writer(file, compression=CompressionType.ZSTD, index_types=IndexType.ALL)
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}

    def start(self, header: LogHeader) -> None:
        self._mcap.start(profile="", library=LIBRARY)
        self._mcap.add_metadata(METADATA, header.metadata())
        for name, content in header.files.items():
            kind = "application/xml" if name.endswith(".urdf") else "application/octet-stream"
            self._mcap.add_attachment(0, 0, name, kind, content)
        self._mcap.flush()

    def write(self, batch: list[_Entry], flush: bool) -> None:
        for entry in batch:
            content = entry.content
            if isinstance(content, CameraWindow):
                content = to_bytes(entry.format.encode(content, entry.topic))
            self._mcap.add_message(
                channel_id=self._channel(entry.topic, entry.format),
                log_time=entry.stamp_ns,
                publish_time=entry.stamp_ns,
                sequence=entry.sequence,
                data=content,
            )
        if flush:
            self._mcap.flush()

    def finish(self) -> None:
        self._mcap.finish()
        self._file.flush()

    def _channel(self, topic: str, message_format: Format) -> int:
        kind = log_name(message_format.kind)
        key = f"{topic}\0{kind}"
        if key not in self._channels:
            if kind not in self._schemas:
                self._schemas[kind] = self._mcap.register_schema(
                    message_format.schema_name, "jsonschema", to_bytes(message_format.schema)
                )
            self._channels[key] = self._mcap.register_channel(
                topic, "json", self._schemas[kind], {"type": kind}
            )
        return self._channels[key]
