"""Perception on a film of a trial gives the estimates of the trial, whatever the film is made of."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
import yaml

from msrr_bullet.cli.app import run
from msrr_bullet.figures.frames.frame_files import FrameAnnotator
from msrr_bullet.log import read_log
from msrr_bullet.recordings.perceiver import PerceivedInstant
from msrr_bullet.recordings.recording import RecordingError
from msrr_bullet.recordings.result import LearnedError, RecordingResult, sigma_of
from msrr_bullet.recordings.run import Options, perceive
from msrr_bullet.recordings.wheels import ODOMETRY, WheelReader
from msrr_bullet.timeline.camera_views import docking_views
from msrr_scenes.errors import MsrrError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.unit_geometry import find_urdf
from msrr_scenes.messages import NS_PER_S, PoseEstimate, WheelOdometry
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.sensors import CalibrationSpec
from tests.bullet.recordings.conftest import Trial, run_trial_quietly, told
from tests.bullet.recordings.mcap_files import FOCAL, write_foxglove, write_ros2


def _estimates(path: Path, target: Path, options: Options | None = None) -> dict[int, PoseEstimate]:
    found: list[PerceivedInstant] = []
    result = perceive(path, target, options, observer=found.append)
    assert result.used == result.with_target == result.frames > 4
    return {i.stamp_ns: i.estimate for i in found if i.estimate is not None}


def _agree(trial: Trial, estimates: dict[int, PoseEstimate], shift_ns: int = 0) -> int:
    """Check that estimates are those of the trial to 1e-6; return how many were compared."""
    of_trial, compared = trial.estimates(), 0
    for stamp, estimate in estimates.items():
        right = of_trial.get(stamp - shift_ns)
        if right is None:
            continue
        a, b = estimate.X_DU, right.X_DU
        np.testing.assert_allclose([a.x, a.y, a.yaw], [b.x, b.y, b.yaw], atol=1e-6, rtol=0.0)
        np.testing.assert_allclose(estimate.covariance, right.covariance, atol=1e-9)
        assert estimate.last_seen_ns - shift_ns == right.last_seen_ns
        compared += 1
    return compared


def test_the_log_of_a_trial_gives_the_estimates_of_the_trial(trial: Trial) -> None:
    found = _estimates(trial.folder, trial.target)
    assert _agree(trial, found) == len(trial.estimates()) > 10


def test_the_log_of_a_trial_whose_camera_delivered_windows_is_refused(
    trial: Trial, tmp_path: Path, shipped: Callable[..., Scene], blind_run: Path
) -> None:
    """Its first picture is a whole frame all the same: the robot looks for the marker in it."""
    run_trial_quietly(shipped("close_range", {"time_limit_s": "0.3"}), tmp_path)
    with pytest.raises(RecordingError, match="readout=frames"):
        perceive(tmp_path, trial.target)
    with pytest.raises(RecordingError, match=r"no frames of an onboard camera.* perception: images and"):
        perceive(blind_run, trial.target)


@pytest.mark.filterwarnings("error")
def test_a_target_that_is_another_unit_is_told_by_the_tags(
    trial: Trial, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = yaml.safe_load(trial.target.read_text())
    other["unit"]["number"] += 1
    target = tmp_path / "other.yaml"
    target.write_text(yaml.safe_dump(other))
    assert run(["perceive", str(trial.folder), "--target", str(target), "--out", str(tmp_path / "out")]) == 0
    told = " ".join(capsys.readouterr().out.split())
    assert re.search(r"no estimate: the target has the tags 20, 21, .* and only 1\d, .* were found; ", told)


@pytest.fixture(scope="module")
def approach(tmp_path_factory: pytest.TempPathFactory, shipped: Callable[..., Scene]) -> Trial:
    """Record a docking of a robot that is as designed, and tell the tolerances of those built with care."""
    folder = tmp_path_factory.mktemp("approach")
    scene = shipped("close_range", {"cameras.onboard.readout": "frames", "cameras.onboard.rate_hz": "8"})
    run_trial_quietly(scene, folder)
    target = folder / "target.yaml"
    target.write_text(yaml.safe_dump(told(scene) | {"as_built": "careful"}))
    return Trial(folder, read_log(folder), target)


@pytest.mark.parametrize(
    ("change", "wrong", "error"),
    [
        ({}, None, 0.0),
        ({"camera": {"hfov_deg": 73}}, "onboard.focal_percent", -3.6),
        ({"robot": {"camera": {"z_m": 0.155, "pitch_deg": 2.0}}}, "onboard.pitch_deg", -2.0),
        ({"robot": {"camera": {"z_m": 0.165}}}, "onboard.z_m", -0.01),
    ],
)
def test_what_the_target_file_has_wrong_is_named(
    approach: Trial, tmp_path: Path, change: dict[str, dict[str, object]], wrong: str | None, error: float
) -> None:
    right = yaml.safe_load(approach.target.read_text())
    target = tmp_path / "target.yaml"
    target.write_text(yaml.safe_dump(right | {key: right.get(key, {}) | change[key] for key in change}))
    result = perceive(approach.folder, target)
    assert result.used == result.with_target > 40
    known = {e.quantity for e in result.calibration}
    assert {"drive.track_percent", "bracket.x_m", "tags.print_percent", "tags.yaw_deg"} < known
    assert [e.quantity for e in result.calibration if e.contradicts] == ([wrong] if wrong else [])
    if wrong is None:
        assert result.warnings() == ()
    else:
        (text,) = result.warnings()
        assert f"(true minus told value): {wrong} -" in text
        # That of the height is shared with the bracket's, from which no image tells it.
        assert abs(result.calibration[0].error / error - 1.0) < 0.35


@pytest.mark.parametrize(
    "misread", ["in degrees", pytest.param("backward", marks=pytest.mark.nightly), "left for right"]
)
def test_wheels_that_do_not_agree_with_the_images_are_told(
    approach: Trial, tmp_path: Path, misread: str
) -> None:
    """By wheels in degrees the unit is metres away, from where no state explains the tags."""
    wheels = []
    for arrival, at in approach.wheels():
        left, right = {
            "in degrees": (math.degrees(at.left), math.degrees(at.right)),
            "backward": (-at.left, -at.right),
            "left for right": (at.right, at.left),
        }[misread]
        wheels.append((arrival, replace(at, left=left, right=right)))
    film = tmp_path / "film.mcap"
    write_foxglove(film, approach.frames(), wheels, protobuf=True)
    result = perceive(film, approach.target)
    assert result.used < 0.95 * result.with_target
    assert re.search(r"^in \d+ frames tags .* the wheels of the recording, ", result.warnings()[0])
    assert perceive(film, approach.target, Options(odometry="none")).warnings() == ()


@pytest.mark.parametrize(
    ("quantity", "wheels"), [("drive.track_percent", True), ("onboard.pitch_deg", False)]
)
def test_a_wrong_drive_may_be_wheels_in_the_wrong_order(quantity: str, wheels: bool) -> None:
    """On a straight way such wheels agree with most frames: the filter finds a drive for them."""
    wrong = LearnedError(
        quantity=quantity, tag=None, tolerance=1.0, error=7.8, sigma=1.0, deviation=7.8, contradicts=True
    )
    for odometry in (True, False):
        given: dict[str, Any] = {"odometry": odometry, "with_target": 9, "used": 9, "calibration": (wrong,)}
        given["without_odometry"] = ()
        (text,) = RecordingResult.model_construct(**given).warnings()
        assert ("Wheels in the wrong order" in text) == (wheels and odometry)


def test_odometry_that_pauses_is_named(trial: Trial, tmp_path: Path) -> None:
    """The robot was taken to stand while there was none, and nothing was said: estimates were 20 cm off."""
    told = yaml.safe_load(trial.target.read_text()) | {"robot": {"wheel_joints": ["l", "r"]}}
    target = tmp_path / "target.yaml"
    target.write_text(yaml.safe_dump(told))
    pixels, end_s = trial.frames()[0][2], 6.9
    stamps = [round(0.3 * k * NS_PER_S) for k in range(24)]  # of a robot that stands
    frames = [(stamp, stamp, pixels) for stamp in stamps]
    wheels = [(t, WheelOdometry("a", t, 0.1, 0.1)) for t in range(0, stamps[-1], NS_PER_S // 50)]
    for begin_s, until_s, spans in (
        (9.0, 9.0, 0),
        (3.0, 4.0, 0),
        (0.0, 1.0, 0),
        (1.0, 3.0, 1),
        (0.0, 2.0, 1),
        (5.0, 99.0, 1),
    ):
        kept = [w for w in wheels if not begin_s <= 1e-9 * w[1].stamp_ns < until_s]
        result = perceive(write_ros2(tmp_path / "film.mcap", frames, kept), target)
        assert len(result.without_odometry) == spans, begin_s
        for start, end in result.without_odometry:
            assert start == pytest.approx(begin_s, abs=0.1)
            assert end == pytest.approx(min(until_s, end_s), abs=0.31)
            assert f"no odometry from {start:.1f} to {end:.1f} s" in result.warnings()[0]


@pytest.mark.parametrize("kind", ["json", "protobuf", "ros2", "ros2_raw", "ros2_bag", "ros2_reversed"])
def test_mcap_files_of_its_pictures_give_the_estimates_of_the_trial(
    trial: Trial, tmp_path: Path, kind: str
) -> None:
    frames, wheels, path = trial.frames()[:5], trial.wheels(), tmp_path / "film.mcap"
    target = trial.target
    if kind != "protobuf":  # the calibration is in the recording
        told = yaml.safe_load(target.read_text()) | {"robot": {}}
        del told["camera"]["hfov_deg"]
        told["robot"]["wheel_joints"] = [
            "l",
            "r",
        ]  # no joint states in "json": the odometry is read all the same
        if kind == "ros2_reversed":  # the joint of the right wheel turns backward, and so do its joint states
            drawn = find_urdf("unit.urdf").read_text()
            joint = '<origin xyz="0 -0.065 0.033"/><axis xyz="0 1 0"/>'
            assert joint in drawn
            (tmp_path / "reversed.urdf").write_text(drawn.replace(joint, joint.replace("0 1 0", "0 -1 0")))
            told["robot"]["urdf"] = "reversed.urdf"
            wheels = [(arrival, replace(reading, right=-reading.right)) for arrival, reading in wheels]
        target = tmp_path / "target.yaml"
        target.write_text(yaml.safe_dump(told))
    if kind.startswith("ros2"):  # with absolute times
        write_ros2(path, frames, wheels, raw=kind == "ros2_raw", start_ns=1_700_000_000_000_000_000)
        if kind == "ros2_bag":  # a folder
            (tmp_path / "metadata.yaml").write_text("rosbag2_bagfile_information:\n")
            path = tmp_path
    else:
        write_foxglove(path, frames, wheels, protobuf=kind == "protobuf")
    # A frame arrives at a tick of the physics, and not at every one the robot of the trial decides.
    first_ns = min(stamp for stamp in (*(f[0] for f in frames), *(r.stamp_ns for _, r in wheels)))
    assert _agree(trial, _estimates(path, target), -first_ns) >= 3


@pytest.mark.parametrize(
    ("joints", "moves", "told"),
    [
        (("wheel_l", "wheel_r"), True, r"tells of both wheel_l and wheel_r, but there are l, r; name two"),
        (("l", "wheel_r"), True, r"tells of both l and wheel_r, but there are l, r; name two"),
        (("l", "r"), False, r"/joint_states: it tells of no motion; .* --odometry none"),
    ],
)
def test_odometry_that_never_tells_of_the_wheels_is_not_taken_for_a_robot_that_stands(
    trial: Trial, tmp_path: Path, joints: tuple[str, str], moves: bool, told: str
) -> None:
    path, target = tmp_path / "drive.mcap", tmp_path / "target.yaml"
    nan = [(arrival, replace(reading, left=math.nan)) for arrival, reading in trial.wheels()]
    write_ros2(path, trial.frames()[:5], trial.wheels() if moves else nan)
    spec = yaml.safe_load(trial.target.read_text()) | {"robot": {"wheel_joints": list(joints)}}
    target.write_text(yaml.safe_dump(spec))
    with pytest.raises(RecordingError, match=told):
        perceive(path, target)


def test_joint_states_that_are_not_read_are_named(trial: Trial, tmp_path: Path) -> None:
    path = tmp_path / "drive.mcap"
    write_ros2(path, trial.frames()[:2], trial.wheels())
    (assumed, *_) = perceive(path, trial.target).assumptions
    assert assumed.startswith("no odometry")
    assert assumed.endswith(
        "the joint states on /joint_states are read if the target file has robot.wheel_joints"
    )


def test_a_lossless_film_without_odometry_agrees_within_its_covariance(trial: Trial, tmp_path: Path) -> None:
    """The robot is taken to move at random, and it moves by less than its largest speed."""
    frames, path = trial.frames()[:6], tmp_path / "film.mkv"
    height, width = frames[0][2].shape
    film = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"FFV1"), 25.0, (width, height))
    for _, _, pixels in frames:
        film.write(cv2.cvtColor(pixels, cv2.COLOR_GRAY2BGR))
    film.release()
    found: list[PerceivedInstant] = []
    told = yaml.safe_load(trial.target.read_text())
    del told["camera"]["hfov_deg"]
    target = tmp_path / "film.yaml"
    target.write_text(yaml.safe_dump(told))
    calibration = CalibrationSpec(fx_px=FOCAL, fy_px=FOCAL, cx_px=0.5 * (width - 1), cy_px=0.5 * (height - 1))
    result = perceive(path, target, Options(calibration), observer=found.append)
    assert (result.frames, result.used) == (len(frames), len(frames))
    assert "no odometry" in result.assumptions[0]
    assert "as_built: careful" in result.assumptions[1]
    target.write_text(yaml.safe_dump(told | {"as_built": "careful"}))
    assert len(perceive(path, target, Options(calibration)).assumptions) == 1
    by_exposure = {e.last_seen_ns: e for e in trial.estimates().values()}
    compared = 0
    for k, ((stamp, _, _), instant) in enumerate(zip(frames, found, strict=True)):
        assert instant.stamp_ns == pytest.approx(k / 25.0 * NS_PER_S, abs=NS_PER_S / 500)
        assert instant.estimate is not None
        right = by_exposure.get(stamp)
        if right is not None:
            a, b = instant.estimate.X_DU, right.X_DU
            off = np.array([a.x - b.x, a.y - b.y, a.yaw - b.yaw])
            # The estimate of the trial is of up to 0.1 s later, at 0.12 m/s and 0.5 rad/s at most.
            sigma = np.sqrt(np.diagonal(instant.estimate.covariance))
            assert (np.abs(off) < 4.0 * sigma + [0.012, 0.012, 0.05]).all()
            compared += 1
    assert compared >= 3


def test_wheels_follow_from_the_pose_of_an_odometry() -> None:
    """A pose by odometry becomes the angles of wheels that drive there: those of an arc come back.

    A quaternion counts whatever its length, but for that of no length, which nobody has set.
    """
    reader = WheelReader(radius=0.033, track=0.13)
    angles = None
    for k in range(21):
        yaw = 0.05 * k
        X = SE2.exp(0.02 * k, 0.0, yaw)
        for length in (0.0, 1.0 + 0.1 * k):
            w, z = length * math.cos(0.5 * yaw), length * math.sin(0.5 * yaw)
            q = SimpleNamespace(x=0.0, y=0.0, z=z, w=w)
            pose = SimpleNamespace(position=SimpleNamespace(x=X.x, y=X.y), orientation=q)
            angles = reader.angles(ODOMETRY, SimpleNamespace(pose=SimpleNamespace(pose=pose)))
            assert (angles is None) == (length == 0.0)
    assert angles == pytest.approx(((0.4 - 0.065) / 0.033, (0.4 + 0.065) / 0.033), abs=1e-9)


def test_a_run_is_not_put_among_the_pictures_of_a_recording(trial: Trial, tmp_path: Path) -> None:
    """The next command would have taken ``picture.png`` for one of them."""
    _, _, pixels = trial.frames()[0]
    assert cv2.imwrite(str(tmp_path / "0.png"), pixels)
    with pytest.raises(MsrrError, match="the recording is read from there; choose another --out"):
        perceive(tmp_path / "0.png", trial.target, out=tmp_path)


def test_a_run_is_not_put_beside_the_file_of_a_recording(trial: Trial, tmp_path: Path) -> None:
    """The folder would have been that of the run from then on, and no bag any more."""
    frames = trial.frames()[:2]
    path = write_ros2(tmp_path / "bag_0.mcap", frames, [])
    with pytest.raises(MsrrError, match="the recording is read from there; choose another --out"):
        perceive(path, trial.target, out=tmp_path)
    assert list(tmp_path.iterdir()) == [path]


def test_the_last_frame_of_a_recording_stays_until_the_next(trial: Trial, tmp_path: Path) -> None:
    """A film of a slow camera flickered between its frames and a drawing."""
    path = write_ros2(tmp_path / "film.mcap", trial.frames()[:2], [])
    perceive(path, trial.target, out=tmp_path / "run")
    log = read_log(tmp_path / "run")
    annotator, view = FrameAnnotator(log), next(iter(docking_views(log)))
    for apart_s, what in ((0.0, "frame 0"), (2.0, "frame 0")):
        now_ns = view.stamp_ns + round(apart_s * NS_PER_S)
        assert what in annotator.draw_latest(view.exposure.camera, view, now_ns).title[0]
    title = annotator.draw_latest(view.exposure.camera, None, 0).title
    assert "drawn from the estimate alone" in title[2]


def test_a_recording_is_not_replaced_by_what_is_made_of_it(trial: Trial) -> None:
    before = {f.name: f.stat().st_size for f in trial.folder.iterdir()}
    for path in (trial.folder, trial.folder / "trial.mcap"):
        with pytest.raises(MsrrError, match="the recording is read from there; choose another --out"):
            perceive(path, trial.target, out=trial.folder)
    assert {f.name: f.stat().st_size for f in trial.folder.iterdir()} == before


def test_a_detector_that_cannot_be_built_leaves_the_run_that_is_there(trial: Trial, tmp_path: Path) -> None:
    out, target = tmp_path / "out", tmp_path / "target.yaml"
    out.mkdir()
    (out / "trial.mcap").write_bytes(b"of an earlier run")
    spec = yaml.safe_load(trial.target.read_text())
    target.write_text(yaml.safe_dump({**spec, "control": {"detector": "pupill"}}))
    with pytest.raises(
        MsrrError, match=r"target\.yaml:\d+:3: control\.detector: unknown .*; did you mean 'pupil'"
    ):
        perceive(trial.folder, target, out=out)
    assert [file.read_bytes() for file in out.iterdir()] == [b"of an earlier run"]


def test_a_variance_that_is_negative_by_rounding_is_no_deviation() -> None:
    """The check of an estimator of a user's own lets it pass; its root was a traceback."""
    sigma = sigma_of(PoseEstimate(0, SE2(), np.diag([0.04, 0.01, -1e-19]), 0))
    assert (sigma.position_m, sigma.yaw_rad) == (pytest.approx(0.2), 0.0)
