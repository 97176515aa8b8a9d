"""A run folder: what it holds, and a folder that cannot be made."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from msrr_bullet.log import read_log
from msrr_bullet.run import RunFolderError, run_trial
from msrr_bullet.trial.result import TrialResult
from msrr_bullet.trial.trial import Trial
from msrr_scenes.specs.scene import Scene

SEED = 7
Load = Callable[..., Scene]


def test_a_run_folder_holds_the_log_and_what_follows_from_it(shipped: Load, tmp_path: Path) -> None:
    scene = shipped("close_range", {"cameras.onboard.samples": "1", "time_limit_s": "1.5"})
    out = tmp_path / "runs" / "first"
    result = run_trial(scene, SEED, out=out)
    assert result == Trial(scene, SEED).run()  # writing a folder changes nothing in the trial
    assert {path.name for path in out.iterdir()} == {
        "trial.mcap",
        "result.json",
        "replay.html",
        "picture.png",
    }
    assert TrialResult.from_json((out / "result.json").read_text()) == result
    assert json.loads((out / "result.json").read_text())["outcome"] == result.outcome.value
    log = read_log(out)
    assert log.complete
    assert log.header.seed == SEED
    assert (out / "picture.png").read_bytes().startswith(b"\x89PNG")
    page = (out / "replay.html").read_text()
    assert "</html>" in page
    assert 'src="http' not in page  # self-contained


def test_a_run_folder_is_overwritten(shipped: Load, tmp_path: Path) -> None:
    scene = shipped("short_time", {"time_limit_s": "0.5"}, blind=True)
    for seed in (1, 2):
        run_trial(scene, seed, out=tmp_path)
        assert read_log(tmp_path).header.seed == seed
        assert TrialResult.from_json((tmp_path / "result.json").read_text()).seed == seed


def test_a_folder_that_cannot_be_made_is_reported_before_the_trial(shipped: Load, tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("a file")
    with pytest.raises(RunFolderError, match="choose another"):
        run_trial(shipped("short_time", blind=True), SEED, out=tmp_path / "taken" / "run")
