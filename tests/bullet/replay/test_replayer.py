"""A replay gives the robot the inputs of the log, and finds every difference in the outputs."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader

from msrr_bullet.log import Log, LogError, LogHeader, LogRecord, read_log, topics, unpacked_log
from msrr_bullet.log.mcap_recorder import McapRecorder
from msrr_bullet.log.records import CameraWindow, StepStart
from msrr_bullet.replay.comparison import ReplayError, ReplayReport
from msrr_bullet.replay.log_replay import replay
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.messages import (
    Action,
    AssemblyPath,
    Belief,
    Detections,
    Exposure,
    Fetch,
    PoseEstimate,
    Twist,
    WheelOdometry,
)
from tests.bullet.replay.conftest import HashRobot, pair, record


def test_the_recorded_robot_is_identical(recorded_run: Path) -> None:
    report = replay(recorded_run, HashRobot)
    assert report.mismatches == ()
    assert report.identical
    assert (report.complete, report.judged) == (True, True)
    assert (report.steps, report.commands, report.sensor_messages) == (2, 100, 200)
    assert report.estimates == 2 * (47 + 47 + 50)
    assert report.windows == sum(1 for r in read_log(recorded_run).records("/camera/*/window"))
    assert report.detections > 20
    assert ReplayReport.model_validate_json(report.model_dump_json()) == report


def differing(robot: Any, what: str) -> Any:
    """Return a robot class that differs from ``robot`` in one respect from step 10 on."""

    class Differing(robot):
        def step(self, now_ns: int) -> Action:
            action = super().step(now_ns)
            if self._steps < 10:
                return action
            if what == "command":
                return Action(
                    now_ns, action.phase, 1, Twist(float(np.nextafter(action.twist.v, 2.0)), action.twist.w)
                )
            if what == "estimate" and (pose := self.estimates.pose):
                covariance = pose.covariance.copy()
                covariance[2, 0] = -0.0
                pose = PoseEstimate(now_ns, pose.X_DU, covariance, now_ns)
                self.estimates = self.estimates._replace(pose=pose)
            if what == "los":
                self.estimates = self.estimates._replace(los=None)
            if what == "belief":
                self.estimates = self.estimates._replace(belief=Belief(reason="other"))
            return action

        def expose(self, exposure: Exposure, fetch: Fetch) -> Detections | None:
            if self._steps < 10:
                return super().expose(exposure, fetch)
            if what == "window":
                return super().expose(exposure, lambda w: fetch(Window(w.x + 1, w.y, w.width, w.height)))
            if what == "too few":
                return None
            detections = super().expose(exposure, fetch)
            if what == "too many":
                fetch(Window(0, 0, 5, 5))
            if what == "detections" and detections is not None:
                return Detections(exposure, (), detections.windows)
            return detections

    return Differing


@pytest.mark.parametrize(
    ("what", "reported"),
    [
        ("command", "command"),
        ("estimate", "estimate"),
        ("los", "los"),
        ("belief", "belief"),
        ("window", "window"),
        ("too few", "window"),
        ("too many", "window"),
        ("detections", "detections"),
    ],
)
def test_every_kind_of_difference_is_found_where_it_begins(
    recorded_run: Path, what: str, reported: str
) -> None:
    report = replay(recorded_run, differing(HashRobot, what))
    assert not report.identical
    assert report.mismatches[0].what == reported
    assert 0.17 < report.mismatches[0].time_s < 0.33
    assert len(report.mismatches) <= 20


def test_a_robot_with_an_unrecorded_input_differs(tmp_path: Path) -> None:
    secret = iter(np.random.default_rng(0).normal(size=1_000))

    class Informed(HashRobot):
        def step(self, now_ns: int) -> Action:
            self._state.update(f"{next(secret)}".encode())
            return super().step(now_ns)

    record(tmp_path, factory=Informed)
    assert not replay(tmp_path, HashRobot).identical


def test_a_path_that_is_hidden_for_a_while_is_logged_again_and_replayed(tmp_path: Path) -> None:
    """As a long-distance phase of a user's own may hide it."""
    path = AssemblyPath(0, 1, "arc", ((0.0, 0.0), (1.0, 0.0)), "because")

    class Hiding(HashRobot):
        def step(self, now_ns: int) -> Action:
            action = super().step(now_ns)
            hides = 10 < self._steps <= 20
            self.estimates = self.estimates._replace(path=None if hides else path)
            return action

    record(tmp_path, factory=Hiding)
    assert len(list(read_log(tmp_path).messages(AssemblyPath))) == 2 * 2, "in each of two steps"
    assert replay(tmp_path, Hiding).identical


def test_the_log_of_a_killed_trial_is_compared_to_its_end(tmp_path: Path, recorded_run: Path) -> None:
    record(tmp_path, finish=False)
    report = replay(tmp_path, HashRobot)
    assert not report.complete
    assert report.identical
    content = (recorded_run / "trial.mcap").read_bytes()
    with (recorded_run / "trial.mcap").open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    first = summary.chunk_indexes[0]  # in front of it lies the head, whose size is no matter of the trial
    compared = set()
    begun = first.chunk_start_offset + first.chunk_length
    for size in range(begun, len(content), (len(content) - begun) // 7):
        (tmp_path / "trial.mcap").write_bytes(content[:size])
        report = replay(tmp_path, HashRobot)
        assert report.identical
        compared.add(report.commands)
    assert len(compared) > 2


@pytest.mark.parametrize("kind", [Exposure, CameraWindow, Detections, Action, PoseEstimate])
def test_a_trial_that_was_ended_early_is_compared_to_its_end(
    tmp_path: Path, recorded_run: Path, kind: type
) -> None:
    """Ctrl-C ends a trial behind any message, and finishes the log nevertheless, but without a verdict."""
    log, seen = read_log(recorded_run), 0
    with McapRecorder(tmp_path / "trial.mcap", log.header) as recorder:
        for record in log.records("/[!f]*"):  # the recorder adds the frames itself
            recorder.write(record.topic, record.stamp_ns, record.message)
            seen += record.kind is kind
            if seen == 20:
                break
    report = replay(tmp_path, HashRobot)
    assert (report.complete, report.judged) == (True, False)
    assert report.mismatches == ()
    assert report.identical


def test_a_log_without_a_decision_is_refused(tmp_path: Path) -> None:
    with McapRecorder(tmp_path / "trial.mcap", LogHeader.of(pair, 0, {})):
        pass
    with pytest.raises(ReplayError, match="nothing to replay"):
        replay(tmp_path, HashRobot)
    with McapRecorder(tmp_path / "trial.mcap", LogHeader.of(pair, 0, {})) as recorder:
        recorder.write(topics.STEPS, 0, StepStart(0, 0, "a"))  # and ended early
    with pytest.raises(ReplayError, match="nothing to replay, the log holds no decision"):
        replay(tmp_path, HashRobot)
    with McapRecorder(tmp_path / "trial.mcap", LogHeader.of(pair, 0, {})) as recorder:
        recorder.write(topics.sensor("a", m := WheelOdometry("a", 0, 0.0, 0.0)), 0, m)
    with pytest.raises(ReplayError, match="before the first step"):
        replay(tmp_path, HashRobot)


def test_messages_that_are_missing_are_named(recorded_run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    read = Log.records

    def without_two(log: Log) -> Iterator[LogRecord]:
        return (record for record in read(log) if record.sequence not in (41, 42))

    monkeypatch.setattr(Log, "records", without_two)
    report = replay(recorded_run, HashRobot)
    assert [m.logged for m in report.mismatches] == ["messages 41 to 42 are missing from the log"]


def test_a_missing_log_is_refused(tmp_path: Path) -> None:
    with pytest.raises(LogError, match="cannot read the log"):
        replay(tmp_path / "gone", HashRobot)


def test_a_spoilt_urdf_of_a_log_is_told_by_the_name_of_the_log(tmp_path: Path) -> None:
    """It was told by the path of a temporary file, which was gone by then."""
    header = LogHeader.of(pair, 0, {})
    cut = {name: content.replace(b"</robot>", b"") for name, content in header.files.items()}
    path = tmp_path / "trial.mcap"
    with McapRecorder(path, dataclasses.replace(header, files=cut)):
        pass
    told = "urdf/0/unit.urdf: not well-formed XML"
    of_units = rf"pair: units\.\w\.urdf and \d more units: {told}"
    with pytest.raises(LogError, match=rf"^{re.escape(str(path))}: {of_units}"):
        replay(path, HashRobot)
    with (
        pytest.raises(LogError, match=rf"^{re.escape(str(path))}: {told}"),
        unpacked_log(path) as log,
    ):
        log.header.scene.geometry("a")
