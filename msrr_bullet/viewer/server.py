"""The server behind the live page: loopback only, fed through its standard input, gone when that ends.

Run as a program of its own by :mod:`msrr_bullet.viewer.live`. It needs tornado and nothing of this project,
and so starts quickly. Its standard input is a stream of frames, each a :data:`HEADER` (kind, length of the
key, length of the data), a key and the data. Whatever ends the parent, a signal that cannot be caught
included, closes that stream and with it the server.
"""

from __future__ import annotations

import argparse
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
#: Written to standard output when a browser has opened the page.
OPENED = "opened"
#: How often the parent is looked for [s]. Its end closes the input at once, unless a fork holds a copy of it.
PARENT_CHECK = 0.5


class Board:
    """The present state of the page, and who looks at it."""

    def __init__(self) -> None:
        self.page = b""
        self.state: dict[bytes, bytes | str] = {}
        self.browsers: set[Feed] = set()

    def put(self, kind: bytes, key: bytes, data: bytes) -> None:
        """Take one frame of the parent's."""
        if kind == PAGE:
            self.page = data
            return
        message: bytes | str = data.decode() if kind == READING else data
        # Put in at the end, so that a browser that comes late gets them in the order of their last changes.
        self.state.pop(key, None)
        self.state[key] = message
        for browser in self.browsers:
            browser.put(key, message)


class Page(tornado.web.RequestHandler):
    """Serves the page."""

    def initialize(self, board: Board) -> None:
        """Keep the board."""
        self.board = board

    def get(self) -> None:
        """Return the page."""
        self.set_header("Cache-Control", "no-store")
        self.finish(self.board.page)


class Feed(tornado.websocket.WebSocketHandler):
    """One browser. Of what it is too slow to take, only the latest of each key waits for it."""

    def initialize(self, board: Board) -> None:
        """Keep the board."""
        self.board = board
        self.waiting: dict[bytes, bytes | str] = {}
        self.news = asyncio.Event()

    def open(self, *args: str, **kwargs: str) -> None:
        """Send everything that is there, then what comes."""
        for key, message in self.board.state.items():
            self.put(key, message)
        self.board.browsers.add(self)
        self.sender = asyncio.create_task(self._send())
        sys.stdout.write(f"{OPENED}\n")
        sys.stdout.flush()

    def on_close(self) -> None:
        """Forget the browser."""
        self.board.browsers.discard(self)
        self.sender.cancel()

    def put(self, key: bytes, message: bytes | str) -> None:
        """Queue a message in place of an older one of that key."""
        self.waiting.pop(key, None)
        self.waiting[key] = message
        self.news.set()

    async def _send(self) -> None:
        while True:
            await self.news.wait()
            self.news.clear()
            batch, self.waiting = self.waiting, {}
            for message in batch.values():
                try:
                    await self.write_message(message, binary=isinstance(message, bytes))
                except tornado.websocket.WebSocketClosedError:
                    return  # on_close follows


def read_frames(stream: BinaryIO, put: Callable[[bytes, bytes, bytes], None]) -> None:
    """Hand on the frames of ``stream`` until it ends, in the middle of a frame or not."""
    while len(header := stream.read(HEADER.size)) == HEADER.size:
        kind, key_length, data_length = HEADER.unpack(header)
        body = stream.read(key_length + data_length)
        if len(body) < key_length + data_length:
            return
        put(kind, body[:key_length], body[key_length:])


async def serve(port: int) -> None:
    """Serve until the input ends or the parent is gone."""
    board, loop, done = Board(), asyncio.get_running_loop(), asyncio.Event()
    # Only these names: a page elsewhere whose name is made to point here is refused.
    application = tornado.web.Application()
    handlers = [(r"/", Page, {"board": board}), (r"/feed", Feed, {"board": board})]
    application.add_handlers(r"(127\.0\.0\.1|localhost)", handlers)
    try:
        sockets = tornado.netutil.bind_sockets(port, HOST)
    except OSError:
        sockets = tornado.netutil.bind_sockets(0, HOST)
    tornado.httpserver.HTTPServer(application).add_sockets(sockets)

    def put(kind: bytes, key: bytes, data: bytes) -> None:
        loop.call_soon_threadsafe(board.put, kind, key, data)

    def read() -> None:
        read_frames(sys.stdin.buffer, put)
        loop.call_soon_threadsafe(done.set)

    threading.Thread(target=read, daemon=True).start()
    sys.stdout.write(f"http://{HOST}:{sockets[0].getsockname()[1]}/\n")
    sys.stdout.flush()
    parent = os.getppid()
    while not done.is_set() and os.getppid() == parent:
        try:
            await asyncio.wait_for(done.wait(), PARENT_CHECK)
        except TimeoutError:
            continue


def main() -> None:
    """Run the server."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--port", type=int, default=0)
    arguments = parser.parse_args()
    # A browser asks for a favicon and goes away when it likes; neither is news.
    logging.getLogger("tornado").setLevel(logging.ERROR)
    asyncio.run(serve(arguments.port))
    # The reading thread may be inside read(); leave without waiting for it.
    sys.stdout.flush()
    os._exit(0)


if __name__ == "__main__":
    main()
