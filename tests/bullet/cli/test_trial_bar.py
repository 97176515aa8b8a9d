"""The bar of trials while the scenes of a variation are checked."""

from __future__ import annotations

from collections.abc import Callable

from rich.progress import Progress

from msrr_bullet.cli.trial_bar import TrialBar
from msrr_scenes.specs.scene import Scene


def test_the_bar_counts_the_scenes_that_are_checked(shipped: Callable[..., Scene]) -> None:
    scenes = [shipped("close_range", {"time_limit_s": limit}) for limit in ("8", "9")]
    progress = Progress()
    bar = TrialBar(progress, scenes, ["limit 8", "limit 9"], 6)
    shown = []
    for scene, seeds in bar.checking(scenes, [0, 1, 2]):
        assert scene is scenes[len(shown)]
        assert seeds == [0, 1, 2]
        shown.append(progress.tasks[0].description)
    assert shown == ["close_range, checking scene 1 of 2", "close_range, checking scene 2 of 2"]
    assert progress.tasks[0].description == "close_range"
