"""A docking unit avoids an obstacle that appears beside it, by one small overhead window per second."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from msrr_bullet.log import LOG_NAME, LogHeader
from msrr_bullet.log.mcap_recorder import McapRecorder
from msrr_bullet.replay.log_replay import replay
from msrr_bullet.trial.telemetry import Progress
from msrr_bullet.trial.trial import Trial
from msrr_perception.detection.overhead_vision import OverheadVision
from msrr_scenes.messages import Detections, Phase
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.scene import Scene

FULL = 1280 * 960


def scene_with_post(**changes: Any) -> Scene:
    """A low post appears beside the lane, too near for a unit to pass, while a unit is docking."""
    post = {"shape": "cylinder", "radius_m": 0.05, "height_m": 0.08, "tag_id": 40, "appears_at_s": 4.0}
    post["pose"] = {"frame": "b.rear", "x_m": -0.3, "y_m": 0.11}
    return Scene.model_validate(
        {
            "name": "lane",
            "units": {"b": {"number": 1, "pose": {"x_m": 0.6}}, "a": {"number": 0, "pose": {"x_m": -0.6}}},
            "obstacles": {"post": post},
            "cameras": {"overhead": {"samples": 1}, "onboard": {"renderer": "raster", "samples": 1}},
            "docking": {"attempts": 1},
            "plan": [{"unit": "a", "to": "b.rear"}],
            **changes,
        }
    )


@pytest.mark.parametrize(
    "models",
    [
        pytest.param({"plant": "unicycle", "perception": "parametric"}, id="blind"),
        pytest.param({}, id="pixels", marks=pytest.mark.nightly),
    ],
)
def test_a_unit_stops_before_a_post_that_appears_beside_the_lane(
    models: dict[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The unit gives up without a contact, and a replay is identical."""
    checks: list[Detections] = []
    detect_near = OverheadVision.detect_near

    def recorded(self: OverheadVision, *args: Any) -> Detections:
        checks.append(detect_near(self, *args))
        return checks[-1]

    monkeypatch.setattr(OverheadVision, "detect_near", recorded)
    instants: list[Progress] = []
    scene = scene_with_post(**models)
    with McapRecorder(tmp_path / LOG_NAME, LogHeader.of(scene, 1, {})) as recorder:
        result = Trial(scene, 1, recorder=recorder, observer=instants.append).run()
    docking = [p.time_s for p in instants if p.phase is Phase.DOCK]
    assert docking[0] < 4.0 < docking[-1]
    assert result.outcome is Outcome.GAVE_UP
    assert result.steps[0].contact is None
    assert result.min_clearance_m is not None
    assert result.min_clearance_m > scene.control.guard.stop_m - 0.002
    if not models:
        times = np.array([1e-9 * check.exposure.stamp_ns for check in checks])
        assert len(times) >= 4
        assert 0.99 < np.diff(times).min() <= np.diff(times).max() < 1.11
        assert max(sum(w.area for w in check.windows) for check in checks) < FULL / 6
    assert replay(tmp_path).identical
