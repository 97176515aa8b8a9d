"""Server of a running trial for Foxglove, over its WebSocket protocol, on loopback."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Callable
from functools import cache, partial
from types import FrameType
from typing import Any

import foxglove
from foxglove.messages import FrameTransforms
from foxglove.websocket import Capability, ChannelView, Client, ServerListener
from mcap.records import Schema
from mcap_protobuf.decoder import DecoderFactory

from msrr_bullet.log import topics
from msrr_bullet.log.channel_kind import ChannelKind
from msrr_scenes.errors import MsrrError

#: Address of the server; the port is the one that Foxglove expects.
HOST, PORT = "127.0.0.1", 8765

#: Time on the wall clock for which the first message after the start waits for a client [s].
_WAIT_S = 20.0

#: Least simulated time between two readings of the clock that are sent while the trial runs [ns], about that
#: between two images of a screen. Not every message has a reading of its own: the SDK (0.30) queues no more
#: than 1024 for a client, 20 s with this one, and disconnects a client that falls further behind.
_CLOCK_NS = 20_000_000


class FoxgloveServer:
    """Publishes the messages of a log and their clock while they are written, no faster than they were sent.

    A client that subscribes late gets the last message of the topic, as from a publisher of ROS 2 whose
    durability is transient local; of the transforms the last one of every frame, and all lines of the log.
    In a ``with`` block, Ctrl-C and SIGTERM end its waiting: what is left is sent at once.
    """

    def __init__(self) -> None:
        """Open the server at :data:`PORT`, or at a port that is free if that is taken.

        Raises:
            MsrrError: There is no port to listen on.
        """
        self._channels: dict[str, foxglove.Channel] = {}
        self._kept: dict[str, list[bytes]] = {}  # by topic, what late clients get
        self._frames: dict[str, Any] = {}  # the last transform of each, by its name
        self._now_ns = 0
        self._clock_due_ns = 0
        self._lock = threading.Lock()  # clients subscribe in threads of the server
        self._subscribed, self._hurries = threading.Event(), threading.Event()
        self._handlers: dict[int, Callable[[int, FrameType | None], Any]] = {}  # those before, by signal
        self._begun: float | None = None
        self._context = foxglove.Context()
        start = partial(
            foxglove.start_server,
            name="msrr-bullet",
            host=HOST,
            capabilities=[Capability.Time],
            server_listener=_Listener(self),
            context=self._context,
        )
        try:
            self._server = start(port=PORT)
        except RuntimeError:
            try:
                self._server = start(port=0)
            except RuntimeError as error:
                raise MsrrError(f"the server for Foxglove cannot listen on {HOST}: {error}") from None

    @property
    def url(self) -> str:
        """Address for "Open connection" in Foxglove."""
        return f"ws://{HOST}:{self._server.port}"

    def publish(self, topic: str, kind: ChannelKind, stamp_ns: int, data: bytes) -> None:
        """Send a message when its time has come."""
        if stamp_ns > 0:
            if self._begun is None:
                self._subscribed.wait(_WAIT_S)
                self._begun = time.monotonic()
            self._hurries.wait(max(self._begun + 1e-9 * stamp_ns - time.monotonic(), 0.0))
        with self._lock:
            if topic not in self._channels:
                schema = foxglove.Schema(name=kind.name, encoding=kind.schema_encoding, data=kind.schema)
                self._channels[topic] = foxglove.Channel(
                    topic, schema=schema, message_encoding=kind.encoding, context=self._context
                )
            earlier = self._kept.get(topic, []) if topic == topics.LOG_LINES else []
            self._kept[topic] = [*earlier, data]
            if topic == topics.TRANSFORMS:
                links = _transforms_decoder()(data).transforms
                self._frames.update((link.child_frame_id, link) for link in links)
            self._now_ns = max(self._now_ns, stamp_ns)
            if self._now_ns >= self._clock_due_ns:
                self._server.broadcast_time(self._now_ns)
                self._clock_due_ns = self._now_ns + _CLOCK_NS
            self._channels[topic].log(data, log_time=stamp_ns)

    def repeat_last(self, topic: str) -> None:
        """Send the clock and the last of a topic again, to a client that has just subscribed to it.

        All clients get it, because the SDK does not tell in Python which one that is. For the others it
        repeats what they have; the panel of a log shows them its lines twice.
        """
        with self._lock:
            self._server.broadcast_time(self._now_ns)
            for data in [self._all_frames()] if topic == topics.TRANSFORMS else self._kept[topic]:
                self._channels[topic].log(data, log_time=self._now_ns)
        self._subscribed.set()

    def _all_frames(self) -> bytes:
        """Return a message with the last transform of every frame."""
        message = _transforms_decoder()(b"")
        message.transforms.extend(self._frames.values())
        data: bytes = message.SerializeToString()
        return data

    def close(self) -> None:
        """Stop the server."""
        self._server.stop()

    def __enter__(self) -> FoxgloveServer:
        if threading.current_thread() is threading.main_thread():  # which alone gets signals
            for number in (signal.SIGINT, signal.SIGTERM):
                before = signal.getsignal(number)
                if callable(before):
                    self._handlers[number] = before
                    signal.signal(number, self._hurry)
        return self

    def _hurry(self, number: int, frame: FrameType | None) -> None:
        """Let nothing wait any more, for whoever ends a trial waits until its log is written."""
        self._hurries.set()
        self._subscribed.set()
        self._handlers[number](number, frame)

    def __exit__(self, *_: object) -> None:
        """Close."""
        for number, before in self._handlers.items():
            signal.signal(number, before)
        self._handlers.clear()
        self.close()


@cache
def _transforms_decoder() -> Callable[[bytes], Any]:
    """Return what decodes messages of transforms; Foxglove's own class only encodes them."""
    schema = FrameTransforms.get_schema()
    decode = DecoderFactory().decoder_for("protobuf", Schema(1, schema.data, schema.encoding, schema.name))
    assert decode is not None, "the factory decodes protobuf"
    return decode


class _Listener(ServerListener):
    def __init__(self, server: FoxgloveServer) -> None:
        self._server = server

    def on_subscribe(self, client: Client, channel: ChannelView) -> None:
        self._server.repeat_last(channel.topic)
