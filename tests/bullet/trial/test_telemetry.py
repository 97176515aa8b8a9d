"""The reports of a running trial: progress, snapshots, truth and events, in agreement with each other."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from msrr_bullet.figures.frames.stills import live_stills
from msrr_bullet.log import ClearanceRecord, MemoryRecorder, StartPoses, TruePose
from msrr_bullet.log.header import LogHeader
from msrr_bullet.log.mcap_recorder import McapRecorder
from msrr_bullet.log.records import Event
from msrr_bullet.timeline.camera_views import CameraView
from msrr_bullet.timeline.series import TrialSeries
from msrr_bullet.timeline.snapshot import Snapshot
from msrr_bullet.trial.result import TrialResult
from msrr_bullet.trial.telemetry import Progress
from msrr_bullet.trial.trial import Trial
from msrr_bullet.viewer.live_cameras import LiveCameras
from msrr_bullet.viewer.readings import READINGS, readings
from msrr_scenes.messages import Action, Phase, PoseEstimate
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.scene import Scene
from tests.bullet.conftest import KeepingViewer

Load = Callable[..., Scene]


@dataclass
class Watched:
    """A trial with all reports."""

    scene: Scene
    result: TrialResult
    recorder: MemoryRecorder
    progress: list[Progress]
    snapshots: list[Snapshot] = field(default_factory=list)

    def of(self, kind: type) -> list:
        return [m for _, _, m in self.recorder.messages if isinstance(m, kind)]


def watch(scene: Scene, seed: int) -> Watched:
    recorder, viewer, progress = MemoryRecorder(), KeepingViewer(), []
    result = Trial(scene, seed, recorder=recorder, viewer=viewer, observer=progress.append).run()
    return Watched(scene, result, recorder, progress, viewer.snapshots)


@pytest.fixture(scope="module")
def docking(shipped: Load) -> Watched:
    """A docking from in front of the port, without an overhead camera."""
    return watch(shipped("close_range", blind=True), 7)


@pytest.fixture(scope="module")
def mission(shipped: Load) -> Watched:
    """The first seconds of a mission with a long-distance phase."""
    return watch(shipped("two_units", {"time_limit_s": "4"}, blind=True), 1)


def test_the_observer_gets_every_decision(docking: Watched) -> None:
    times = [p.time_s for p in docking.progress]
    steps = np.diff(times)
    assert steps.min() > 0.0
    assert steps.mean() == pytest.approx(1.0 / docking.scene.control.rate_hz, rel=0.01)
    assert len(times) == len(docking.of(Action)) == len(docking.snapshots)
    phases = [phase for phase, _ in itertools.groupby(p.phase for p in docking.progress)]
    assert phases == [Phase.HAND_OVER, Phase.DOCK, Phase.LOCK, Phase.VERIFY, Phase.DONE]
    assert docking.progress[0].believed is None  # no measurement arrives before the first latency is over
    latency = docking.scene.cameras.onboard.latency_ms * 1e-3
    known = next(p for p in docking.progress if p.believed is not None)
    assert latency <= known.time_s < latency + 0.2


def test_progress_snapshots_and_log_agree(docking: Watched) -> None:
    actions, truth = docking.of(Action), docking.of(TruePose)
    estimates = {m.stamp_ns: m for m in docking.of(PoseEstimate)}
    X_BD = docking.scene.geometry("b").dock_frame("rear")
    for action, progress, snapshot in zip(actions, docking.progress, docking.snapshots, strict=True):
        assert progress.time_s == pytest.approx(1e-9 * action.stamp_ns)
        assert (progress.phase, progress.attempt) == (action.phase, action.attempt)
        assert (snapshot.stamp_ns, snapshot.first.twist) == (action.stamp_ns, action.twist)
        poses = {m.name: m.X_WB for m in truth if m.stamp_ns == action.stamp_ns}
        assert poses == dict(snapshot.units)
        true = (poses["b"] @ X_BD).inverse() @ poses["a"]
        assert progress.true is not None
        np.testing.assert_allclose(progress.true.as_array(), true.as_array(), atol=1e-12)
        if action.stamp_ns in estimates:
            assert progress.believed == estimates[action.stamp_ns].X_DU
            assert snapshot.first.estimate is not None
            between = (poses["b"] @ X_BD @ progress.believed).inverse() @ snapshot.first.estimate
            np.testing.assert_allclose(between.as_array(), 0.0, atol=1e-12)


def test_far_away_the_believed_pose_is_that_of_the_overhead_camera(mission: Watched) -> None:
    far = [p for p in mission.progress if p.phase is Phase.ASSEMBLE and p.believed is not None]
    assert len(far) > 100
    for p in far:
        assert p.true is not None
        between = p.true.inverse() @ p.believed
        assert np.hypot(between.x, between.y) < 0.05
        assert between.as_array().any()  # an estimate, not the truth


def test_events_are_the_changes_of_phase_and_the_verdict(docking: Watched, mission: Watched) -> None:
    for trial in (docking, mission):
        *changes, of_step, verdict = trial.of(Event)
        phases = [phase for phase, _ in itertools.groupby(p.phase for p in trial.progress)]
        assert [event.source for event in changes] == ["a"] * len(phases)
        for event, phase in zip(changes, phases, strict=True):
            assert event.text.startswith(f"attempt 1: {phase.text}: ")
        assert of_step.source == "judge"
        assert of_step.text.startswith(f"a to b.rear: {trial.result.outcome.value}")
        assert (verdict.source, verdict.text) == ("judge", trial.result.outcome.value)
    assert docking.result.outcome is Outcome.DOCKED
    assert mission.result.outcome is Outcome.TIMEOUT
    assert docking.of(Event)[-1].level.value != mission.of(Event)[-1].level.value


def test_the_start_poses_come_first(mission: Watched) -> None:
    start = mission.recorder.messages[0][2]
    assert isinstance(start, StartPoses)
    assert start.poses.keys() == mission.scene.units.keys() | mission.scene.obstacles.keys()
    assert start.poses["a"] == mission.snapshots[0].units["a"]


def test_every_display_of_the_clearance_leaves_out_the_docking_pair(docking: Watched) -> None:
    """Log and snapshots show what counts; while the only pair docks there is nothing to show."""
    shown = {record.stamp_ns: record.clearance for record in docking.of(ClearanceRecord)}
    assert {s.stamp_ns: s.clearance for s in docking.snapshots if s.clearance is not None} == shown
    apart = {s.stamp_ns for s in docking.snapshots if s.first.phase is Phase.HAND_OVER}
    assert shown.keys() == apart
    assert min(c.distance for c in shown.values()) == docking.result.min_clearance_m > 0.0
    series = TrialSeries.of(docking.scene, docking.snapshots)  # of plots and tables
    assert np.nanmin(series.clearance) == docking.result.min_clearance_m
    seated = dict(zip(READINGS, readings(docking.snapshots[-1]), strict=True))
    assert (seated["phase"], seated["clearance"], seated["nearest pair"]) == ("done", "–", "–")


def test_reports_change_nothing_in_the_trial(docking: Watched) -> None:
    assert Trial(docking.scene, 7).run() == docking.result


def test_reports_change_nothing_in_a_mission_in_which_nobody_docks(shipped: Load) -> None:
    """Nor in its smallest clearance, although one that does not count is measured only for a report."""
    scene = shipped("corridor", {"time_limit_s": "6"}, blind=True)
    found = Trial(scene, 1).run()
    assert found == watch(scene, 1).result
    assert found.min_clearance_m is not None


class WatchingViewer(KeepingViewer):
    """A viewer that draws every frame of the cameras."""

    def __init__(self, scene: Scene, seed: int) -> None:
        super().__init__()
        self.cameras, self.drawn = LiveCameras(live_stills(scene, seed)), set[str]()

    def update(self, snapshot: Snapshot) -> None:
        self.cameras.add(snapshot)

    def wants(self, camera: str) -> bool:
        return True

    def show_view(self, view: CameraView) -> None:
        self.drawn.add(self.cameras.draw(view).camera)


def test_images_for_a_viewer_change_no_bit_of_a_trial(shipped: Load, tmp_path: Path) -> None:
    scene = shipped("two_units", {"plant": "unicycle", "time_limit_s": "0.4"})
    watching = WatchingViewer(scene, 2)
    for name, viewer in (("watched", watching), ("alone", None)):
        with McapRecorder(tmp_path / name, LogHeader.of(scene, 2, {})) as recorder:
            Trial(scene, 2, recorder=recorder, viewer=viewer).run()
    assert watching.drawn == {"overhead"}
    assert (tmp_path / "watched").read_bytes() == (tmp_path / "alone").read_bytes()


def test_a_pair_that_is_pulled_apart_is_shown_apart(shipped: Load) -> None:
    """The robot goes on after the pull test; what it sees then is compared with where it then is."""
    watched = watch(shipped("weak_lock"), 1)
    assert watched.result.outcome is Outcome.LOCK_FAILED
    late = [s for s in watched.snapshots if 1e-9 * s.stamp_ns > watched.result.duration_s + 0.2]
    assert len(late) > 10
    series = TrialSeries.of(watched.scene, late)
    assert (series.true_port[:, 0] > 0.005).all()
    np.testing.assert_allclose(series.believed_port[:, 0], series.true_port[:, 0], atol=0.001)
