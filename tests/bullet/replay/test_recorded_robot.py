"""Recordings of real trials: equal logs in two processes, and identical replays without the simulator."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from msrr_bullet.cli import app
from msrr_bullet.log import CameraWindow, Log, LogHeader, TruePose, read_log
from msrr_bullet.log.codec import to_bytes
from msrr_bullet.log.formats import format_of
from msrr_bullet.log.mcap_recorder import McapRecorder
from msrr_bullet.replay.isolation import replay_isolated
from msrr_bullet.replay.log_replay import replay
from msrr_bullet.trial.result import TrialResult
from msrr_bullet.trial.trial import Trial
from msrr_bullet.trial.versions import trial_versions
from msrr_scenes.messages import Action, Detections, Phase, PoseEstimate, Twist
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.scene import Scene

SEED = 1

#: A start from which a unit has docked in half the time.
NEAR = {"units.a.pose.x_m": "-0.35"}


def record(scene: Scene, seed: int, path: Path) -> TrialResult:
    """Run a trial and write the log without the other files of a run folder."""
    with McapRecorder(path, LogHeader.of(scene, seed, {})) as recorder:
        return Trial(scene, seed, recorder=recorder).run()


@pytest.fixture(scope="module")
def run(shipped: Callable[..., Scene], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One docking by rendered images, from near the port to the pull test."""
    out = tmp_path_factory.mktemp("docking")
    result = record(shipped("close_range", NEAR), SEED, out / "trial.mcap")
    assert result.outcome is Outcome.DOCKED
    (out / "result.json").write_text(result.to_json())
    return out


@pytest.fixture(scope="module")
def log(run: Path) -> Log:
    return read_log(run)


def test_the_log_holds_the_whole_trial(log: Log) -> None:
    topics = {record.topic for record in log.records()}
    assert topics >= {
        "/plan/step",
        "/events",
        "/frames",
        "/truth/start",
        "/truth/clearance",
        "/truth/a/pose",
        "/truth/b/pose",
        "/sensors/a/odometry",
        "/sensors/a/seat_switches",
        "/sensors/a/lock",
        "/camera/a/onboard/exposure",
        "/camera/a/onboard/window",
        "/perception/a/detections",
        "/perception/a/estimate",
        "/perception/a/los",
        "/control/a/action",
        "/control/a/belief",
    }
    phases = [action.phase for _, action in log.messages(Action)]
    assert phases[-1] is Phase.DONE
    assert len(list(log.messages(CameraWindow))) >= len(list(log.messages(Detections))) > 50
    stamps = [record.stamp_ns for record in log.records()]
    assert stamps == sorted(stamps)
    assert (log.complete, log.header.seed) == (True, SEED)
    # At the end the estimate is close to the true pose.
    *_, (_, belief) = log.messages(PoseEstimate)
    poses = {m.name: m.X_WB for _, m in log.messages(TruePose)}
    X_WD = poses["b"] @ log.header.scene.geometry("b").dock_frame("rear")
    error = (X_WD @ belief.X_DU).inverse() @ poses["a"]
    assert np.hypot(error.x, error.y) < 0.005


@pytest.mark.nightly
def test_a_replay_without_the_simulator_is_identical(run: Path, log: Log) -> None:
    report = replay_isolated(run)
    assert report.mismatches == ()
    assert report.identical
    assert report.complete
    assert report.commands == len(list(log.messages(Action)))
    assert report.windows == len(list(log.messages(CameraWindow)))
    assert report.detections == len(list(log.messages(Detections)))


@pytest.mark.nightly
def test_another_process_writes_the_same_log(run: Path, log: Log, tmp_path: Path) -> None:
    code = (
        "import sys; from pathlib import Path\n"
        "from msrr_bullet.log import LogHeader\n"
        "from msrr_bullet.log.mcap_recorder import McapRecorder\n"
        "from msrr_bullet.trial.trial import Trial\n"
        "from msrr_scenes.loading.load import load_scene\n"
        f"scene = load_scene('close_range', {{'as_built': 'perfect', **{NEAR}}})\n"
        f"header = LogHeader.of(scene, {SEED}, {{}})\n"
        "with McapRecorder(Path(sys.argv[1]) / 'trial.mcap', header) as recorder:\n"
        f"    result = Trial(scene, {SEED}, recorder=recorder).run()\n"
        "(Path(sys.argv[1]) / 'result.json').write_text(result.to_json())\n"
    )
    done = subprocess.run([sys.executable, "-c", code, str(tmp_path)], capture_output=True, check=False)
    assert done.returncode == 0, done.stderr.decode()
    first = [(r.topic, r.stamp_ns, r.sequence, r.data) for r in log.records()]
    second = [(r.topic, r.stamp_ns, r.sequence, r.data) for r in read_log(tmp_path).records()]
    assert first == second
    assert (tmp_path / "trial.mcap").read_bytes() == (run / "trial.mcap").read_bytes()
    assert (tmp_path / "result.json").read_text() == (run / "result.json").read_text()


def rewritten(
    log: Log,
    path: Path,
    change: type,
    edit: object,
    header: LogHeader | None = None,
    end_ns: int | None = None,
) -> Path:
    """Copy a log, with every message of one class passed through ``edit``."""
    with McapRecorder(path, header or log.header) as recorder:
        for record in log.records(end_ns=end_ns):
            if record.topic == "/frames":
                continue  # the recorder adds these itself
            message = record.message
            recorder.write(record.topic, record.stamp_ns, edit(message) if record.kind is change else message)
    return path


def test_copying_a_log_changes_nothing(log: Log, tmp_path: Path) -> None:
    copy = read_log(rewritten(log, tmp_path / "copy.mcap", Action, lambda m: m))
    assert [r.data for r in copy.records()] == [r.data for r in log.records()]
    assert copy.path.read_bytes() == log.path.read_bytes()


def test_the_robot_depends_on_the_pixels_of_the_log(log: Log, tmp_path: Path) -> None:
    """With black images the robot detects no tag, so that the replay differs."""

    def dark(m: CameraWindow) -> CameraWindow:
        return CameraWindow(m.exposure, m.window, np.zeros_like(m.pixels))

    report = replay(rewritten(log, tmp_path / "dark.mcap", CameraWindow, dark, end_ns=1_000_000_000))
    assert report.mismatches[0].what in ("window", "detections")


def test_the_robot_does_not_depend_on_the_truth_of_the_log(log: Log, tmp_path: Path) -> None:
    def elsewhere(m: TruePose) -> TruePose:
        return TruePose(m.name, m.stamp_ns, m.X_WB.inverse())

    assert replay(rewritten(log, tmp_path / "truth.mcap", TruePose, elsewhere)).identical


def test_a_replay_that_differs_names_the_versions_and_the_processor_that_do(
    shipped: Callable[..., Scene],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Another processor rounds otherwise. What is equal is not named."""
    quick = {"perception": "parametric", "plant": "unicycle", "time_limit_s": "0.5"}
    record(shipped("close_range", quick), 2, tmp_path / "trial.mcap")
    log, here = read_log(tmp_path), trial_versions()
    header = replace(log.header, versions={**here, "processor": "z80", "retired": "1.0"})

    def rounded(m: Action) -> Action:
        return replace(m, twist=Twist(m.twist.v + 1e-15, m.twist.w))

    other = rewritten(log, tmp_path / "other.mcap", Action, rounded, header)
    monkeypatch.setattr("msrr_bullet.replay.isolation.replay_isolated", replay)  # not in a process of its own
    assert app.run(["replay", str(other)]) == 1
    assert capsys.readouterr().out.splitlines()[-1] == (
        f"{other}: written with processor z80, retired 1.0; here with processor {here['processor']}, "
        "retired none, where robots may round or decide otherwise"
    )


@pytest.mark.parametrize(
    "overrides",
    [
        {"perception": "parametric", "plant": "unicycle"},
        {"cameras.onboard.dropout": "0.3", "cameras.onboard.latency_ms": "120", "time_limit_s": "1.5"},
        {"control.delay_compensation": "false", "link.loss": "0.1", "time_limit_s": "1.0"},
        {"cameras.onboard.readout": "frames", "time_limit_s": "0.3"},
    ],
    ids=["unicycle", "dropped frames", "lossy link", "whole frames"],
)
def test_other_kinds_of_trial_replay_identically(
    overrides: dict[str, str], shipped: Callable[..., Scene], tmp_path: Path
) -> None:
    # One sample per pixel, from near the port, for speed.
    quick = {"units.a.pose.x_m": "-0.25"}
    scene = shipped("close_range", {**overrides, **quick})
    record(scene, 2, tmp_path / "trial.mcap")
    report = replay(tmp_path)
    assert report.mismatches == ()
    assert report.identical


def test_recording_changes_nothing_in_a_trial_without_pixels_which_replays_identically(
    shipped: Callable[..., Scene], tmp_path: Path
) -> None:
    quick = shipped("close_range", {"perception": "parametric", "units.a.pose.x_m": "-0.25"})
    assert record(quick, 4, tmp_path / "trial.mcap") == Trial(quick, 4).run()
    report = replay(tmp_path)
    assert report.mismatches == ()
    assert report.identical


def test_every_message_of_a_trial_is_encoded_again_to_the_same_bytes(log: Log) -> None:
    for record in log.records():
        assert to_bytes(format_of(record.message).encode(record.message)) == record.data


def test_a_log_of_an_earlier_version_can_be_replayed() -> None:
    """The first 0.4 s of a trial, written by version 0.1.0."""
    report = replay(Path(__file__).parent / "data" / "close_range_0_1_0.mcap")
    assert report.identical
    assert report.windows > 0


def test_the_replay_of_an_earlier_version_shows_how_the_overhead_estimates_have_changed() -> None:
    """The first 0.4 s of a trial without pixels, by version 0.1.0: covariances differ, poses by little."""
    report = replay(Path(__file__).parent / "data" / "two_units_0_1_0.mcap")
    assert report.complete
    assert report.commands > 10
    estimates = [m for m in report.mismatches if m.what == "situation"]
    assert len(estimates) >= 5
    for m in estimates:
        before, now = (json.loads(text or "") for text in (m.logged, m.replayed))
        for body in ("own", "target"):
            for axis in ("x", "y", "yaw"):
                assert now[body]["X_WB"][axis] == pytest.approx(before[body]["X_WB"][axis], abs=2e-4)
