"""Writes a trial's log as MCAP.

Messages become bytes at once, in the caller's thread; they reach the file in batches, in their own order,
through one worker thread, which also turns pixels into PNG and compresses. Both release the interpreter, so
that the loop goes on meanwhile. Nothing in the file depends on how the two threads take turns, nor on the
wall clock.
"""

from __future__ import annotations

from collections import deque
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import BinaryIO

from mcap.writer import CompressionType, IndexType, Writer

from msrr_bullet.log import topics
from msrr_bullet.log.codec import LogError, log_name, to_bytes
from msrr_bullet.log.formats import Format, format_of
from msrr_bullet.log.frames import scene_frames, step_frames
from msrr_bullet.log.header import METADATA, LogHeader
from msrr_bullet.log.records import CameraWindow, StepStart
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.messages import NS_PER_S, Exposure, Pixels

#: Bytes waiting for the worker that make a batch, and batches that may wait. Together they bound the memory.
_BATCH_BYTES = 1 << 18
_BATCHES_WAITING = 8

#: A rough size of a message, pixels aside.
_MESSAGE_BYTES = 256


@dataclass(frozen=True, slots=True, eq=False)
class _Entry:
    """A message on its way to the file: its bytes, or pixels that have yet to be encoded."""

    topic: str
    form: Format
    stamp_ns: int
    sequence: int
    content: bytes | CameraWindow


class McapRecorder:
    """Records to an MCAP file; if the process dies, all but the last second of simulated time can be read."""

    def __init__(self, path: Path, header: LogHeader, flush_every_s: float = 1.0) -> None:
        """Open the file, overwriting what was there, and write the head.

        Args:
            path: The file; its folder exists.
            header: Scene, seed, versions.
            flush_every_s: Simulated time [s] after which what was recorded goes to the disk.

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
        self._sink = _Sink(self._file)
        self._worker = ThreadPoolExecutor(max_workers=1, thread_name_prefix="msrr-log")
        self._submit(self._worker.submit(self._sink.start, header))
        self._settle(0)
        self._scene = header.scene
        self.write(topics.FRAMES, 0, scene_frames(header.scene))

    def write(self, topic: str, stamp_ns: int, message: object) -> None:
        """Record a message; see :class:`~msrr_bullet.log.recorder.Recorder`.

        The start of a step is followed by the frame in which the estimates of that step are given.
        """
        form = format_of(message)
        if isinstance(message, CameraWindow):
            # The camera may use its buffer again before the worker gets here.
            copy = CameraWindow(message.exposure, message.window, message.pixels.copy())
            self._append(topic, form, stamp_ns, copy, copy.pixels.nbytes)
        else:
            content = to_bytes(form.encode(message, topic))
            self._append(topic, form, stamp_ns, content, len(content))
        if isinstance(message, StepStart):
            self.write(topics.FRAMES, stamp_ns, step_frames(self._scene, message))

    def window(self, exposure: Exposure, window: Window, pixels: Pixels) -> None:
        """Record the pixels that were read from a window of an exposure."""
        self.write(topics.window(exposure.camera), exposure.stamp_ns, CameraWindow(exposure, window, pixels))

    def close(self) -> None:
        """Write what is left, the index and the end of the file.

        Raises:
            LogError: The file cannot be written. It is closed all the same.
        """
        if self._closed:
            return
        self._closed = True
        try:
            if self._failed is None:
                self._send()
                self._submit(self._worker.submit(self._sink.finish))
                self._settle(0)
        finally:
            self._worker.shutdown()
            try:
                self._file.close()
            except OSError as error:
                # After a failed write the buffer cannot be written either; that failure was already reported.
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
        self, topic: str, form: Format, stamp_ns: int, content: bytes | CameraWindow, size: int
    ) -> None:
        if self._closed:
            raise LogError(f"{self._path}: the log is closed")
        if self._failed is not None:
            raise self._failed
        if stamp_ns >= self._flush_at:
            self._send(flush=True)
            self._flush_at = (stamp_ns // self._flush_every_ns + 1) * self._flush_every_ns
        self._batch.append(_Entry(topic, form, stamp_ns, self._sequence, content))
        self._sequence += 1
        self._batch_bytes += size + _MESSAGE_BYTES
        if self._batch_bytes >= _BATCH_BYTES:
            self._send()

    def _send(self, flush: bool = False) -> None:
        batch, self._batch, self._batch_bytes = self._batch, [], 0
        self._submit(self._worker.submit(self._sink.take, batch, flush))
        self._settle(_BATCHES_WAITING)

    def _submit(self, future: Future[None]) -> None:
        self._waiting.append(future)

    def _settle(self, allowed: int) -> None:
        """Wait until at most ``allowed`` batches are under way; learn whether the others were written."""
        while self._waiting and (len(self._waiting) > allowed or self._waiting[0].done()):
            try:
                self._waiting.popleft().result()
            except OSError as error:
                self._failed = LogError(f"{self._path}: cannot write the log: {error.strerror or error}")
                raise self._failed from error


class _Sink:
    """The worker's side: everything here runs in one thread, in the order of recording."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._writer = Writer(file, compression=CompressionType.ZSTD, index_types=IndexType.ALL)
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}

    def start(self, header: LogHeader) -> None:
        self._writer.start(profile="", library="msrr-bullet")
        self._writer.add_metadata(METADATA, header.metadata())
        for name, content in header.files.items():
            kind = "application/xml" if name.endswith(".urdf") else "application/octet-stream"
            self._writer.add_attachment(0, 0, name, kind, content)
        self._writer.flush()  # type: ignore[no-untyped-call]  # mcap annotates its others

    def take(self, batch: list[_Entry], flush: bool) -> None:
        for entry in batch:
            content = entry.content
            if isinstance(content, CameraWindow):
                content = to_bytes(entry.form.encode(content, entry.topic))
            self._writer.add_message(
                channel_id=self._channel(entry.topic, entry.form),
                log_time=entry.stamp_ns,
                publish_time=entry.stamp_ns,
                sequence=entry.sequence,
                data=content,
            )
        if flush:
            self._writer.flush()  # type: ignore[no-untyped-call]  # mcap annotates its others

    def finish(self) -> None:
        self._writer.finish()  # type: ignore[no-untyped-call]  # mcap annotates its others
        self._file.flush()

    def _channel(self, topic: str, form: Format) -> int:
        kind = log_name(form.kind)
        key = f"{topic}\0{kind}"
        if key not in self._channels:
            if kind not in self._schemas:
                self._schemas[kind] = self._writer.register_schema(
                    form.schema_name, "jsonschema", to_bytes(form.schema)
                )
            self._channels[key] = self._writer.register_channel(
                topic, "json", self._schemas[kind], {"type": kind}
            )
        return self._channels[key]
