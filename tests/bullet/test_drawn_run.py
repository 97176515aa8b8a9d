"""The files of a run, its page and its picture among them."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

from msrr_bullet.log import read_log
from msrr_bullet.run import run_trial
from msrr_bullet.trial.result import TrialResult
from msrr_bullet.trial.trial import Trial
from msrr_scenes.specs.scene import Scene


def test_a_run_folder_holds_the_log_and_what_follows_from_it(
    shipped: Callable[..., Scene], tmp_path: Path
) -> None:
    scene = shipped("close_range", {"time_limit_s": "1.5"})
    out = tmp_path / "runs" / "first"
    result = run_trial(scene, 7, out=out)
    assert result.folder == out
    assert result == Trial(scene, 7).run()  # writing a folder changes nothing in the trial
    assert sorted(path.name for path in out.iterdir()) == [
        "picture.png",
        "replay.html",
        "result.json",
        "trial.mcap",
    ]
    assert TrialResult.from_json((out / "result.json").read_text()) == result
    assert json.loads((out / "result.json").read_text())["outcome"] == result.outcome.value
    log = read_log(out)
    assert log.complete
    assert log.header.seed == 7
    assert (out / "picture.png").read_bytes().startswith(b"\x89PNG")
    page = (out / "replay.html").read_text()
    assert "</html>" in page
    assert 'src="http' not in page  # self-contained
