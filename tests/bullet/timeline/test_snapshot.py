"""Texts and derived values of a snapshot."""

from __future__ import annotations

from dataclasses import replace

from msrr_bullet.timeline.snapshot import planned_paths
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
