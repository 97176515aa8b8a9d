"""Texts and derived values of a snapshot."""

from __future__ import annotations

from dataclasses import replace

from msrr_bullet.timeline.snapshot import planned_paths


def test_texts_name_phase_stage_and_progress(drive, short_snapshots, with_step):
    following = next(s for s in short_snapshots if s.assembly and s.path and s.stamp_ns >= 3_000_000_000)
    assert following.phase_text == f"assemble, {following.assembly.stage}"
    assert following.path_text.endswith(" mm off")
    assert with_step(following, path=None).path_text == ""
    assert drive.snapshots[0].phase_text == "hand over"
    assert replace(following, steps=()).phase_text == ""


def test_the_docking_unit_is_that_of_the_step(drive):
    snapshot = drive.snapshots[0]
    assert (snapshot.docking_unit, snapshot.docking_pose) == ("a", snapshot.units["a"])
    assert replace(snapshot, steps=()).docking_pose is None


def test_each_planned_path_is_found_once(short_snapshots):
    paths = planned_paths(short_snapshots)
    assert [path.number for path in paths] == list(range(1, len(paths) + 1))
