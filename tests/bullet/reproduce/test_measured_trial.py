"""Measured trials of the loop."""

import math

import numpy as np
import pytest

from msrr_bullet.reproduce.measured_trial import measured_trial, record_trial
from msrr_scenes.loading.load import load_scene


def test_trials_of_the_real_loop_are_measured(blind_loop: dict[str, str]) -> None:
    scene = load_scene("two_units", {**blind_loop, "control.assembly": "c1"})
    result, long, close = record_trial(scene, 1)
    assert result.docked
    assert long is not None
    assert close is not None
    assert long.measures()["tracking"] < 0.05
    measures = close.measures()
    assert measures["final"] < 0.01
    # The guidance trajectory computed again ends beyond the face and starts beside the tip.
    assert abs(close.reference[0, 0] - close.tip[0, 0]) < 0.02
    assert np.all(np.diff(close.reference[:, 0]) >= -1e-12)
    assert close.kept_within(scene.los.outer)


@pytest.mark.parametrize("law", ["c1", "c2"])
def test_the_long_phase_of_the_loop_separates_lag_from_swing(blind_loop: dict[str, str], law: str) -> None:
    _, long, _ = record_trial(load_scene("two_units", {**blind_loop, "control.assembly": law}), 1)
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
