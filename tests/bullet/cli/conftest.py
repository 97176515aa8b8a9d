"""Commands of the tests run in a folder of their own, with a terminal of fixed width."""

from functools import partial
from pathlib import Path

import pytest

from msrr_bullet.replay.log_replay import replay
from msrr_bullet.sweep.trials import run_trials
from tests.bullet.conftest import inline


@pytest.fixture(autouse=True)
def _own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "120")


@pytest.fixture
def short_trial() -> list[str]:
    """Options for a real trial that takes no time: no contact, no pixels, one simulated second."""
    return ["--set", "plant=unicycle", "--set", "perception=parametric", "--set", "time_limit_s=1"]


@pytest.fixture
def sweeps_here(monkeypatch: pytest.MonkeyPatch) -> None:
    """Trials of sweeps run in this process: to start another one takes longer than they do."""
    monkeypatch.setattr("msrr_bullet.sweep.trials.run_trials", partial(run_trials, executor=inline))


@pytest.fixture
def replays_here(monkeypatch: pytest.MonkeyPatch) -> None:
    """Replays run in this process, for the same reason."""
    monkeypatch.setattr("msrr_bullet.replay.isolation.replay_isolated", replay)
