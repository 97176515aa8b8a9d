"""What cannot be read is answered by one message each, and what can be read is."""

from __future__ import annotations

import base64
import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from mcap.writer import Writer

from msrr_bullet.cli.app import run
from msrr_bullet.cli.exit_codes import BAD_INPUT
from msrr_bullet.log import read_log
from msrr_bullet.log.records import Event, TruePose
from msrr_bullet.recordings.recording import RecordingError
from msrr_bullet.recordings.run import Options, perceive
from msrr_bullet.replay.comparison import ReplayError
from msrr_bullet.replay.log_replay import replay
from msrr_bullet.run_folder import RUN_FILES
from msrr_perception.estimation.corner_filter import CornerEkf
from msrr_perception.photographs.picture_files import PictureError
from msrr_scenes.errors import MsrrError, SceneError
from msrr_scenes.messages import Detections, PoseEstimate
from msrr_scenes.specs.scene import Scene
from tests.bullet.recordings.conftest import Trial, run_trial_quietly
from tests.bullet.recordings.mcap_files import png, write_foxglove, write_ros2

#: Definition of a message that contains itself.
ITSELF = b"sensor_msgs/Image inner\n" + b"=" * 80 + b"\nMSG: sensor_msgs/Image\nsensor_msgs/Image inner\n"

#: EXIF block of a JPEG that says: turn by 90 degrees (orientation 6).
EXIF_TURNED = (
    b"\xff\xe1\x00\x22Exif\x00\x00II*\x00\x08\x00\x00\x00\x01\x00"
    b"\x12\x01\x03\x00\x01\x00\x00\x00\x06\x00\x00\x00\x00\x00\x00\x00"
)


@pytest.fixture(scope="module")
def pictures(trial: Trial, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two good pictures, one each in colour, of 16 bits and turned, and four that nobody can use."""
    folder = tmp_path_factory.mktemp("pictures")
    grey = [pixels for _, _, pixels in trial.frames()[:5]]
    for i in (0, 1):
        (folder / f"{i}.png").write_bytes(png(grey[i]))
    (folder / "2.png").write_bytes(png(cv2.cvtColor(grey[2], cv2.COLOR_GRAY2BGR)))
    (folder / "3.png").write_bytes(png(grey[3].astype(np.uint16) * 257))
    jpeg = cv2.imencode(".jpg", grey[4], [cv2.IMWRITE_JPEG_QUALITY, 95])[1].tobytes()
    (folder / "4.jpg").write_bytes(jpeg[:2] + EXIF_TURNED + jpeg[2:])
    (folder / "5.png").write_bytes(b"")
    (folder / "6.png").write_bytes(png(grey[0])[:1000])
    (folder / "7.pgm").write_bytes(b"P5 30000 30000 255\n" + bytes(100))
    (folder / "8.png").write_bytes(png(grey[0][:, :320]))
    return folder


def _arguments(pictures: Path, trial: Trial, out: Path) -> list[str]:
    return ["perceive", str(pictures), "--target", str(trial.target), "--rate", "24", "--out", str(out)]


def test_good_pictures_are_used_and_others_named(
    trial: Trial, pictures: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert run(_arguments(pictures, trial, out)) == 2
    printed = capsys.readouterr()
    messages = printed.err.strip().splitlines()
    assert [line.split("/")[-1].split(":")[0] for line in messages] == ["5.png", "6.png", "7.pgm", "8.png"]
    assert "320 x 480 px, and the calibration is of pictures of 640 x 480 px" in messages[-1]
    result = json.loads((out / "result.json").read_text())
    assert (result["frames"], result["unusable"], result["used"]) == (9, 4, 5)
    page = (out / "replay.html").read_text()
    assert "its belief" in page
    assert "docking unit, truth" not in page
    (camera,) = json.loads(re.search(r'id="data"[^>]*>(.*?)</script>', page, re.S)[1])["replay"]["stills"]
    assert camera["name"] == "robot/onboard"
    assert len(camera["images"]) >= 1
    assert cv2.imread(str(out / "picture.png")) is not None
    log = read_log(out)
    assert log.header.recording is not None
    with pytest.raises(ReplayError, match="the log is of a recording"):
        replay(out)
    assert len(list(log.messages(Event))) == 4
    assert not list(log.messages(TruePose))  # nobody knows the truth, and nothing claims it
    estimates = [estimate for _, estimate in log.messages(PoseEstimate)]
    assert len(estimates) == result["estimates"] >= 5
    unseen_s = 1e-9 * (estimates[-1].stamp_ns - estimates[-1].last_seen_ns)
    assert result["last_unseen_s"] == pytest.approx(unseen_s, abs=1e-9)
    assert f"the last, {unseen_s:.2f} s after the target was seen: x " in printed.out


def test_many_pictures_of_another_size_are_not_named_one_by_one(
    trial: Trial, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "small"
    folder.mkdir()
    for i in range(13):
        (folder / f"{i:02d}.png").write_bytes(png(np.zeros((48, 64), np.uint8)))
    (folder / "13.png").write_bytes(png(np.zeros((480, 640), np.uint8)))
    assert run(_arguments(folder, trial, tmp_path / "out")) == 2
    printed = capsys.readouterr()
    messages = printed.err.strip().splitlines()
    size = "64 x 48 px, and the calibration is of pictures of 640 x 480 px"
    named = [f"msrr: {folder / f'{i:02d}.png'}: {size}" for i in (*range(10), 12)]
    assert messages == [*named[:10], "msrr: 2 more messages; the log has all of them as events", named[10]]
    assert len(list(read_log(tmp_path / "out").messages(Event))) == 13


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("small.png", png(np.zeros((48, 64), np.uint8)), "64 x 48 px, and the calibration is of pictures of"),
        ("notes.txt", b"no picture", "not a picture that OpenCV can read"),
    ],
)
def test_a_recording_without_a_usable_picture_leaves_the_run_that_is_there(
    name: str, content: bytes, says: str, trial: Trial, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A mistyped path replaced the run by an empty one."""
    (tmp_path / name).write_bytes(content)
    out = tmp_path / "out"
    out.mkdir()
    (out / "trial.mcap").write_bytes(b"of an earlier run")
    assert run(_arguments(tmp_path / name, trial, out)) == 2
    told = f"msrr: no picture can be used; the first one: {tmp_path / name}: {says}"
    assert capsys.readouterr().err.startswith(told)
    assert [file.read_bytes() for file in out.iterdir()] == [b"of an earlier run"]


@pytest.mark.nightly
def test_the_command_runs_without_the_simulator(trial: Trial, pictures: Path, tmp_path: Path) -> None:
    """The whole command, in a process that cannot import PyBullet; by day imports alone are tried so."""
    code = "import sys; sys.modules['pybullet'] = None\nfrom msrr_bullet.cli.app import main; main()"
    done = subprocess.run(
        [sys.executable, "-c", code, *_arguments(pictures, trial, tmp_path / "out")],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)},
    )
    assert done.returncode == 2, done.stderr
    assert len(done.stderr.strip().splitlines()) == 4
    assert (tmp_path / "out" / "picture.png").is_file()


def test_messages_that_are_no_images_are_named_each(trial: Trial, tmp_path: Path) -> None:
    good = base64.b64encode(png(trial.frames()[0][2])).decode()
    raw = {"encoding": "mono8", "width": 640, "height": 480, "step": 640}
    bodies = [
        {"data": good, "format": "png"},
        {"data": "no base 64"},
        {"data": 5},
        {"format": "png"},
        {"data": good[:2000]},
        {"data": good, **raw},
        {"data": good, **raw, "encoding": "yuv444"},
        {"data": good, **raw, "step": "wide"},
    ]
    path = tmp_path / "odd.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("foxglove.CompressedImage", "jsonschema", b"{}")
        channel = writer.register_channel("/camera", "json", schema)
        for k, body in enumerate(bodies):
            time = (k + 1) * 40_000_000
            data = json.dumps({"timestamp": {"sec": 0, "nsec": time}, **body}).encode()
            writer.add_message(channel, log_time=time, publish_time=time, data=data)
        writer.finish()
    messages: list[str] = []
    result = perceive(path, trial.target, report=messages.append)
    assert (result.frames, result.unusable, result.used) == (8, 7, 1)
    for k, message in enumerate(messages, start=1):
        assert message.startswith(f"{path}: /camera at {0.04 * k:.3f} s: ")


@pytest.mark.parametrize(
    ("kind", "definition", "encoding", "body"),
    [
        ("ros2msg", b"foo bar baz $$", "cdr", bytes(40)),
        ("ros2msg", b"uint8 LEVEL=300", "cdr", bytes(40)),
        ("ros2msg", ITSELF, "cdr", bytes(40)),
        ("jsonschema", b"{}", "json", b"[" * 100_000),
    ],
    ids=["no definition", "too large a constant", "a message in itself", "nested too deep"],
)
def test_a_definition_that_is_none_and_what_is_nested_too_deep_are_damage(
    trial: Trial, tmp_path: Path, kind: str, definition: bytes, encoding: str, body: bytes
) -> None:
    path = tmp_path / "odd.mcap"
    name = "sensor_msgs/msg/Image" if kind == "ros2msg" else "foxglove.CompressedImage"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        channel = writer.register_channel("/camera", encoding, writer.register_schema(name, kind, definition))
        writer.add_message(channel, log_time=1, publish_time=1, data=body)
        writer.finish()
    with pytest.raises(RecordingError, match=r"behind message 0|the first one: .*: damaged: "):
        perceive(path, trial.target)


def _first_frames(trial: Trial, path: Path) -> Path:
    return write_foxglove(path, trial.frames()[:2], trial.wheels()[:20], protobuf=False)


def test_a_file_that_was_cut_off_is_read_as_far_as_it_goes(trial: Trial, tmp_path: Path) -> None:
    path = tmp_path / "cut.mcap"
    whole = write_ros2(path, trial.frames(), trial.wheels(), raw=True).read_bytes()
    path.write_bytes(whole[: len(whole) * 2 // 3])  # no end, no index
    messages: list[str] = []
    result = perceive(path, trial.target, Options(odometry="none"), report=messages.append)
    assert result.cut_off
    assert 0 < result.frames < len(trial.frames())
    assert len(messages) == 1
    assert "cut.mcap: damaged" in messages[0]


def test_a_log_of_a_trial_that_is_damaged_is_read_as_far_as_it_goes(
    trial: Trial, shipped: Callable[..., Scene], tmp_path: Path
) -> None:
    """The log is long enough to be in several parts with checksums of their own."""
    run_trial_quietly(
        shipped("close_range", {"cameras.onboard.readout": "frames", "time_limit_s": "3"}), tmp_path
    )
    path, messages = tmp_path / "cut.mcap", list[str]()
    whole = perceive(tmp_path / "trial.mcap", trial.target, report=messages.append)
    assert (whole.cut_off, messages) == (False, [])
    content = (tmp_path / "trial.mcap").read_bytes()
    for damaged in (content[: len(content) // 2], _torn(content)):
        path.write_bytes(damaged)
        messages.clear()
        result = perceive(path, trial.target, report=messages.append)
        assert result.cut_off
        assert 0 < result.frames < whole.frames
        assert len(messages) == 1
        assert "cut.mcap" in messages[0]


def test_a_log_that_ends_before_its_first_frame_says_so(trial: Trial, tmp_path: Path) -> None:
    """It was told to be run again with the settings that it had."""
    path = tmp_path / "cut.mcap"
    path.write_bytes((trial.folder / "trial.mcap").read_bytes()[:300_000])
    with pytest.raises(RecordingError, match=r"cut.mcap: the log ends early, before the first frame"):
        perceive(path, trial.target)


class FailsLate(CornerEkf):
    """An estimator that fails at its fourth picture."""

    pictures = 0

    def add_detections(self, detections: Detections) -> None:
        self.pictures += 1
        if self.pictures == 4:
            raise ValueError("too many pictures")
        super().add_detections(detections)


def test_what_comes_before_a_class_of_one_s_own_fails_is_kept(trial: Trial, tmp_path: Path) -> None:
    target, messages = trial.target.with_name("own.yaml"), list[str]()
    own = {"control": {"estimator": f"{__name__}:FailsLate"}}
    target.write_text(yaml.safe_dump(yaml.safe_load(trial.target.read_text()) | own))
    result = perceive(trial.folder, target, out=tmp_path / "run", report=messages.append)
    assert (result.cut_off, len(messages)) == (True, 1)
    assert 3 <= result.frames < len(trial.frames())
    assert "FailsLate" in messages[0]
    assert "add_detections raised ValueError: too many pictures" in messages[0]
    assert {path.name for path in (tmp_path / "run").iterdir()} == set(RUN_FILES)
    events = [event.text for _, event in read_log(tmp_path / "run").messages(Event)]
    assert messages[0] in events


def _torn(whole: bytes) -> bytes:
    """Return a file with a byte changed in its last third, as a bad sector does."""
    place = len(whole) * 4 // 5
    return whole[:place] + bytes([whole[place] ^ 0xFF]) + whole[place + 1 :]


@pytest.mark.parametrize(("ending", "code"), [(".avi", "MJPG"), (".mkv", "mp4v")])
def test_a_film_that_was_cut_off_is_read_as_far_as_it_goes(
    trial: Trial, tmp_path: Path, ending: str, code: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path, frames = tmp_path / f"film{ending}", [pixels for _, _, pixels in trial.frames()]
    film = cv2.VideoWriter(
        str(path), cv2.CAP_FFMPEG, cv2.VideoWriter.fourcc(*code), 25.0, frames[0].shape[::-1]
    )
    for pixels in frames * 5:
        film.write(cv2.cvtColor(pixels, cv2.COLOR_GRAY2BGR))
    film.release()
    messages: list[str] = []
    whole = perceive(path, trial.target, report=messages.append)
    assert (whole.cut_off, whole.frames, messages) == (False, 5 * len(frames), [])
    path.write_bytes(path.read_bytes()[: path.stat().st_size * 11 // 20])
    part = perceive(path, trial.target, report=messages.append)
    assert part.cut_off
    assert 0 < part.frames < whole.frames
    assert run(["detect", str(path)]) == BAD_INPUT
    assert "the film ends after" in capsys.readouterr().err
    # OpenCV announces the last frame of some films, and cannot decode the piece of it that is there.
    assert part.frames <= int(re.search(r"ends after (\d+) of", messages[0])[1]) <= part.frames + 1


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (lambda path: path.write_bytes(b"no file of this kind"), "cannot be read as MCAP"),
        (lambda path: path.write_bytes(b""), "the file is empty"),
        (lambda path: path.unlink(), "no such file"),
    ],
)
def test_what_is_no_recording_is_refused(
    trial: Trial, tmp_path: Path, change: Callable[[Path], object], text: str
) -> None:
    path = _first_frames(trial, tmp_path / "film.mcap")
    change(path)
    with pytest.raises(MsrrError, match=rf"film\.mcap: .*{text}"):
        perceive(path, trial.target)


def test_a_bag_is_read_without_its_metadata(trial: Trial, tmp_path: Path) -> None:
    """``ros2 bag record`` writes them last, so that a killed one has none."""
    _first_frames(trial, tmp_path / "bag_0.mcap")
    assert (
        perceive(tmp_path, trial.target).frames == perceive(tmp_path / "bag_0.mcap", trial.target).frames > 0
    )
    cv2.imwrite(str(tmp_path / "picture.png"), trial.frames()[0][2])  # then it is a folder of pictures
    assert perceive(tmp_path, trial.target).frames == 1


def test_bags_of_other_kinds_are_told_what_to_do(trial: Trial, tmp_path: Path) -> None:
    (tmp_path / "metadata.yaml").write_text("rosbag2_bagfile_information:\n")
    for number in range(3):
        if number != 1:
            with pytest.raises(RecordingError, match=f"this one has {number}, and `ros2 bag convert` makes"):
                perceive(tmp_path, trial.target)
        _first_frames(trial, tmp_path / f"bag_{number}.mcap")
    (tmp_path / "bag.db3").write_bytes(b"SQLite format 3")
    with pytest.raises(RecordingError, match="`ros2 bag convert` makes"):
        perceive(tmp_path / "bag.db3", trial.target)
    for name in ("bag_0.db3", "bag_0.mcap.zstd"):  # without metadata, as of one that was killed
        folder = tmp_path / name.partition(".")[2]
        folder.mkdir()
        (folder / name).write_bytes(b"SQLite format 3")
        for path in (folder, folder / name):
            with pytest.raises(RecordingError, match="this one has 0, and `ros2 bag convert` makes"):
                perceive(path, trial.target)


def test_topics_that_are_not_there_are_refused_with_those_that_are(trial: Trial, tmp_path: Path) -> None:
    path = _first_frames(trial, tmp_path / "film.mcap")
    with pytest.raises(RecordingError, match=r"--topic /head: no such topic .*there are /camera$"):
        perceive(path, trial.target, Options(topic="/head"))
    with pytest.raises(RecordingError, match=r"--topic is one of /camera/a/onboard/exposure"):
        perceive(trial.folder, trial.target, Options(topic="/head"))
    with pytest.raises(RecordingError, match=r"--odometry nnoe: the log of a trial has the encoders"):
        perceive(trial.folder, trial.target, Options(odometry="nnoe"))
    empty = write_foxglove(tmp_path / "empty.mcap", [], trial.wheels()[:2], protobuf=False)
    with pytest.raises(RecordingError, match=r"empty\.mcap: no message on /camera"):
        perceive(empty, trial.target)


def test_a_camera_that_nobody_tells_of_is_refused(trial: Trial, tmp_path: Path) -> None:
    target = tmp_path / "blind.yaml"
    target.write_text("unit: {number: 1, port: rear}")
    film = write_foxglove(tmp_path / "film.mcap", trial.frames()[:1], trial.wheels(), protobuf=True)
    with pytest.raises(SceneError, match=r"blind\.yaml: nothing tells of the camera; give --calibration"):
        perceive(film, target)


def _fuzz(trial: Trial, folder: Path, count: int) -> tuple[int, int]:
    """Perceive damaged pictures and MCAP files; return how many pictures were used and refused."""
    rng = np.random.default_rng(5)
    frame = trial.frames()[0][2]
    whole = {
        ".png": png(frame),
        ".jpg": cv2.imencode(".jpg", frame)[1].tobytes(),
        ".tiff": cv2.imencode(".tiff", frame)[1].tobytes(),
        ".mcap": _first_frames(trial, folder / "whole.mcap").read_bytes(),
    }
    used = refused = misnamed = 0
    for i in range(count):
        kind = (*whole,)[i % len(whole)]
        data = bytearray(whole[kind])
        if rng.integers(2):
            data = data[: rng.integers(len(data))]
        for place in rng.integers(0, max(len(data), 1), 1 + rng.integers(20)):
            data[place : place + 1] = bytes([rng.integers(256)])
        file = folder / f"damaged{kind}"
        file.write_bytes(data)
        messages: list[str] = []
        try:
            result = perceive(file, trial.target, report=messages.append)
        except (PictureError, RecordingError) as error:
            refused += 1
            misnamed += str(file) not in str(error)
            continue
        assert len(messages) == result.unusable + result.cut_off
        assert all(str(file) in message for message in messages)
        refused += bool(messages)
        used += result.used > 0
    assert not misnamed
    return used, refused


def test_damaged_files_are_used_or_refused(trial: Trial, tmp_path: Path) -> None:
    used, refused = _fuzz(trial, tmp_path, 12)
    assert used > 0
    assert refused > 0


@pytest.mark.nightly
def test_two_thousand_damaged_files_are_used_or_refused(trial: Trial, tmp_path: Path) -> None:
    used, refused = _fuzz(trial, tmp_path, 2000)
    assert used > 100
    assert refused > 100


@pytest.mark.nightly
def test_photographs_of_a_walk_are_read_to_the_end(photographs: Path, tmp_path: Path) -> None:
    """They show tags on walls, which are mapped first. A camera in a hand is no robot on a floor, so that the
    filter need not agree with all of them; it has to use some, and to fail on none."""
    pictures, camera = photographs / "mapping", tmp_path / "camera.yaml"
    camera.write_text(
        "{image_width: 816, image_height: 612,"
        " distortion_coefficients: {rows: 1, cols: 5, data: [0, 0, 0, 0, 0]},"
        " camera_matrix: {rows: 3, cols: 3, data: [765.0, 0, 393.72, 0, 764.18, 304.66, 0, 0, 1]}}"
    )
    told = [
        "--calibration",
        str(camera),
        "--tag-size",
        "0.05",
        "--refine-lens",
        "--out",
        str(tmp_path / "map"),
    ]
    assert run(["map", str(pictures), *told]) == 0
    target = tmp_path / "walls.yaml"
    target.write_text(
        "marker: {map: map/map.yaml, dock: {z_m: -0.5}}\n"
        "robot: {camera: {z_m: 0.5}, speed_mps: 1.5, turn_rate_radps: 3}\n"
        "camera: {rate_hz: 1, calibration: map/camera.yaml}\n"
        "control: {estimator: {params: {tilt_sigma_deg: 10}}}\n"
    )
    assert run(["perceive", str(pictures), "--target", str(target), "--out", str(tmp_path / "out")]) == 0
    result = json.loads((tmp_path / "out" / "result.json").read_text())
    assert (result["frames"], result["unusable"], result["with_target"]) == (36, 0, 36)
    assert result["used"] > 5
