"""Replays of missions: every robot and the base station again, and every difference found."""

from __future__ import annotations

import os
import subprocess
import sys
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from msrr_bullet.log import Event, Log, LogHeader, TruePose, read_log
from msrr_bullet.log.mcap_recorder import McapRecorder
from msrr_bullet.log.records import RadioReceipt
from msrr_bullet.replay.isolation import replay_isolated
from msrr_bullet.replay.log_replay import replay
from msrr_bullet.trial.result import TrialResult
from msrr_bullet.trial.trial import Trial
from msrr_control.coordination.coordinator import Coordinator
from msrr_scenes.errors import ProgramFailedError
from msrr_scenes.loading.load import load_scene
from msrr_scenes.messages import Action, Detections, GlobalPose, WheelOdometry
from msrr_scenes.messages.coordination import Authority, MissionStatus, UnitReport
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.scene import Scene

#: Contact and pixels, up to where all units drive.
WITH_IMAGES = {
    "plant": "bullet",
    "perception": "images",
    "time_limit_s": "4",
}

#: Neither contact nor pixels, up to where units dock.
SHORT = {"time_limit_s": "8"}


def record(scene: Scene, folder: Path) -> TrialResult:
    """Run a mission and write its log."""
    with McapRecorder(folder / "trial.mcap", LogHeader.of(scene, 1, {})) as recorder:
        return Trial(scene, 1, recorder=recorder).run()


def copied(log: Log, path: Path, edit: Callable[[int, Any], Any], end_s: float = 1.5) -> Path:
    """Copy the first seconds of a log.

    ``edit`` gets the number of each message in its class, and returns None to leave it out.
    """
    seen: Counter[type] = Counter()
    with McapRecorder(path, log.header) as recorder:
        for record in log.records(end_ns=round(1e9 * end_s)):
            if record.topic == "/frames":
                continue  # the recorder adds these itself
            message = edit(seen[record.kind], record.message)
            seen[record.kind] += 1
            if message is not None:
                recorder.write(record.topic, record.stamp_ns, message)
    return path


def test_all_robots_and_the_base_station_are_identical(line_run: Path, line_log: Log) -> None:
    report = replay(line_run)
    assert report.mismatches == ()
    assert report.identical
    assert report.complete
    kinds = Counter(record.kind for record in line_log.records())
    assert (report.commands, report.statuses) == (kinds[Action], kinds[MissionStatus])
    assert (report.authorities, report.reports) == (kinds[Authority], kinds[UnitReport])
    assert report.sensor_messages >= kinds[GlobalPose] + kinds[WheelOdometry] > 1000
    assert report.steps == 2
    received = {topic: 0 for topic in ("authority", "report")}
    for record in line_log.records("/radio/*/*_received"):
        received[record.topic.split("/")[3].removesuffix("_received")] += 1
    assert (
        0.6 * report.authorities < received["authority"] < 0.95 * report.authorities
    )  # the radio loses some
    assert 0.6 * report.reports < received["report"] < 0.95 * report.reports


@pytest.fixture(scope="module")
def pixel_run(line_of_three: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Run folder with the log of the first seconds of a mission by pixels."""
    folder = tmp_path_factory.mktemp("pixels")
    record(load_scene(line_of_three, WITH_IMAGES), folder)
    return folder


@pytest.mark.nightly
def test_a_mission_by_pixels_is_identical(pixel_run: Path, tmp_path: Path) -> None:
    report = replay_isolated(pixel_run)
    assert report.mismatches == ()
    assert report.identical
    assert report.windows > 50
    assert report.detections > 30
    assert any(a.twist.v > 0.1 for _, a in read_log(pixel_run).messages(Action))

    def blind(_: int, m: Any) -> Any:
        return Detections(m.exposure, (), m.windows) if isinstance(m, Detections) else m

    report = replay(copied(read_log(pixel_run), tmp_path / "blind.mcap", blind, 2.5))
    assert report.mismatches[0].what == "detections"


@pytest.mark.parametrize(
    ("kind", "changed", "reported"),
    [
        (Authority, lambda m: replace(m, limit=float(np.nextafter(m.limit, 9.0))), "authority"),
        (UnitReport, lambda m: replace(m, progress=float(np.nextafter(m.progress, 9.0))), "report"),
        (MissionStatus, lambda m: replace(m, reason="other"), "status"),
        (RadioReceipt, lambda m: replace(m, number=-1), "log"),
        (Action, lambda m: replace(m, reason="other"), "command"),
        (Authority, lambda m: None, "authority"),
    ],
    ids=["authority", "report", "status", "receipt", "command", "missing authority"],
)
def test_one_changed_message_is_found(
    line_log: Log, tmp_path: Path, kind: type, changed: Callable[[Any], Any], reported: str
) -> None:
    def edit(number: int, message: Any) -> Any:
        return changed(message) if isinstance(message, kind) and number == 10 else message

    report = replay(copied(line_log, tmp_path / "changed.mcap", edit))
    assert report.mismatches[0].what == reported
    assert not report.identical


@pytest.mark.parametrize("kind", [RadioReceipt, GlobalPose, WheelOdometry])
def test_what_was_heard_and_seen_matters(line_log: Log, tmp_path: Path, kind: type) -> None:
    """Without the messages of one kind from some time on the decisions differ."""

    def edit(number: int, message: Any) -> Any:
        return None if isinstance(message, kind) and number >= 40 else message

    assert not replay(copied(line_log, tmp_path / "deaf.mcap", edit, 2.5)).identical


def test_truth_does_not_matter(line_log: Log, tmp_path: Path) -> None:
    def edit(_: int, m: Any) -> Any:
        return TruePose(m.name, m.stamp_ns, m.X_WB.inverse()) if isinstance(m, TruePose) else m

    assert replay(copied(line_log, tmp_path / "truth.mcap", edit, 2.5)).identical


def test_a_base_station_whose_program_fails_fails_again(
    line_of_three: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    step = Coordinator.step

    def failing(self: Coordinator, now_ns: int) -> list[Authority]:
        if now_ns > 500_000_000:
            raise ProgramFailedError("the coordinator is at its wits' end")
        return step(self, now_ns)

    scene = load_scene(line_of_three)
    with monkeypatch.context() as patched:
        patched.setattr(Coordinator, "step", failing)
        assert record(scene, tmp_path).outcome is Outcome.PROGRAM_FAILED
        assert any("wits' end" in event.text for _, event in read_log(tmp_path).messages(Event))
        assert replay(tmp_path).identical
    (difference,) = replay(tmp_path).mismatches
    assert (difference.what, difference.replayed) == ("event", None)
    with monkeypatch.context() as patched:
        patched.setattr(Coordinator, "step", lambda self, ns: failing(self, ns + 300_000_000))
        assert replay(tmp_path).mismatches[-1].what == "event"


@pytest.mark.nightly
def test_another_process_writes_the_same_logs(line_of_three: Path, pixel_run: Path, tmp_path: Path) -> None:
    """Whatever the seed of Python's hashes, on which the order in sets of strings depends."""
    code = f"""
import sys
from pathlib import Path
from msrr_bullet.log import LogHeader
from msrr_bullet.log.mcap_recorder import McapRecorder
from msrr_bullet.trial.trial import Trial
from msrr_scenes.loading.load import load_scene

for name, overrides in {{"mission": {SHORT}, "images": {WITH_IMAGES}}}.items():
    scene = load_scene(Path(sys.argv[1]), overrides)
    with McapRecorder(Path(sys.argv[2]) / f"{{name}}.mcap", LogHeader.of(scene, 1, {{}})) as recorder:
        Trial(scene, 1, recorder=recorder).run()
"""
    seed = "1" if os.environ.get("PYTHONHASHSEED") != "1" else "2"
    done = subprocess.run(
        [sys.executable, "-c", code, str(line_of_three), str(tmp_path)],
        env={**os.environ, "PYTHONHASHSEED": seed},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    record(load_scene(line_of_three, SHORT), tmp_path)
    assert (tmp_path / "mission.mcap").read_bytes() == (tmp_path / "trial.mcap").read_bytes()
    assert (tmp_path / "images.mcap").read_bytes() == (pixel_run / "trial.mcap").read_bytes()
