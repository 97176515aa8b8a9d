"""Texts and derived values of a snapshot."""

from __future__ import annotations

from dataclasses import replace

from msrr_bullet.log import topics
from msrr_bullet.log.records import StepStart, TruePose
from msrr_bullet.timeline.snapshot import Snapshot, planned_paths, step_histories
from msrr_bullet.timeline.snapshot_builder import SnapshotBuilder
from msrr_scenes import load_scene
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import Action, Phase, Twist
from tests.bullet.conftest import with_step


def test_texts_name_phase_stage_and_progress(drive, short_snapshots):
    late = (s for s in short_snapshots if s.stamp_ns >= 3_000_000_000)
    following = next(s for s in late if s.first.assembly and s.first.path)
    assert following.first.phase_text == f"assemble, {following.first.assembly.stage}"
    assert following.first.path_text.endswith(" mm off")
    assert with_step(following, path=None).first.path_text == ""
    assert drive.snapshots[0].first.phase_text == "hand over"
    assert replace(following, steps=()).first.phase_text == ""


def test_the_docking_unit_is_that_of_the_step(drive):
    snapshot = drive.snapshots[0]
    assert (snapshot.first.unit, snapshot.docking_pose) == ("a", snapshot.units["a"])
    assert replace(snapshot, steps=()).docking_pose is None


def test_each_planned_path_is_found_once(short_snapshots):
    paths = planned_paths(short_snapshots)
    assert [path.number for path in paths] == list(range(1, len(paths) + 1))


def test_a_unit_that_comes_back_to_a_port_has_another_step_there() -> None:
    builder, found = SnapshotBuilder(load_scene("dock_again")), list[Snapshot]()
    for index in range(3):  # to dock, to undock, to dock
        stamp_ns = index * 1_000_000_000
        builder.add(topics.STEPS, stamp_ns, StepStart(stamp_ns, index, "a", "front", "b.rear"))
        for now_ns in (stamp_ns, stamp_ns + 20_000_000):
            builder.add(topics.action("a"), now_ns, Action(now_ns, Phase.DOCK, 1, Twist()))
            builder.add(topics.true_pose("a"), now_ns, TruePose("a", now_ns, SE2()))
            finished = builder.finish()
            assert finished is not None
            found.append(finished)
    histories = step_histories(found)
    assert [[at.stamp_ns // 1_000_000_000 for at, _ in each] for each in histories.values()] == [
        [index, index] for index in range(3)
    ]
