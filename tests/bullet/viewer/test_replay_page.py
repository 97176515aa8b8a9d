"""Page that replays a trial, opened in a browser and read as text."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from msrr_bullet.timeline import palette
from msrr_bullet.viewer import page
from msrr_bullet.viewer.replay_page import write_replay
from msrr_scenes.errors import MsrrError
from msrr_scenes.geometry.se2 import SE2


def test_it_shows_units_tags_and_paths(browser, drive, tmp_path):
    path = write_replay(tmp_path / "replay.html", drive.scene, drive.snapshots)
    image = browser.screenshot(f"{path.as_uri()}#t=3.0", tmp_path)
    browser.assert_shows_the_trial(image, drive.scene)
    assert browser.pixels_of(image, palette.CLEARANCE) > 50


def test_it_plays_by_itself(browser, drive, tmp_path):
    # Half a second of trial: a browser without a window renders slowly.
    path = write_replay(tmp_path / "replay.html", drive.scene, drive.snapshots[60:73])
    end = (drive.snapshots[72].stamp_ns - drive.snapshots[60].stamp_ns) / 1e9
    played = browser.stage(browser.screenshot(path.as_uri(), tmp_path, budget_ms=10_000))
    first, last = (browser.stage(browser.screenshot(f"{path.as_uri()}#t={t}", tmp_path)) for t in (0.0, end))
    moved = np.abs(played - first).max(axis=2) > 40
    assert moved.mean() > 0.01
    assert (np.abs(played - last).max(axis=2) > 40).mean() < 0.1 * moved.mean()


def test_a_trial_far_from_the_origin_is_in_view(browser, drive, tmp_path, with_step):
    def moved(X):
        return SE2(X.x + 30.0, X.y - 20.0, X.yaw)

    near = replace(drive.snapshots[100], clearance=None)
    far = with_step(
        replace(
            near,
            units={name: moved(X) for name, X in near.units.items()},
            obstacles={name: moved(X) for name, X in near.obstacles.items()},
        ),
        estimate=moved(near.estimate),
    )
    image = browser.screenshot(write_replay(tmp_path / "far.html", drive.scene, [far]).as_uri(), tmp_path)
    assert {drive.scene.tag_ids(unit)["tag_top"] for unit in drive.scene.units} <= browser.tags_in(image)


def test_it_is_one_file_that_requests_nothing_from_the_network(drive, tmp_path):
    text = write_replay(tmp_path / "replay.html", drive.scene, drive.snapshots).read_text()
    ours = text.replace(page.viewer_script(), "")
    assert not re.search(r"""(src|href)\s*=|https?://|@import""", ours)


def test_the_same_trial_gives_the_same_replay(drive, tmp_path):
    first = write_replay(tmp_path / "a.html", drive.scene, drive.snapshots).read_bytes()
    assert first == write_replay(tmp_path / "b.html", drive.scene, iter(drive.snapshots)).read_bytes()


def test_one_bare_snapshot_is_shown_and_none_is_refused(drive, tmp_path):
    bare = replace(drive.snapshots[0], steps=(), clearance=None)
    assert write_replay(tmp_path / "one.html", drive.scene, [bare]).is_file()
    with pytest.raises(MsrrError, match="without a single snapshot"):
        write_replay(tmp_path / "none.html", drive.scene, [])
