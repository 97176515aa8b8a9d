"""Recorder that writes the log of a trial as MCAP.

Messages are encoded at once, in the thread of the caller. One worker thread writes them to the file in
batches and in order; it also encodes pixels as PNG and compresses, which releases the interpreter lock, so
that the trial continues meanwhile. The bytes of the file depend neither on the scheduling of the two threads
nor on the wall clock.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import BinaryIO

from foxglove.messages import CompressedImage
from mcap.writer import CompressionType, IndexType, Writer

from msrr_bullet.log import topics
from msrr_bullet.log.channel_kind import ChannelKind
from msrr_bullet.log.codec import LogError, log_name, to_bytes
from msrr_bullet.log.display import Display, DisplayMessages, Shown
from msrr_bullet.log.formats import format_named, format_of
from msrr_bullet.log.foxglove import compressed_image
from msrr_bullet.log.frame_tree import scene_frames
from msrr_bullet.log.frames import FRAMES_OF, FrameComposer
from msrr_bullet.log.header import LIBRARY, METADATA, LogHeader
from msrr_bullet.log.records import CameraWindow
from msrr_scenes.camera_lenses import camera_lenses
from msrr_scenes.geometry.lens import Lens
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.messages import NS_PER_S, Exposure, Pixels

#: Gets every message as it is written: topic, what its messages are, time [ns], content.
Listener = Callable[[str, ChannelKind, int, bytes], None]

#: Size of a batch, and number of batches that may wait for the worker. Together they bound the memory.
_BATCH_BYTES = 1 << 18
_BATCHES_WAITING = 8

#: Approximate overhead of a message in memory [bytes].
_OVERHEAD_BYTES = 256


@dataclass(frozen=True, slots=True, eq=False)
class _FrameToWrite:
    """A frame that the worker has yet to put together."""

    exposure: Exposure
    windows: list[tuple[Window, Pixels]]


@dataclass(frozen=True, slots=True, eq=False)
class _Entry:
    """Message that waits to be written: encoded, or a frame."""

    topic: str
    kind: ChannelKind
    stamp_ns: int
    sequence: int
    content: bytes | _FrameToWrite


@cache
def _exact_kind(name: str) -> ChannelKind:
    """Return the channels of an exact message: JSON, with the name of its class in logs."""
    schema = format_named(name).schema
    return ChannelKind(schema["title"], "jsonschema", to_bytes(schema), "json", (("type", name),))


@cache
def _shown_kind(kind: type[Shown], camera: str = "") -> ChannelKind:
    """Return the channels of a message for clients; the frames of a camera tell whose they are."""
    schema = kind.get_schema()
    metadata = ((FRAMES_OF, camera),) if camera else ()
    return ChannelKind(schema.name, schema.encoding, schema.data, "protobuf", metadata)


class McapRecorder:
    """Recorder to an MCAP file, of which at most the last second is lost if the process dies."""

    def __init__(
        self, path: Path, header: LogHeader, flush_every_s: float = 1.0, listener: Listener | None = None
    ) -> None:
        """Open the file, overwriting an existing one, and write the header.

        The folder has to exist. The file is flushed to the disk whenever ``flush_every_s`` of simulated time
        has passed. The listener gets every message in the thread that writes; while it takes its time, the
        trial waits.

        Raises:
            LogError: The file cannot be written.
        """
        self._path = path
        self._sequence = -1
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
        self._writer = _Writer(self._file, listener)
        self._worker = ThreadPoolExecutor(max_workers=1, thread_name_prefix="msrr-log")
        self._display = DisplayMessages(header.scene)
        self._frame: _FrameToWrite | None = None
        try:
            self._submit(self._writer.start, header)
            self._await_batches(0)
            self.write(topics.FRAMES, 0, scene_frames(header.scene))
            self._show(self._display.start())
        except BaseException:
            self.close()  # nobody else can: there is no recorder
            raise

    def write(self, topic: str, stamp_ns: int, message: object) -> None:
        """Record a message; see :class:`~msrr_bullet.log.recorder.Recorder`."""
        message_format = format_of(message)
        if isinstance(message, CameraWindow):
            frame = self._frame
            if frame is None or frame.exposure != message.exposure:
                self._finish_frame()
                frame = self._frame = _FrameToWrite(message.exposure, [])
            # The camera may overwrite its buffer before the worker puts the frame together.
            frame.windows.append((message.window, message.pixels.copy()))
        else:
            self._finish_frame()
        content = to_bytes(message_format.encode(message))
        self._append(topic, _exact_kind(log_name(type(message))), stamp_ns, content, len(content))
        if isinstance(message, Exposure):
            self._frame = _FrameToWrite(message, [])
        self._show(self._display.of(topic, stamp_ns, message))

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
        try:
            if self._failed is None:
                self._finish_frame()  # a trial that is interrupted may end in the middle of one
                self._send()
                self._submit(self._writer.finish)
                self._await_batches(0)
        finally:
            self._closed = True
            self._worker.shutdown()
            try:
                self._file.close()
            except OSError as error:
                # After a failed write the buffer cannot be flushed either. That failure was already reported.
                if self._failed is None:
                    raise LogError(f"{self._path}: cannot write the log: {error.strerror}") from error

    def __enter__(self) -> McapRecorder:
        return self

    def __exit__(self, *_: object) -> None:
        """Close."""
        self.close()

    def _finish_frame(self) -> None:
        """Record the frame of the last exposure: its windows are all there when another message comes."""
        frame, self._frame = self._frame, None
        if frame is not None:
            camera, size = frame.exposure.camera, sum(pixels.nbytes for _, pixels in frame.windows)
            kind = _shown_kind(CompressedImage, camera)
            self._append(topics.image(camera), kind, frame.exposure.stamp_ns, frame, size)

    def _show(self, messages: Iterator[Display]) -> None:
        for topic, stamp_ns, message in messages:
            content = message.encode()
            self._append(topic, _shown_kind(type(message)), stamp_ns, content, len(content))

    def _append(
        self, topic: str, kind: ChannelKind, stamp_ns: int, content: bytes | _FrameToWrite, size: int
    ) -> None:
        if self._closed:
            raise LogError(f"{self._path}: the log is closed")
        if self._failed is not None:
            raise self._failed
        if stamp_ns >= self._flush_at:
            self._send(flush=True)
            self._flush_at = (stamp_ns // self._flush_every_ns + 1) * self._flush_every_ns
        # Exact messages are counted; what clients show of one has its number.
        self._sequence += kind.encoding == "json"
        self._batch.append(_Entry(topic, kind, stamp_ns, self._sequence, content))
        self._batch_bytes += size + _OVERHEAD_BYTES
        if self._batch_bytes >= _BATCH_BYTES:
            self._send()

    def _send(self, flush: bool = False) -> None:
        batch, self._batch, self._batch_bytes = self._batch, [], 0
        self._submit(self._writer.write, batch, flush)
        self._await_batches(_BATCHES_WAITING)

    def _submit(self, task: Callable[..., None], *args: object) -> None:
        try:
            written = self._worker.submit(task, *args)
        except RuntimeError:  # Python ends, and its worker has finished; nobody has closed the trial
            written = Future()
            try:
                task(*args)
                written.set_result(None)
            except OSError as error:
                written.set_exception(error)
        self._waiting.append(written)

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

    def __init__(self, file: BinaryIO, listener: Listener | None) -> None:
        self._file, self._listener = file, listener
        self._mcap = Writer(file, compression=CompressionType.ZSTD, index_types=IndexType.ALL)
        self._channels: dict[tuple[str, ChannelKind], int] = {}
        self._schemas: dict[str, int] = {}
        self._cameras: dict[str, Lens] = {}
        self._composers: dict[str, FrameComposer] = {}

    def start(self, header: LogHeader) -> None:
        self._cameras = camera_lenses(header.scene)
        self._mcap.start(profile="", library=LIBRARY)
        self._mcap.add_metadata(METADATA, header.metadata())
        for name, content in header.files.items():
            kind = "application/xml" if name.endswith(".urdf") else "application/octet-stream"
            self._mcap.add_attachment(0, 0, name, kind, content)
        self._mcap.flush()

    def write(self, batch: list[_Entry], flush: bool) -> None:
        for entry in batch:
            content = entry.content
            if isinstance(content, _FrameToWrite):
                content = self._image(content)
            self._mcap.add_message(
                channel_id=self._channel(entry.topic, entry.kind),
                log_time=entry.stamp_ns,
                publish_time=entry.stamp_ns,
                sequence=entry.sequence,
                data=content,
            )
            if self._listener is not None:
                self._listener(entry.topic, entry.kind, entry.stamp_ns, content)
        if flush:
            self._mcap.flush()

    def finish(self) -> None:
        self._mcap.finish()
        self._file.flush()

    def _image(self, frame: _FrameToWrite) -> bytes:
        camera = frame.exposure.camera
        if camera not in self._composers:
            self._composers[camera] = FrameComposer(self._cameras[camera].camera.frame)
        png = self._composers[camera].png(frame.windows)
        return compressed_image(frame.exposure.stamp_ns, camera, png).encode()

    def _channel(self, topic: str, kind: ChannelKind) -> int:
        key = topic, kind
        if key not in self._channels:
            if kind.name not in self._schemas:
                self._schemas[kind.name] = self._mcap.register_schema(
                    kind.name, kind.schema_encoding, kind.schema
                )
            self._channels[key] = self._mcap.register_channel(
                topic, kind.encoding, self._schemas[kind.name], dict(kind.metadata)
            )
        return self._channels[key]
