"""Server of the live page. It listens on loopback only and ends when its standard input ends.

:mod:`msrr_bullet.viewer.live` runs it as a separate program. It needs tornado and nothing of this project,
and therefore starts quickly. Its standard input is a stream of packets, each with a :data:`HEADER` (kind,
length of the key, length of the data), a key and the data. When the parent ends, even by a signal that cannot
be caught, that stream is closed, and the server ends.
"""

from __future__ import annotations

import asyncio
import logging
import os
import struct
import sys
import threading
from collections.abc import Callable
from typing import BinaryIO

import tornado.httpserver
import tornado.netutil
import tornado.web
import tornado.websocket

HOST = "127.0.0.1"
HEADER = struct.Struct(">cII")
PAGE, COMMAND, READING = b"p", b"c", b"r"
#: Written to standard output when a browser has opened the page, and when one has left it.
OPENED, CLOSED = "opened", "closed"
#: Interval at which the server checks that its parent runs [s]. The end of the parent closes the input at
#: once, unless a fork of the parent holds a copy of the pipe.
PARENT_CHECK = 0.5


class PageState:
    """Present state of the page, and the browsers that show it."""

    def __init__(self) -> None:
        self.page = b""
        self.messages: dict[bytes, bytes | str] = {}
        self.browsers: set[Browser] = set()

    def put(self, kind: bytes, key: bytes, data: bytes) -> None:
        """Process one packet of the parent."""
        if kind == PAGE:
            self.page = data
            return
        message: bytes | str = data.decode() if kind == READING else data
        # The key moves to the end, so that a browser that connects late gets the changes in their order.
        self.messages.pop(key, None)
        self.messages[key] = message
        for browser in self.browsers:
            browser.put(key, message)


class Page(tornado.web.RequestHandler):
    """Handler that serves the page."""

    def initialize(self, state: PageState) -> None:
        """Store the state of the page."""
        self.state = state

    def get(self) -> None:
        """Return the page."""
        self.set_header("Cache-Control", "no-store")
        self.finish(self.state.page)


class Browser(tornado.websocket.WebSocketHandler):
    """Connection to one browser. For a slow one, only the latest message of every key is kept waiting."""

    def initialize(self, state: PageState) -> None:
        """Store the state of the page."""
        self.state = state
        self.waiting: dict[bytes, bytes | str] = {}
        self.message_waits = asyncio.Event()

    def open(self, *args: str, **kwargs: str) -> None:
        """Send the present state, then every change."""
        for key, message in self.state.messages.items():
            self.put(key, message)
        self.state.browsers.add(self)
        self.sender = asyncio.create_task(self._send())
        _say(OPENED)

    def on_message(self, message: str | bytes) -> None:
        """Drop what a client says; the page says nothing."""

    def on_close(self) -> None:
        """Remove the browser."""
        self.state.browsers.discard(self)
        self.sender.cancel()
        _say(CLOSED)

    def put(self, key: bytes, message: bytes | str) -> None:
        """Queue a message in place of an older one with the same key."""
        self.waiting.pop(key, None)
        self.waiting[key] = message
        self.message_waits.set()

    async def _send(self) -> None:
        while True:
            await self.message_waits.wait()
            self.message_waits.clear()
            batch, self.waiting = self.waiting, {}
            for message in batch.values():
                try:
                    await self.write_message(message, binary=isinstance(message, bytes))
                except tornado.websocket.WebSocketClosedError:
                    return  # on_close follows


def _say(line: str) -> None:
    """Write a line to the parent."""
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def read_packets(stream: BinaryIO, put: Callable[[bytes, bytes, bytes], None]) -> None:
    """Call ``put`` with every packet of a stream until the stream ends, even in the middle of a packet."""
    while len(header := stream.read(HEADER.size)) == HEADER.size:
        kind, key_length, data_length = HEADER.unpack(header)
        body = stream.read(key_length + data_length)
        if len(body) < key_length + data_length:
            return
        put(kind, body[:key_length], body[key_length:])


async def serve(port: int) -> None:
    """Serve until the input or the parent ends."""
    state, loop, done = PageState(), asyncio.get_running_loop(), asyncio.Event()
    # Other host names are refused, so that a foreign page whose name resolves to this address gets nothing.
    application = tornado.web.Application()
    handlers = [(r"/", Page, {"state": state}), (r"/feed", Browser, {"state": state})]
    application.add_handlers(r"(127\.0\.0\.1|localhost)", handlers)
    try:
        sockets = tornado.netutil.bind_sockets(port, HOST)
    except OSError:
        sockets = tornado.netutil.bind_sockets(0, HOST)
    tornado.httpserver.HTTPServer(application).add_sockets(sockets)

    def put(kind: bytes, key: bytes, data: bytes) -> None:
        loop.call_soon_threadsafe(state.put, kind, key, data)

    def read() -> None:
        read_packets(sys.stdin.buffer, put)
        loop.call_soon_threadsafe(done.set)

    threading.Thread(target=read, daemon=True).start()
    _say(f"http://{HOST}:{sockets[0].getsockname()[1]}/")
    parent = os.getppid()
    while not done.is_set() and os.getppid() == parent:
        try:
            await asyncio.wait_for(done.wait(), PARENT_CHECK)
        except TimeoutError:
            continue


def main() -> None:
    """Run the server at the port that is its argument."""
    # Requests for a favicon and closed connections are not worth a warning.
    logging.getLogger("tornado").setLevel(logging.ERROR)
    asyncio.run(serve(int(sys.argv[1])))
    # The reading thread may be blocked in read(), so the process ends without waiting for it.
    sys.stdout.flush()
    os._exit(0)


if __name__ == "__main__":
    main()
