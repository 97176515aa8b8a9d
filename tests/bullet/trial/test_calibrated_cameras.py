"""Trials whose cameras distort as everybody is told: they dock as those of ideal cameras do."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from msrr_bullet.log import LogHeader
from msrr_bullet.log.mcap_recorder import McapRecorder
from msrr_bullet.replay.log_replay import replay
from msrr_bullet.trial.result import TrialResult
from msrr_bullet.trial.trial import Trial
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.scene import Scene

ONBOARD = {
    "cameras.onboard.calibration": (
        "{fx_px: 417, fy_px: 410, cx_px: 328, cy_px: 233, k1: -0.2, k2: 0.04, p1: 0.001, p2: -0.0005}"
    )
}
OVERHEAD = {
    "cameras.overhead.calibration": "{fx_px: 967, fy_px: 960, cx_px: 650, cy_px: 470, k1: -0.2, k2: 0.05}"
}


def contact_mm(result: TrialResult) -> float:
    contact = result.steps[0].contact
    assert contact is not None
    return 1e3 * abs(contact.lateral_m)


@pytest.mark.parametrize("seeds", [range(1), pytest.param(range(1, 12), marks=pytest.mark.nightly)], ids=str)
def test_a_unit_docks_behind_a_lens_that_it_knows(seeds: range, shipped: Callable[..., Scene]) -> None:
    """Units with ideal cameras touch the port within 0.1 mm."""
    for seed in seeds:
        result = Trial(shipped("close_range", ONBOARD), seed).run()
        assert result.outcome is Outcome.DOCKED
        assert contact_mm(result) < 0.1


@pytest.mark.nightly
@pytest.mark.parametrize("seed", range(4))
def test_a_mission_is_led_by_cameras_that_distort(
    seed: int, shipped: Callable[..., Scene], tmp_path: Path
) -> None:
    """And a replay, which has the calibration from the log, finds the same."""
    scene = shipped("two_units", ONBOARD | OVERHEAD)
    with McapRecorder(tmp_path / "trial.mcap", LogHeader.of(scene, seed, {})) as recorder:
        result = Trial(scene, seed, recorder=recorder).run()
    assert result.outcome is Outcome.DOCKED
    assert contact_mm(result) < 0.1
    assert replay(tmp_path).identical
