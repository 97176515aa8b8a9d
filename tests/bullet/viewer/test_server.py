"""Packets and messages of the server."""

from __future__ import annotations

import io

from msrr_bullet.viewer.server import COMMAND, HEADER, PAGE, READING, PageState, read_packets


def packet(kind: bytes, key: bytes, data: bytes) -> bytes:
    return HEADER.pack(kind, len(key), len(data)) + key + data


def test_packets_are_read_until_the_stream_ends_in_the_middle_of_one() -> None:
    packets = [(PAGE, b"", b"<html>"), (COMMAND, b"a", b"12"), (READING, b"readings", b"[]")]
    stream = b"".join(packet(*p) for p in packets)
    for cut in (len(stream), len(stream) - 1, len(stream) - 3, len(stream) - HEADER.size - 9):
        received: list[tuple[bytes, bytes, bytes]] = []
        read_packets(io.BytesIO(stream[:cut]), lambda *p, to=received: to.append(p))
        assert received == packets[: 3 if cut == len(stream) else 2]


def test_only_the_latest_message_of_a_key_is_kept_in_the_order_of_changes() -> None:
    state = PageState()
    for kind, key, data in (
        (PAGE, b"", b"p"),
        (COMMAND, b"a", b"1"),
        (COMMAND, b"b", b"2"),
        (COMMAND, b"a", b"3"),
    ):
        state.put(kind, key, data)
    state.put(READING, b"r", b"[1]")
    assert state.page == b"p"
    assert list(state.messages.items()) == [(b"b", b"2"), (b"a", b"3"), (b"r", "[1]")]
