"""What comes up beside a unit that drives to the port is noticed from above, for a glance a second."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from msrr_bullet.replay.replayer import replay
from msrr_bullet.robot.overhead_localizer import GLANCE_HALF_M
from msrr_bullet.run import run_trial
from msrr_bullet.trial.telemetry import Progress
from msrr_perception.detection.overhead_vision import OverheadVision
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import Detections, Phase
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.scene import Scene

FULL = 1280 * 960


def lane(**changes: Any) -> Scene:
    """A low post comes up beside the lane, too near for a unit to pass, while one is on its way there."""
    post = {"shape": "cylinder", "radius_m": 0.05, "height_m": 0.08, "tag_id": 40, "appears_at_s": 4.0}
    post["pose"] = {"frame": "b.rear", "x_m": -0.3, "y_m": 0.11}
    return Scene.model_validate(
        {
            "name": "lane",
            "units": {"b": {"number": 1, "pose": {"x_m": 0.6}}, "a": {"number": 0, "pose": {"x_m": -0.6}}},
            "obstacles": {"post": post},
            "cameras": {"overhead": {}, "onboard": {"renderer": "raster"}},
            "docking": {"attempts": 1},
            "plan": [{"unit": "a", "to": "b.rear"}],
            **changes,
        }
    )


@pytest.mark.parametrize(
    "models", [{"plant": "unicycle", "perception": "parametric"}, {}], ids=["blind", "pixels"]
)
def test_a_post_beside_the_lane_is_not_driven_into(
    models: dict[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The unit stops short of it and gives up, never having touched the port; a replay sees the same."""
    glances: list[Detections] = []
    glance = OverheadVision.detect_near

    def noted(self: OverheadVision, *args: Any) -> Detections:
        glances.append(glance(self, *args))
        return glances[-1]

    monkeypatch.setattr(OverheadVision, "detect_near", noted)
    instants: list[Progress] = []
    scene = lane(**models)
    result = run_trial(scene, 1, observer=instants.append, out=tmp_path / "run" if not models else None)
    docking = [p.time_s for p in instants if p.phase is Phase.DOCK]
    assert docking[0] < 4.0 < docking[-1]
    assert result.outcome is Outcome.GAVE_UP
    assert result.contact is None
    assert result.min_clearance_m is not None
    assert result.min_clearance_m > scene.control.guard.stop_m - 0.002
    if not models:
        times = np.array([1e-9 * look.exposure.stamp_ns for look in glances])
        assert len(times) >= 4
        assert 0.99 < np.diff(times).min() <= np.diff(times).max() < 1.11
        assert max(sum(w.area for w in look.windows) for look in glances) < FULL / 6
        assert replay(tmp_path / "run").identical


def test_a_glance_sees_what_is_near_and_leaves_the_other_looks_alone(open_arena: Callable) -> None:
    arenas = [open_arena(plant="bullet") for _ in range(2)]
    for arena in arenas:
        arena.run(1.05)
    glanced = arenas[0]
    exposure = glanced.looks[-1].exposure
    seen = {}
    for name, middle in {"near": SE2(0.3, 0.4), "far": SE2(-0.6, 0.3), "outside": SE2(9.0, 9.0)}.items():
        look = glanced.vision.detect_near(exposure, middle.translation, GLANCE_HALF_M, glanced.camera.fetch)
        seen[name] = [t.tag_id for t in look.tags]
        assert sum(w.area for w in look.windows) < FULL / 6
    # Both units stand in no picture of a glance, the post in that of its place.
    assert seen == {"near": [500], "far": [], "outside": []}
    for arena in arenas:
        arena.run(1.5)
    for one, other in zip(*(a.looks for a in arenas), strict=True):
        assert one.windows == other.windows
        for tag, same in zip(one.tags, other.tags, strict=True):
            np.testing.assert_array_equal(tag.corners, same.corners)
