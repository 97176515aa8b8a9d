"""Messages to bytes and back, bit for bit; files that survive their writer; same messages, same bytes."""

from __future__ import annotations

import dataclasses
import json
import math
import os
import signal
import subprocess
import sys
import types
import typing
from enum import Enum
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import msrr_scenes.messages as messages
from msrr_bullet.log import (
    CameraWindow,
    Event,
    FrameLink,
    FrameLinks,
    Level,
    LogError,
    LogHeader,
    McapRecorder,
    MemoryRecorder,
    StepStart,
    TruePose,
    read_log,
    topics,
)
from msrr_bullet.log.codec import codec, to_bytes
from msrr_bullet.log.formats import format_of, from_png, message_types, to_png
from msrr_bullet.log.frames import scene_frames
from msrr_scenes.errors import UnknownNameError
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.messages import (
    Action,
    Detections,
    Exposure,
    Phase,
    PoseEstimate,
    PoseMeasurement,
    TagDetection,
    Twist,
    WheelOdometry,
)
from msrr_scenes.specs.scene import Scene

TOPIC = "/perception/a/estimate"

FLOATS = st.floats(allow_nan=True, allow_infinity=True).map(lambda x: math.nan if math.isnan(x) else x)
METRES = st.floats(-1e3, 1e3)
SHAPES = {"corners": (4, 2), "covariance": (3, 3), "nearest": (2, 3)}


def strategy(kind: typing.Any, name: str = "") -> st.SearchStrategy[typing.Any]:
    """Any value of a message's field, from its type: a new message is tested without a new line here."""
    origin, args = typing.get_origin(kind), typing.get_args(kind)
    if kind is bool:
        return st.booleans()
    if kind is int:
        return st.integers(0, 2**62)
    if kind is float:
        return FLOATS
    if kind is str:
        return st.text(max_size=20)
    if kind is SE2:
        return st.builds(SE2, FLOATS, FLOATS, st.floats(-math.pi, math.pi))
    if kind is SE3:
        return st.builds(SE3.from_xyz_rpy, st.tuples(*[METRES] * 3), st.tuples(*[METRES] * 3))
    if kind is CameraWindow:
        return camera_windows()
    if origin is np.ndarray:
        return arrays(np.float64, SHAPES[name], elements=FLOATS)
    if origin is tuple and args[-1] is Ellipsis:
        return st.lists(strategy(args[0], name), max_size=3).map(tuple)
    if origin is tuple:
        return st.tuples(*(strategy(a, name) for a in args))
    if origin is dict:
        return st.dictionaries(st.text(max_size=5), strategy(args[1]), max_size=3)
    if origin in (typing.Union, types.UnionType):
        return st.one_of(*(st.none() if a is type(None) else strategy(a, name) for a in args))
    if isinstance(kind, type) and issubclass(kind, Enum):
        return st.sampled_from(kind)
    hints = typing.get_type_hints(kind)
    return st.builds(kind, **{f.name: strategy(hints[f.name], f.name) for f in dataclasses.fields(kind)})


@st.composite
def camera_windows(draw: st.DrawFn) -> CameraWindow:
    window = Window(
        draw(st.integers(-9, 700)),
        draw(st.integers(-9, 700)),
        draw(st.integers(1, 40)),
        draw(st.integers(1, 40)),
    )
    seed = draw(st.integers(0, 99))
    pixels = np.random.default_rng(seed).integers(0, 256, (window.height, window.width), dtype=np.uint8)
    return CameraWindow(draw(strategy(Exposure)), window, pixels)


def bits(value: typing.Any) -> typing.Any:
    """Return what identifies a value down to the bit."""
    if isinstance(value, np.ndarray):
        # The one NaN of the log stands for all of them.
        clean = np.where(np.isnan(value), np.nan, value) if value.dtype == np.float64 else value
        return (str(value.dtype), value.shape, clean.tobytes())
    if dataclasses.is_dataclass(value):
        return (type(value), *(bits(getattr(value, f.name)) for f in dataclasses.fields(value)))
    if isinstance(value, tuple):
        return tuple(bits(v) for v in value)
    if isinstance(value, dict):
        return tuple((k, bits(v)) for k, v in value.items())
    return (float, value.hex()) if isinstance(value, float) else (type(value), value)


@pytest.mark.parametrize("kind", message_types(), ids=lambda kind: kind.__name__)
@settings(max_examples=40, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(data=st.data())
def test_every_message_comes_back_bit_for_bit(kind: type, data: st.DataObject) -> None:
    message = data.draw(strategy(kind))
    form = format_of(message)
    text = to_bytes(form.encode(message, TOPIC))
    back = form.decode(json.loads(text))
    assert bits(back) == bits(message)
    assert to_bytes(form.encode(back, TOPIC)) == text
    json.loads(text, parse_constant=pytest.fail)  # strict JSON, readable by any viewer


def test_every_message_between_the_rooms_can_be_logged() -> None:
    alive = {m.__name__ for m in message_types()}
    between = {
        name
        for name, kind in vars(messages).items()
        if dataclasses.is_dataclass(kind) and "stamp_ns" in {f.name for f in dataclasses.fields(kind)}
    }
    assert between <= alive
    assert {kind.__name__ for kind in typing.get_args(messages.SensorMessage)} <= alive


def test_equal_bytes_mean_equal_bits() -> None:
    form = format_of(WheelOdometry("a", 0, 0.0, 0.0))
    texts = {
        to_bytes(form.encode(WheelOdometry("a", 0, x, 1.0), TOPIC))
        for x in (0.0, -0.0, 5e-324, 0.1, math.nextafter(0.1, 1.0), math.inf, -math.inf, math.nan)
    }
    assert len(texts) == 8


def test_numbers_of_numpy_are_taken_as_numbers() -> None:
    odd = WheelOdometry("a", np.int64(7), np.float64(0.1), np.float32(0.5))  # type: ignore[arg-type]
    form = format_of(odd)
    assert form.decode(json.loads(to_bytes(form.encode(odd, TOPIC)))) == WheelOdometry("a", 7, 0.1, 0.5)


def test_what_a_log_cannot_hold_is_refused() -> None:
    with pytest.raises(UnknownNameError, match="'str'"):
        MemoryRecorderLike().write("/x", 0, "words")
    with pytest.raises(LogError, match="float32"):
        codec(TagDetection).encode(TagDetection(1, np.zeros((4, 2), dtype=np.float32)))  # type: ignore[arg-type]
    with pytest.raises(LogError, match="not empty"):
        codec(TagDetection).encode(TagDetection(1, np.zeros((0, 2))))
    with pytest.raises(TypeError, match="no JSON form"):
        codec(complex)


class MemoryRecorderLike:
    def write(self, topic: str, stamp_ns: int, message: object) -> None:
        format_of(message)


@pytest.mark.parametrize("shape", [(1, 1), (480, 640), (7, 333)])
def test_png_is_lossless(shape: tuple[int, int]) -> None:
    pixels = np.random.default_rng(1).integers(0, 256, shape, dtype=np.uint8)
    assert np.array_equal(from_png(to_png(pixels)), pixels)
    with pytest.raises(LogError, match="PNG"):
        from_png(b"no image")


@pytest.fixture(scope="module")
def scene() -> Scene:
    return Scene.model_validate(
        {
            "name": "pair",
            "units": {"b": {"number": 1, "pose": {"x_m": 1.0, "yaw_deg": 0.1}}, "a": {"number": 0}},
            "plan": [{"unit": "a", "to": "b.rear"}],
            "limits": {"setting": "tight", "v_max_mps": 0.1 + 0.2},
        }
    )


@pytest.fixture(scope="module")
def header(scene: Scene) -> LogHeader:
    return LogHeader.of(scene, 17, {"python": "3.11", "numpy": "2"})


def fill(recorder: McapRecorder, seconds: float, seed: int = 0) -> None:
    """A made-up trial: 100 Hz odometry, 25 Hz windows, 50 Hz decisions, all topics of the same time mixed."""
    rng = np.random.default_rng(seed)
    buffer = np.empty((480, 640), dtype=np.uint8)
    for tick in range(round(seconds * 100)):
        now = tick * 10_000_000
        recorder.write("/sensors/a/odometry", now, WheelOdometry("a", now, *rng.normal(size=2)))
        if tick % 2 == 0:
            recorder.write(
                topics.action("a"),
                now,
                Action(now, Phase.DOCK, 1, Twist(*rng.normal(size=2)), reason="straight on"),
            )
            pose = PoseEstimate(now, SE2(*rng.normal(size=3)), rng.normal(size=(3, 3)), now)
            recorder.write(topics.estimate("a"), now, pose)
            recorder.write(topics.true_pose("a"), now, TruePose("a", now, SE2(*rng.normal(size=3))))
        if tick % 4 == 0:
            exposure = Exposure("a/onboard", tick // 4, now)
            recorder.write(topics.exposure("a/onboard"), now, exposure)
            window = Window(tick % 90, 5, 60, 40)
            view = buffer[5:45, window.x : window.x_end]  # not contiguous, and overwritten the next time
            view[...] = rng.integers(0, 256, view.shape, dtype=np.uint8)
            recorder.window(exposure, window, view)
            tag = TagDetection(11, rng.normal(size=(4, 2)), 50.0)
            recorder.write(topics.sensor("a", d := Detections(exposure, (tag,), (window,))), now, d)


def test_a_log_reads_back_in_its_order(tmp_path: Path, header: LogHeader) -> None:
    path = tmp_path / "trial.mcap"
    memory = MemoryRecorder()
    memory.write(topics.FRAMES, 0, scene_frames(header.scene))
    with McapRecorder(path, header) as recorder:
        fill(recorder, 2.5)
    fill(memory, 2.5)  # type: ignore[arg-type]
    log = read_log(tmp_path)
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
    assert list(log.topics()) == sorted({topic for topic, _, _ in memory.messages})


def test_the_head_gives_back_scene_seed_and_geometry(tmp_path: Path, scene: Scene, header: LogHeader) -> None:
    with McapRecorder(tmp_path / "t.mcap", header):
        pass
    read = read_log(tmp_path / "t.mcap").header
    assert (read.seed, read.versions) == (17, header.versions)
    assert read.scene == scene
    assert list(read.scene.units) == ["b", "a"]  # the order of the scene file
    unpacked = read.unpacked(tmp_path / "files").scene
    for unit in scene.units:
        there, here = unpacked.geometry(unit), scene.geometry(unit)
        assert there.urdf.is_relative_to(tmp_path)
        assert there.frames.keys() == here.frames.keys()
        assert all(bits(there.frames[k]) == bits(here.frames[k]) for k in here.frames)


def test_a_urdf_with_meshes_travels_with_them(tmp_path: Path, scene: Scene) -> None:
    home = tmp_path / "home" / "robots"
    home.mkdir(parents=True)
    (tmp_path / "home" / "nose.obj").write_text("v 0 0 0\nv 0.15 0 0\nv 0 0.01 0\nv 0 0 0.01\nf 1 2 3\n")
    text = scene.geometry("a").urdf.read_text()
    nose = (
        '<link name="nose"><collision><geometry><mesh filename="../nose.obj"/></geometry></collision></link>'
        '<joint name="nose" type="fixed"><parent link="axle"/><child link="nose"/></joint>'
    )
    (home / "own.urdf").write_text(text.replace("</robot>", f"{nose}</robot>"))
    units = {"a": scene.units["a"].model_copy(update={"urdf": "own.urdf"}), "b": scene.units["b"]}
    own = scene.model_copy(update={"units": units, "source": home / "scene.yaml"})
    with McapRecorder(tmp_path / "t.mcap", LogHeader.of(own, 0, {})):
        pass
    footprint = own.geometry("a").footprint
    for path in sorted((tmp_path / "home").rglob("*.*")):
        path.unlink()
    back = read_log(tmp_path / "t.mcap").header.unpacked(tmp_path / "files").scene
    assert np.array_equal(back.geometry("a").footprint, footprint)
    assert back.geometry("a").circumradius > 0.14


def test_a_log_that_names_a_file_outside_is_refused(tmp_path: Path, header: LogHeader) -> None:
    for name in ("../evil", "/tmp/evil", "a/../../evil"):
        bad = dataclasses.replace(header, files={name: b""})
        with pytest.raises(LogError, match="unsafe"):
            bad.unpacked(tmp_path / "files")


def test_the_same_messages_give_the_same_file(tmp_path: Path, header: LogHeader) -> None:
    for name in ("one", "two"):
        with McapRecorder(tmp_path / name, header) as recorder:
            fill(recorder, 3.0)
    assert (tmp_path / "one").read_bytes() == (tmp_path / "two").read_bytes()
    with McapRecorder(tmp_path / "other", header) as recorder:
        fill(recorder, 3.0, seed=1)
    assert (tmp_path / "one").read_bytes() != (tmp_path / "other").read_bytes()


def test_a_file_that_was_cut_off_anywhere_reads_up_to_there(tmp_path: Path, header: LogHeader) -> None:
    whole = tmp_path / "whole"
    with McapRecorder(whole, header, flush_every_s=0.2) as recorder:
        fill(recorder, 2.0)
    content = whole.read_bytes()
    texts = [r.data for r in read_log(whole).records()]
    head = next(i for i in range(0, len(content), 64) if _opens(tmp_path, content[:i]))
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


def test_a_killed_process_leaves_a_readable_log(tmp_path: Path) -> None:
    code = f"""
import os, signal, sys
sys.path.insert(0, {str(Path(__file__).parent)!r})
from pathlib import Path
import test_log
scene = test_log.Scene.model_validate({{"name": "x", "units": {{"a": {{"number": 0}}}},
    "plan": [{{"unit": "a", "to": "a.rear"}}]}})
recorder = test_log.McapRecorder(Path({str(tmp_path / "t.mcap")!r}), test_log.LogHeader.of(scene, 0, {{}}))
test_log.fill(recorder, 20.0)
[batch.result() for batch in recorder._waiting]
os.kill(os.getpid(), signal.SIGKILL)
"""
    done = subprocess.run([sys.executable, "-c", code], check=False, capture_output=True)
    assert done.returncode == -signal.SIGKILL, done.stderr.decode()
    log = read_log(tmp_path / "t.mcap")
    last = list(log.records())[-1]
    assert not log.complete
    assert 18.9e9 < last.stamp_ns < 19e9  # the last second is lost


def test_damage_is_not_taken_for_an_early_end(tmp_path: Path, header: LogHeader) -> None:
    path = tmp_path / "t.mcap"
    with McapRecorder(path, header) as recorder:
        fill(recorder, 1.0)
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 0xFF
    path.write_bytes(content)
    with pytest.raises(LogError, match="damaged"):
        list(read_log(path).records())


def test_what_is_not_a_log_is_refused_by_name(tmp_path: Path) -> None:
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
    with pytest.raises(LogError, match=r"other\.mcap: no head"):
        read_log(tmp_path / "other.mcap")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs the device /dev/full")
def test_a_full_disk_is_one_error_that_names_the_file(header: LogHeader) -> None:
    with pytest.raises(LogError, match=r"/dev/full: cannot write the log: No space left"):
        McapRecorder(Path("/dev/full"), header)


def test_a_disk_that_fills_up_is_told_while_recording_and_closing_still_works(
    tmp_path: Path, header: LogHeader
) -> None:
    recorder = McapRecorder(tmp_path / "t.mcap", header, flush_every_s=0.1)
    full = os.open("/dev/full", os.O_WRONLY)
    os.dup2(full, recorder._file.fileno())
    os.close(full)
    with pytest.raises(LogError, match=r"t\.mcap: cannot write the log: No space left"):
        fill(recorder, 60.0)
    with pytest.raises(LogError, match="No space left"):
        recorder.write(topics.EVENTS, 0, Event(0, "trial", "on"))
    recorder.close()
    assert recorder._file.closed


def test_a_log_in_a_folder_that_is_not_there_is_refused(tmp_path: Path, header: LogHeader) -> None:
    with pytest.raises(LogError, match=r"gone/t\.mcap: cannot write the log: No such file"):
        McapRecorder(tmp_path / "gone" / "t.mcap", header)


def test_a_closed_log_takes_nothing(tmp_path: Path, header: LogHeader) -> None:
    recorder = McapRecorder(tmp_path / "t.mcap", header)
    recorder.close()
    recorder.close()
    with pytest.raises(LogError, match="closed"):
        recorder.write(topics.EVENTS, 0, Event(0, "trial", "on"))


def test_foxglove_finds_what_it_knows(tmp_path: Path, header: LogHeader) -> None:
    with McapRecorder(tmp_path / "t.mcap", header) as recorder:
        fill(recorder, 0.1)
        recorder.write(topics.EVENTS, 5, Event(1_500_000_000, "trial", "contact", Level.WARNING))
        link = FrameLink("b", "a/target", SE3.from_xyz_rpy([0.1, 0.0, 0.0], [0.0, 0.0, math.pi]))
        recorder.write(topics.FRAMES, 5, FrameLinks(5, (link,)))
        recorder.write(topics.STEPS, 5, StepStart(5, 0, "a"))
    from mcap.reader import make_reader

    with (tmp_path / "t.mcap").open("rb") as file:
        reader = make_reader(file)
        seen = {c.topic: (s, json.loads(m.data)) for s, c, m in reader.iter_messages()}
        summary = reader.get_summary()
    assert summary is not None
    assert summary.statistics is not None
    assert summary.statistics.message_count == 10 + 3 * 5 + 3 * 3 + 5
    for topic, name in {
        "/truth/a/pose": "foxglove.FrameTransform",
        "/perception/a/estimate": "foxglove.PoseInFrame",
        "/camera/a/onboard/window": "foxglove.CompressedImage",
        "/events": "foxglove.Log",
        "/frames": "foxglove.FrameTransforms",
        "/plan/step": "msrr.StepStart",
    }.items():
        schema, value = seen[topic]
        assert (schema.name, schema.encoding) == (name, "jsonschema")
        properties = json.loads(schema.data)["properties"]
        assert set(value) == set(properties)
    assert seen["/events"][1]["timestamp"] == {"sec": 1, "nsec": 500_000_000}
    assert seen["/events"][1]["level"] == 3
    assert seen["/perception/a/estimate"][1]["frame_id"] == "a/target"
    assert seen["/frames"][1]["transforms"][0]["child_frame_id"] == "a/target"


def test_parametric_measurements_keep_their_missing_edges(tmp_path: Path, header: LogHeader) -> None:
    message = PoseMeasurement(Exposure("a/onboard", 3, 7), SE2(-1.0, 0.1, 3.0), np.eye(3), (None, -0.3))
    with McapRecorder(tmp_path / "t.mcap", header) as recorder:
        recorder.write(topics.sensor("a", message), 47, message)
    (record,) = read_log(tmp_path / "t.mcap").records("/sensors/*")
    assert (record.topic, record.stamp_ns) == ("/sensors/a/pose", 47)
    assert record.message.edge_bearings == (None, -0.3)
