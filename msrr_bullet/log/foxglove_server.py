"""Server of a running trial for Foxglove, over its WebSocket protocol, on loopback."""

from __future__ import annotations

import threading
import time
from functools import partial
from types import TracebackType

import foxglove
from foxglove.websocket import ChannelView, Client, ServerListener

from msrr_bullet.log.channel_kind import ChannelKind
from msrr_scenes.errors import MsrrError

#: Address of the server; the port is the one that Foxglove expects.
HOST, PORT = "127.0.0.1", 8765

#: Time on the wall clock for which the first message after the start waits for a client [s].
_WAIT_S = 20.0


class FoxgloveServer:
    """Publishes the messages of a log while they are written, no faster than they were sent.

    A client that connects late gets what is said only at the start: cameras, frames, the shapes of bodies.
    """

    def __init__(self) -> None:
        """Open the server at :data:`PORT`, or at a port that is free if that is taken.

        Raises:
            MsrrError: There is no port to listen on.
        """
        self._channels: dict[str, foxglove.Channel] = {}
        self._first: dict[str, list[bytes]] = {}
        self._subscribed = threading.Event()
        self._begun: float | None = None
        self._context = foxglove.Context()
        start = partial(
            foxglove.start_server,
            name="msrr-bullet",
            host=HOST,
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
            time.sleep(max(self._begun + 1e-9 * stamp_ns - time.monotonic(), 0.0))
        if topic not in self._channels:
            schema = foxglove.Schema(name=kind.name, encoding=kind.schema_encoding, data=kind.schema)
            self._channels[topic] = foxglove.Channel(
                topic, schema=schema, message_encoding=kind.encoding, context=self._context
            )
        if stamp_ns == 0:
            self._first.setdefault(topic, []).append(data)
        self._channels[topic].log(data, log_time=stamp_ns)

    def repeat_first(self, topic: str) -> None:
        """Send again what was said at the start, to a client that has just asked for a topic."""
        self._subscribed.set()
        for data in self._first.get(topic, ()):
            self._channels[topic].log(data, log_time=0)

    def close(self) -> None:
        """Stop the server."""
        self._server.stop()

    def __enter__(self) -> FoxgloveServer:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close."""
        self.close()


class _Listener(ServerListener):
    def __init__(self, server: FoxgloveServer) -> None:
        self._server = server

    def on_subscribe(self, client: Client, channel: ChannelView) -> None:
        self._server.repeat_first(channel.topic)
