"""Snapshots and verdict of a log."""

from __future__ import annotations

from msrr_bullet.log import TruePose, read_log
from msrr_bullet.log.mcap_recorder import McapRecorder
from msrr_bullet.timeline.log_snapshots import read_snapshots, read_verdict
from msrr_scenes.messages import Action, ArenaEstimate, Phase


def test_there_is_a_snapshot_for_every_decision_with_the_truth_of_its_instant(short_log, short_snapshots):
    actions = [action for _, action in short_log.messages(Action, "/control/*")]
    assert [(s.stamp_ns, s.first.phase, s.first.twist) for s in short_snapshots] == [
        (a.stamp_ns, a.phase, a.twist) for a in actions
    ]
    truth = {(pose.name, pose.stamp_ns): pose.X_WB for _, pose in short_log.messages(TruePose, "/truth/*")}
    for snapshot in short_snapshots:
        assert snapshot.units["a"] == truth["a", snapshot.stamp_ns]


def test_far_away_the_estimate_is_that_of_the_arena(short_log, short_snapshots):
    own = {stamp_ns: m.own.X_WB for stamp_ns, m in short_log.messages(ArenaEstimate, "/perception/*")}
    far = [s for s in short_snapshots if s.first.phase is Phase.ASSEMBLE and s.stamp_ns in own]
    assert len(far) > 20
    assert all(s.first.estimate == own[s.stamp_ns] for s in far)


def test_the_verdict_is_the_last_word_of_the_judge(blind_run, short_log, tmp_path):
    assert read_verdict(read_log(blind_run)) == "docked"
    assert read_verdict(short_log) == "timeout"
    with McapRecorder(tmp_path / "t.mcap", short_log.header):
        pass
    interrupted = read_log(tmp_path / "t.mcap")
    assert read_verdict(interrupted) is None
    assert read_snapshots(interrupted) == []
