"""The server for Foxglove: a client gets the messages of a log while it is written."""

from __future__ import annotations

import asyncio
import json
import os
import re
import signal
import socket
import struct
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from foxglove.messages import CameraCalibration
from mcap.reader import make_reader
from mcap.records import Schema
from mcap_protobuf.decoder import DecoderFactory
from tornado.websocket import websocket_connect

from msrr_bullet.log import Event, LogHeader, StepStart, topics
from msrr_bullet.log.foxglove_server import HOST, FoxgloveServer
from msrr_bullet.log.mcap_recorder import McapRecorder
from tests.bullet.log.conftest import record_trial

#: First bytes of the binary messages of a server.
MESSAGE_DATA, TIME = 1, 2

#: End of a trial of 0.3 s [ns].
END_NS = 300_000_000


async def first_of(
    url: str, wanted: dict[str, int], clock: list[int] | None = None
) -> dict[str, list[bytes]]:
    """Subscribe to topics, and return as many messages of each as are wanted.

    Readings of the clock [ns], of which at least one has to come, are added to ``clock`` if it is given.

    The SDK (0.30) sends the advertisement of a channel before it enters the channel in the list of what this
    client may subscribe to. It refuses a subscription that comes in between, which is then sent again.
    """
    connection = await websocket_connect(url, subprotocols=["foxglove.sdk.v1"])
    topics: dict[int, str] = {}
    got: dict[str, list[bytes]] = {topic: [] for topic in wanted}
    while clock == [] or any(len(got[topic]) < count for topic, count in wanted.items()):
        message = await asyncio.wait_for(connection.read_message(), 20.0)
        assert message is not None, "the server closed the connection"
        if isinstance(message, bytes):
            if message[0] == TIME:
                if clock is not None:
                    clock += struct.unpack_from("<Q", message, 1)
                continue
            kind, subscription, _ = struct.unpack_from("<BIQ", message)
            assert kind == MESSAGE_DATA
            got[topics[subscription]].append(message[13:])
            continue
        told = json.loads(message)
        subscribe_to: list[int] = []
        if told["op"] == "serverInfo":
            assert "time" in told["capabilities"]
        elif told["op"] == "advertise":
            new = {channel["id"]: channel["topic"] for channel in told["channels"]}
            subscribe_to = [channel for channel, topic in new.items() if topic in wanted]
            topics |= new
        elif told["op"] == "status":
            refused = re.fullmatch(r"Unknown channel ID: (\d+)", told["message"])
            assert refused, told
            subscribe_to = [int(refused[1])]
        for channel in subscribe_to:
            asked = {"id": channel, "channelId": channel}
            await connection.write_message(json.dumps({"op": "subscribe", "subscriptions": [asked]}))
    connection.close()
    return got


def decoded(schema: Schema, data: bytes) -> Any:
    decode = DecoderFactory().decoder_for("protobuf", schema)
    assert decode is not None
    return decode(data)


def test_a_client_sees_the_start_and_what_follows(tmp_path: Path, header: LogHeader) -> None:
    with FoxgloveServer() as server:
        assert server.url.startswith(f"ws://{HOST}:")

        served = threading.Event()

        def record() -> None:
            with McapRecorder(tmp_path / "t.mcap", header, listener=server.publish) as recorder:
                while not served.is_set():  # what a client asks for late is sent often enough
                    record_trial(recorder, 1.0)

        trial = threading.Thread(target=record)
        trial.start()
        wanted = {"/camera/a/onboard/calibration": 1, "/scene": 1, "/camera/a/onboard/image": 3}
        try:
            got = asyncio.run(first_of(server.url, wanted))
        finally:
            served.set()
        trial.join(30.0)
        assert not trial.is_alive()
    told = CameraCalibration.get_schema()
    schema = Schema(1, told.data, told.encoding, told.name)
    calibration = decoded(schema, got["/camera/a/onboard/calibration"][0])
    assert (calibration.width, calibration.height) == (640, 480)
    assert all(b"PNG" in image for image in got["/camera/a/onboard/image"])


def test_a_client_that_subscribes_late_gets_the_last_message_of_every_topic(
    tmp_path: Path, header: LogHeader
) -> None:
    """As transient local durability gives it; what that is, the file of the log says. It gets all events."""
    late = {"/tf": 1, "/scene": 1, "/scene/estimates": 1, "/joint_states/a": 1, "/log": 3, "/events": 1}
    clock: list[int] = []
    with FoxgloveServer() as server:

        def record() -> None:
            with McapRecorder(tmp_path / "t.mcap", header, listener=server.publish) as recorder:
                recorder.write(topics.STEPS, 0, StepStart(0, 0, "a"))
                recorder.write("/events", 0, Event(0, "a", "attempt 1"))
                record_trial(recorder, 0.3)
                for text in ("contact", "docked"):
                    recorder.write("/events", END_NS, Event(END_NS, "trial", text))

        with ThreadPoolExecutor(max_workers=1) as pool:
            recorded = pool.submit(record)
            asyncio.run(first_of(server.url, {"/scene": 1}))  # the trial waits for its first client
            recorded.result(30.0)
        got = asyncio.run(first_of(server.url, late, clock))
    assert set(clock) == {END_NS}
    sent: dict[str, list[bytes]] = {}
    frames: dict[str, object] = {}
    with (tmp_path / "t.mcap").open("rb") as file:
        for schema, channel, message in make_reader(file).iter_messages(log_time_order=False):
            sent.setdefault(channel.topic, []).append(message.data)
            if channel.topic == "/tf":
                assert schema is not None
                of_transforms = schema
                frames |= {t.child_frame_id: t for t in decoded(schema, message.data).transforms}
    (transforms,) = got.pop("/tf")
    told = {t.child_frame_id: str(t) for t in decoded(of_transforms, transforms).transforms}
    assert told == {name: str(t) for name, t in frames.items()}
    assert {"a", "a/onboard", "b.rear"} <= told.keys()
    assert got.pop("/log") == sent["/log"]
    assert {topic: sent[topic][-1:] for topic in got} == got


def test_clients_get_the_clock_of_the_trial(tmp_path: Path, header: LogHeader) -> None:
    """Without one, Foxglove takes that of the wall: it draws and plots by when messages arrive."""
    clock: list[int] = []
    with FoxgloveServer() as server, ThreadPoolExecutor(max_workers=1) as pool:

        def record() -> None:
            with McapRecorder(tmp_path / "t.mcap", header, listener=server.publish) as recorder:
                record_trial(recorder, 0.3)
                recorder.write("/events", END_NS, Event(END_NS, "trial", "contact"))

        recorded = pool.submit(record)
        asyncio.run(first_of(server.url, {"/scene": 1, "/log": 1}, clock))
        recorded.result(30.0)
    steps = np.diff(clock)
    assert (clock[0], clock[-1]) == (0, END_NS)
    assert 0 <= steps.min() <= steps.max() <= 20_000_000


def test_where_the_port_is_taken_another_one_serves() -> None:
    with FoxgloveServer() as first, FoxgloveServer() as second:
        assert first.url != second.url
        for server in (first, second):
            host, _, port = server.url.removeprefix("ws://").partition(":")
            socket.create_connection((host, int(port)), timeout=5.0).close()


def test_ctrl_c_ends_the_waiting_for_a_client(interruptible: None, tmp_path: Path, header: LogHeader) -> None:
    """The log is closed first, and waits until its messages are sent: it took 20 s, a second Ctrl-C too."""
    begun = time.monotonic()

    def record() -> None:
        path = tmp_path / "trial.mcap"
        with (
            FoxgloveServer() as server,
            McapRecorder(path, header, flush_every_s=0.01, listener=server.publish) as recorder,
        ):
            threading.Timer(0.5, os.kill, [os.getpid(), signal.SIGINT]).start()
            for stamp_ns in range(0, 100_000_000_000, 100_000_000):
                recorder.write(topics.EVENTS, stamp_ns, Event(stamp_ns, "step", "waits"))

    with pytest.raises(KeyboardInterrupt):
        record()
    assert time.monotonic() - begun < 5.0
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
