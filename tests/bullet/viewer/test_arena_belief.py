"""Plan and estimates of other bodies on both pages."""

from __future__ import annotations

import pytest

from msrr_bullet.timeline import palette
from msrr_bullet.viewer.arena_belief import ArenaBelief
from msrr_bullet.viewer.live import LiveViewer
from msrr_bullet.viewer.replay_page import write_replay
from msrr_scenes.loading.load import load_scene


@pytest.mark.parametrize("live_page", [False, True], ids=["replay", "live"])
def test_pages_show_the_plan_and_the_estimates_of_other_bodies(
    browser, short_log, short_snapshots, tmp_path, live_page
):
    scene = short_log.header.scene
    snapshot = next(s for s in short_snapshots if s.stamp_ns >= 3_000_000_000)
    assert snapshot.first.assembly is not None
    if live_page:
        with LiveViewer(scene, port=0) as viewer:
            viewer.show(snapshot)
            image = browser.screenshot(viewer.url, until="latest")
    else:
        image = browser.screenshot(write_replay(tmp_path / "replay.html", scene, [snapshot]).as_uri())
    assert browser.pixels_of(image, palette.PLAN) > 50, "planned path and desired point"
    assert browser.pixels_of(image, palette.BELIEF) > 150, "ghost, and the outlines of other bodies"


def test_a_scene_without_an_overhead_camera_has_no_such_nodes(drive):
    belief = ArenaBelief(load_scene("close_range"))
    assert not list(belief.build())
    assert not list(belief.node_states(drive.snapshots[0]))
