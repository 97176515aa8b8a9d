"""Reading of complete, interrupted and damaged logs."""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.stream_reader import MAGIC_SIZE

from msrr_bullet.log import LogError, LogHeader, MemoryRecorder, read_log, topics
from msrr_bullet.log.codec import log_name
from msrr_bullet.log.formats import format_named
from msrr_bullet.log.frame_tree import scene_frames
from msrr_bullet.log.frames import LoggedFrame
from msrr_bullet.log.mcap_recorder import McapRecorder
from msrr_bullet.log.reader import LogRecord
from msrr_bullet.log.records import StartPoses
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import Exposure, GlobalPose, PoseMeasurement, WheelOdometry
from tests.bullet.log.conftest import bits, record_trial


def test_a_log_reads_back_in_its_order(tmp_path: Path, header: LogHeader) -> None:
    path = tmp_path / "trial.mcap"
    memory = MemoryRecorder()
    memory.write(topics.FRAMES, 0, scene_frames(header.scene))
    with McapRecorder(path, header) as recorder:
        record_trial(recorder, 2.5)
    record_trial(memory, 2.5)
    log = read_log(str(tmp_path))
    records = list(log.records())
    assert log.complete
    assert [r.sequence for r in records] == list(range(len(memory.messages)))
    for record, (topic, stamp_ns, message) in zip(records, memory.messages, strict=True):
        assert (record.topic, record.stamp_ns) == (topic, stamp_ns)
        assert bits(record.message) == bits(message)
    assert len(list(log.messages(WheelOdometry))) == 250
    some = list(log.records("/camera/*", start_ns=1_000_000_000, end_ns=2_000_000_000))
    assert {r.topic for r in some} == {"/camera/a/onboard/exposure", "/camera/a/onboard/window"}
    assert len(some) == 50
    assert {r.topic for r in log.records()} == {topic for topic, _, _ in memory.messages}


def test_messages_are_those_that_the_reader_of_mcap_finds(tmp_path: Path, header: LogHeader) -> None:
    path = tmp_path / "trial.mcap"
    with McapRecorder(path, header, flush_every_s=0.5) as recorder:
        record_trial(recorder, 2.5)
    with path.open("rb") as file:
        found = list(make_reader(file, validate_crcs=True).iter_messages(log_time_order=False))
    exact = [(c.topic, m.log_time, m.sequence, m.data) for _, c, m in found if "type" in c.metadata]
    assert len(exact) < len(found)  # the others are for display
    assert [(r.topic, r.stamp_ns, r.sequence, r.data) for r in read_log(path).records()] == exact


def test_a_file_that_was_cut_off_anywhere_is_read_up_to_the_cut(tmp_path: Path, header: LogHeader) -> None:
    whole = tmp_path / "whole"
    with McapRecorder(whole, header, flush_every_s=0.2) as recorder:
        record_trial(recorder, 2.0)
    content = whole.read_bytes()
    texts = [r.data for r in read_log(whole).records()]
    head = bisect_left(range(len(content)), True, key=lambda size: _opens(tmp_path, content[:size]))
    counts = []
    for size in np.linspace(head, len(content) - 1, 40).astype(int):
        (tmp_path / "cut").write_bytes(content[:size])
        log = read_log(tmp_path / "cut")
        got = [r.data for r in log.records()]
        assert not log.complete
        assert got == texts[: len(got)]
        counts.append(len(got))
    assert counts == sorted(counts)
    assert counts[0] == 0
    assert counts[-1] == len(texts)


def _opens(folder: Path, content: bytes) -> bool:
    (folder / "cut").write_bytes(content)
    try:
        read_log(folder / "cut")
    except LogError:
        return False
    return True


def test_damage_is_not_mistaken_for_an_early_end(tmp_path: Path, header: LogHeader) -> None:
    path = tmp_path / "t.mcap"
    with McapRecorder(path, header) as recorder:
        record_trial(recorder, 1.0)
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 0xFF
    path.write_bytes(content)
    with pytest.raises(LogError, match="damaged: the checksum of a part of it is not that of the bytes"):
        list(read_log(path).records())


@pytest.mark.parametrize(("opcode", "other"), [(1, 5), (11, 6)])
def test_a_record_that_says_to_be_another_one_is_damage(
    tmp_path: Path, header: LogHeader, opcode: int, other: int
) -> None:
    """Its bytes are read as lengths, which may be negative or larger than the memory."""
    path = tmp_path / "t.mcap"
    with McapRecorder(path, header) as recorder:
        record_trial(recorder, 1.0)
    content = bytearray(path.read_bytes())
    begin = MAGIC_SIZE
    while content[begin] != opcode:
        begin += 9 + int.from_bytes(content[begin + 1 : begin + 9], "little")
    content[begin] = other
    path.write_bytes(content)
    with pytest.raises(LogError, match=r"t\.mcap"):
        list(read_log(path).records())


def test_an_error_names_the_file_that_is_no_log(tmp_path: Path) -> None:
    with pytest.raises(LogError, match=r"nothing\.mcap"):
        read_log(tmp_path / "nothing.mcap")
    (tmp_path / "text.mcap").write_text("hello")
    with pytest.raises(LogError, match=r"text\.mcap: not an MCAP file"):
        read_log(tmp_path / "text.mcap")
    from mcap.writer import Writer

    with (tmp_path / "other.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start()
        writer.finish()
    with pytest.raises(LogError, match=r"other\.mcap: this file has no header"):
        read_log(tmp_path / "other.mcap")


def test_parametric_measurements_keep_their_missing_edges(tmp_path: Path, header: LogHeader) -> None:
    message = PoseMeasurement(Exposure("a/onboard", 3, 7), SE2(-1.0, 0.1, 3.0), np.eye(3), (None, -0.3))
    with McapRecorder(tmp_path / "t.mcap", header) as recorder:
        recorder.write(topics.sensor("a", message), 47, message)
    (record,) = read_log(tmp_path / "t.mcap").records("/sensors/*")
    assert (record.topic, record.stamp_ns) == ("/sensors/a/pose", 47)
    assert record.message.edge_bearings == (None, -0.3)


@pytest.mark.parametrize(
    ("kind", "text"),
    [
        (StartPoses, b'{"poses": true}'),
        (GlobalPose, b'{"name": "a", "stamp_ns": 0, "X_WB": {"x": 0, "y": 0, "yaw": 0}, "covariance": 1.0}'),
    ],
)
def test_a_message_whose_values_have_other_types_is_named(kind: type, text: bytes) -> None:
    record = LogRecord(Path("t.mcap"), "/truth/start", 0, 3, text, format_named(log_name(kind)))
    with pytest.raises(LogError, match=rf"^t\.mcap: message 3 on /truth/start is not a {kind.__name__}: "):
        _ = record.message


def test_what_another_version_knows_and_a_damaged_frame_are_told_with_the_file(
    tmp_path: Path, header: LogHeader, monkeypatch: pytest.MonkeyPatch
) -> None:
    with McapRecorder(tmp_path / "t.mcap", header) as recorder:
        exposure = Exposure("a/onboard", 0, 0)
        recorder.write(topics.exposure("a/onboard"), 0, exposure)
        recorder.window(exposure, Window(0, 0, 2, 2), np.ones((2, 2), dtype=np.uint8))
    log = read_log(tmp_path / "t.mcap")
    (window,) = log.records("/camera/*/window")
    with pytest.raises(
        LogError, match=r"t\.mcap: message \d+ on /camera/a/onboard/window: .* not a PNG file"
    ):
        _ = replace(window, frame=LoggedFrame(b"no picture")).message
    monkeypatch.setattr("msrr_bullet.log.formats._BY_NAME", {})
    with pytest.raises(
        LogError, match=r"t\.mcap: /camera/a/onboard/window: unknown message type 'CameraWindow'"
    ):
        list(log.records("/camera/*/window"))
