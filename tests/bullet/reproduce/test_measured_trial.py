"""Measured trials of the loop."""

import math
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest

from msrr_bullet.reproduce.measured_trial import measured_trial, record_trial
from msrr_scenes.loading.load import load_scene


@pytest.fixture(scope="module")
def recorded(blind_loop: dict[str, str]) -> Callable[[str], tuple[Any, ...]]:
    """The function that gives the trial of a law, which is run once."""

    @cache
    def record(law: str) -> tuple[Any, ...]:
        return record_trial(load_scene("two_units", {**blind_loop, "control.assembly": law}), 1)

    return record


def test_trials_of_the_real_loop_are_measured(recorded: Callable[[str], tuple[Any, ...]]) -> None:
    result, long, close = recorded("c1")
    assert result.docked
    assert long is not None
    assert close is not None
    assert long.measures()["tracking"] < 0.05
    measures = close.measures()
    assert measures["final"] < 0.01
    # The guidance trajectory computed again ends beyond the face and starts beside the tip.
    assert abs(close.reference[0, 0] - close.tip[0, 0]) < 0.02
    assert np.all(np.diff(close.reference[:, 0]) >= -1e-12)
    assert close.kept_within(load_scene("two_units").los.outer)


@pytest.mark.parametrize("law", ["c1", "c2"])
def test_the_long_phase_of_the_loop_separates_lag_from_swing(
    recorded: Callable[[str], tuple[Any, ...]], law: str
) -> None:
    _, long, _ = recorded(law)
    assert long is not None
    off, beside = np.hypot(*(long.tip - long.desired).T), long.from_path()
    assert np.all(beside <= off + 1e-12)
    found = long.measures()
    lag = found["amplitude"] - found["amplitude_path"]
    assert (0.0 <= lag < 0.003) if law == "c1" else (lag > 0.01)
    assert 0.0 < found["recovery_path"] <= found["recovery"]


def test_a_trial_without_an_approach_never_settled(blind_loop: dict[str, str]) -> None:
    trial = measured_trial(load_scene("two_units", {**blind_loop, "time_limit_s": "1.0"}), 0)
    assert trial.kept_in_view is None
    assert trial.measures["settling"] == math.inf
    assert "final" not in trial.measures
