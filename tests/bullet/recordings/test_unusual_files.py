"""Files that other programs write, and that are rare: they are read as the usual ones are, or refused."""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
from mcap.reader import NonSeekingReader, make_reader
from mcap.writer import Writer

from msrr_bullet.recordings.images import pixels_of
from msrr_bullet.recordings.mcap_messages import DAMAGE
from msrr_bullet.recordings.run import Options, perceive
from msrr_bullet.recordings.wheels import JOINT_STATE, WheelReader
from msrr_scenes.geometry.urdf_file import WheelJoint
from tests.bullet.recordings.conftest import Trial
from tests.bullet.recordings.mcap_files import png, write_foxglove, write_ros2

ALONE = Options(odometry="none")


def _written_anew(
    usual: Path,
    path: Path,
    *,
    by_topic: bool = False,
    change: Callable[[str, bytes], bytes] = lambda topic, data: data,
    later_ns: int = 0,
    **options: Any,
) -> None:
    """Write the messages of a file in JSON into another one, which the writer makes with some options."""
    with usual.open("rb") as file:
        told = list(make_reader(file).iter_messages())
    if by_topic:
        told.sort(key=lambda entry: entry[1].topic)
    with path.open("wb") as out:
        writer = Writer(out, **options)
        writer.start()
        channels: dict[str, int] = {}
        for schema, channel, message in told:
            assert schema is not None
            if channel.topic not in channels:
                number = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.topic] = writer.register_channel(channel.topic, "json", number)
            data, time = change(channel.topic, message.data), later_ns + message.log_time
            writer.add_message(channels[channel.topic], log_time=time, data=data, publish_time=time)
        writer.finish()


@pytest.mark.parametrize("odd", ["no JSON", "a stamp 3 s early", "a stamp 3 s late"])
@pytest.mark.parametrize("at", [0, 3])
def test_one_bad_message_is_one_lost_frame(trial: Trial, tmp_path: Path, odd: str, at: int) -> None:
    """All behind it was lost, and where it was the first the file was refused."""
    path, good = tmp_path / "odd.mcap", write_foxglove(tmp_path / "good.mcap", trial.frames()[:8], [], False)
    count = itertools.count()

    def change(topic: str, data: bytes) -> bytes:
        if topic != "/camera":
            return data
        is_odd = next(count) == at
        if is_odd and odd == "no JSON":
            return b"{"
        return _restamped(data, 10 + is_odd * (3 if "late" in odd else -3))

    _written_anew(good, path, change=change, later_ns=10**10)
    messages: list[str] = []
    result = perceive(path, trial.target, ALONE, report=messages.append)
    assert (result.frames, result.unusable, result.cut_off) == (8, 1, False)
    assert len(messages) == 1
    assert ("damaged: JSONDecodeError" if odd == "no JSON" else "its stamps are 3.0 s") in messages[0]


def _restamped(data: bytes, seconds: int) -> bytes:
    text = json.loads(data)
    text["timestamp"]["sec"] += seconds
    return json.dumps(text).encode()


def test_the_last_frame_before_the_damage_counts(trial: Trial, tmp_path: Path) -> None:
    path = tmp_path / "cut.mcap"
    whole = write_ros2(path, trial.frames(), [], raw=True).read_bytes()
    for share in (0.4, 0.55, 0.7):
        path.write_bytes(whole[: round(len(whole) * share)])
        images = 0
        with path.open("rb") as file, suppress(*DAMAGE):
            for _, channel, _ in NonSeekingReader(file).iter_messages(log_time_order=False):
                images += channel.topic == "/camera/image"
        result = perceive(path, trial.target, ALONE, report=lambda text: None)
        assert result.cut_off
        assert result.frames == images > 0


@pytest.mark.parametrize(
    "options",
    [
        {"repeat_channels": False},
        {"repeat_schemas": False},
        {"use_chunking": False},
        {"use_summary_offsets": False},
    ],
    ids=str,
)
def test_parts_of_a_file_that_may_be_missing_are_not_missed(
    trial: Trial, tmp_path: Path, options: dict[str, Any]
) -> None:
    """A file without repeated channels seemed to hold nothing."""
    path = tmp_path / "odd.mcap"
    usual = write_foxglove(tmp_path / "usual.mcap", trial.frames()[:3], [], False)
    _written_anew(usual, path, **options)
    a, b = (perceive(each, trial.target, ALONE) for each in (usual, path))
    assert (a.frames, a.used, a.last_pose) == (b.frames, b.used, b.last_pose)
    assert a.used == 3


@pytest.mark.parametrize("step", [0.05, 1.0])
def test_joint_states_that_wrap_at_pi_are_those_that_do_not(step: float) -> None:
    joints = WheelJoint("l", 1), WheelJoint("r", -1)
    plain, wrapping = (WheelReader(0.03, 0.14, joints) for _ in range(2))
    rng, angles = np.random.default_rng(0), np.zeros(2)
    for _ in range(400):
        angles += step * rng.uniform([0.5, -1.0], [1.0, 0.2])
        wrapped = [math.remainder(float(angle), 2.0 * math.pi) for angle in angles]
        told, seen = (
            reader.angles(JOINT_STATE, SimpleNamespace(name=["l", "r"], position=position))
            for reader, position in ((plain, angles.tolist()), (wrapping, wrapped))
        )
        assert seen == pytest.approx(told, abs=1e-9)
    assert abs(angles).min() > 8.0


def test_slow_encoders_do_not_seem_to_wrap() -> None:
    """Nearly a turn from one reading to the next is no wrap, where angles do not jump by a turn."""
    reader = WheelReader(0.033, 0.14, (WheelJoint("l", 1), WheelJoint("r", 1)))
    for k in range(6):
        position = [-2.4 + 4.85 * k] * 2
        state = SimpleNamespace(name=["l", "r"], position=position)
        assert reader.angles(JOINT_STATE, state) == pytest.approx(position)


def test_a_file_without_an_index_is_read_in_the_order_of_its_times(trial: Trial, tmp_path: Path) -> None:
    """Topic after topic, the wheels of all frames came behind the last one."""
    path, usual = tmp_path / "odd.mcap", tmp_path / "usual.mcap"
    write_foxglove(usual, trial.frames()[:8], trial.wheels()[:60], protobuf=False)
    _written_anew(usual, path, by_topic=True, use_chunking=False)
    a, b = (perceive(each, trial.target) for each in (usual, path))
    assert (a.used, a.last_pose) == (b.used, b.last_pose)


def test_a_compressed_mosaic_is_read_as_a_raw_one() -> None:
    """The transport of ROS 2 compresses it as if it was a grey picture."""
    rng = np.random.default_rng(0)
    mosaic = cv2.GaussianBlur(rng.integers(0, 255, (48, 64), dtype=np.uint8), (0, 0), 2.0)
    height, width = mosaic.shape
    raw = SimpleNamespace(
        encoding="bayer_rggb8", width=width, height=height, step=width, data=mosaic.tobytes()
    )
    for told in ("bayer_rggb8; png compressed ", "bayer_rggb8;png compressed"):
        packed = SimpleNamespace(format=told, data=png(mosaic))
        np.testing.assert_array_equal(pixels_of(packed, "x"), pixels_of(raw, "x"))
    grey = SimpleNamespace(format="mono8; png compressed ", data=png(mosaic))
    np.testing.assert_array_equal(pixels_of(grey, "x"), mosaic)
