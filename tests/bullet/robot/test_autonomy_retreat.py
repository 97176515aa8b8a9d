"""Before a unit drives backwards the overhead camera looks behind it: trials with retreats and tug tests."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from msrr_bullet.run import run_trial
from msrr_bullet.sensors.parametric_cameras import ParametricOverheadCamera
from msrr_bullet.trial.result import TrialResult
from msrr_bullet.trial.telemetry import Progress
from msrr_perception.tracking.overhead_correction import OverheadCorrection
from msrr_scenes.arrays import Array
from msrr_scenes.messages import Phase, PoseEstimate
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.scene import Scene

SEED = 1
BLIND = {"plant": "unicycle", "perception": "parametric"}
#: Time at which the post appears; the unit is then at the plugged port.
APPEARS_S = 10.5
#: Position of the post behind the unit, from the port, and the distance that the unit can retreat [m].
ROOM = {-0.42: 0.10, -0.29: 0.0}


def plugged(post_x_m: float | None, **changes: Any) -> Scene:
    """A plugged port, and a post that appears in the lane behind the unit."""
    post = {"shape": "cylinder", "radius_m": 0.05, "height_m": 0.3, "tag_id": 40, "appears_at_s": APPEARS_S}
    post["pose"] = {"frame": "b.rear", "x_m": post_x_m}
    return Scene.model_validate(
        {
            "name": "plugged",
            "units": {"b": {"number": 1, "pose": {"x_m": 0.6}}, "a": {"number": 0, "pose": {"x_m": -0.6}}},
            "obstacles": {"post": post} if post_x_m is not None else {},
            "cameras": {"overhead": {"samples": 1}, "onboard": {"renderer": "raster", "samples": 1}},
            "faults": [{"kind": "port_plugged", "unit": "b", "port": "rear", "attempts": [1]}],
            "docking": {"attempts": 1},
            "plan": [{"unit": "a", "to": "b.rear"}],
            **changes,
        }
    )


@dataclass
class Watched:
    """A trial with the progress at every instant."""

    scene: Scene
    instants: list[Progress] = field(default_factory=list)

    def run(self) -> TrialResult:
        return run_trial(self.scene, SEED, observer=self.instants.append)

    def of(self, phase: Phase) -> list[Progress]:
        return [p for p in self.instants if p.phase is phase]

    @property
    def waited_s(self) -> float:
        """Time for which the unit stood before it retreated [s]."""
        retreat = self.of(Phase.RETREAT)
        moves = (b.time_s for a, b in pairwise(retreat) if a.true.x - b.true.x > 1e-4)
        return next(moves) - retreat[0].time_s


@pytest.mark.parametrize("post_x_m", ROOM)
@pytest.mark.parametrize(
    "models", [pytest.param(BLIND, id="blind"), pytest.param({}, id="pixels", marks=pytest.mark.nightly)]
)
def test_a_unit_does_not_retreat_into_a_post(post_x_m: float, models: Mapping[str, str]) -> None:
    """It stops short of the post, or does not move, and gives up because of the port, not the post."""
    trial = Watched(plugged(post_x_m, **models))
    result = trial.run()
    docking = trial.of(Phase.DOCK)
    assert docking[0].time_s < APPEARS_S < docking[-1].time_s
    assert result.outcome is Outcome.NOT_SEATED
    assert result.steps[0].belief_reason.startswith("gave up after 1 attempt: no progress"), "it is not stuck"
    stop_m = trial.scene.control.guard.stop_m
    assert result.min_clearance_m is not None
    assert result.min_clearance_m > stop_m - 0.002
    backed = trial.of(Phase.RETREAT)[0].true.x - trial.instants[-1].true.x
    assert backed == pytest.approx(ROOM[post_x_m], abs=0.04)


@pytest.fixture
def exposures(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Times of the exposures of the overhead camera [s]."""
    times: list[float] = []
    capture = ParametricOverheadCamera.capture

    def recorded(self: ParametricOverheadCamera, now_ns: int, robot: Any) -> Any:
        times.append(1e-9 * now_ns)
        return capture(self, now_ns, robot)

    monkeypatch.setattr(ParametricOverheadCamera, "capture", recorded)
    return times


def test_the_overhead_camera_exposes_once_a_second_while_docking_and_at_its_rate_while_retreating(
    exposures: list[float],
) -> None:
    trial = Watched(plugged(None, **BLIND))
    trial.run()
    docking, retreat = trial.of(Phase.DOCK), trial.of(Phase.RETREAT)
    checks = [t for t in exposures if docking[0].time_s < t <= docking[-1].time_s]
    assert 0.7 < len(checks) / (docking[-1].time_s - docking[0].time_s) < 1.0
    frames = [t for t in exposures if t > retreat[0].time_s]
    overhead = trial.scene.cameras.overhead
    assert overhead is not None
    assert len(frames) == pytest.approx(overhead.rate_hz * (retreat[-1].time_s - retreat[0].time_s), abs=2)
    # The period and the latency of the camera, and the start of the drive.
    assert 0.06 < trial.waited_s < 0.4


def test_the_overhead_camera_exposes_at_its_rate_in_a_tug_test(exposures: list[float]) -> None:
    """What was seen before the unit came near the port may be too long ago to drive backwards by."""
    askew = {"kind": "camera_misaligned", "unit": "a", "yaw_deg": 1.5}
    docking = {"verify": {"yaw_deg": 0.1}, "attempts": 1}
    trial = Watched(plugged(None, faults=[askew], docking=docking, **BLIND))
    assert trial.run().outcome is Outcome.DOCKED
    tug = trial.of(Phase.TUG_TEST)
    frames = [t for t in exposures if tug[0].time_s < t <= tug[-1].time_s]
    overhead = trial.scene.cameras.overhead
    assert overhead is not None
    assert len(frames) == pytest.approx(overhead.rate_hz * (tug[-1].time_s - tug[0].time_s), abs=2)
    assert len(frames) >= 8


def test_a_unit_retreats_although_the_overhead_camera_fails() -> None:
    """The camera fails while the unit docks, and the wait ends by a time limit."""
    dark = {"kind": "camera_blackout", "camera": "overhead", "from_s": 5.0, "to_s": 90.0}
    scene = plugged(None, **BLIND)
    trial = Watched(plugged(None, faults=[*(f.model_dump() for f in scene.faults), dark], **BLIND))
    assert trial.run().outcome is Outcome.NOT_SEATED
    assert 1.0 < trial.waited_s < 1.3
    backed = trial.of(Phase.RETREAT)[0].true.x - trial.instants[-1].true.x
    assert backed > scene.docking.retreat_m - 0.03


@pytest.fixture
def shifts(monkeypatch: pytest.MonkeyPatch) -> dict[int, Array]:
    """What the overhead camera adds to the pose by the onboard camera, by time [ns]; (3,) [m, m, rad]."""
    found: dict[int, Array] = {}
    apply = OverheadCorrection.apply

    def recorded(self: OverheadCorrection, by_sight: PoseEstimate) -> PoseEstimate:
        corrected = apply(self, by_sight)
        found[by_sight.stamp_ns] = corrected.X_DU.as_array() - by_sight.X_DU.as_array()
        return corrected

    monkeypatch.setattr(OverheadCorrection, "apply", recorded)
    return found


@pytest.mark.parametrize("undocks", [False, True])
def test_on_the_way_back_the_overhead_camera_corrects_the_onboard_camera_anew(
    shifts: dict[int, Array], undocks: bool
) -> None:
    """It held on to the correction of the approach, and took it to be as good as it had been there."""
    plan = [{"unit": "a", "to": "b.rear"}, {"undock": "a", "name": "leave"}]
    changes = {"faults": [], "plan": plan} if undocks else {}
    trial = Watched(plugged(None, as_built="workshop", **changes, **BLIND))
    assert trial.run().outcome is (Outcome.COMPLETE if undocks else Outcome.NOT_SEATED)
    retreat = trial.of(Phase.RETREAT)
    back = [shifts[t] for t in sorted(shifts) if retreat[0].time_s <= 1e-9 * t <= retreat[-1].time_s]
    assert (np.abs(back[0]).max() > 0.0) is not undocks, "the one of the approach, until the unit is out"
    assert len({tuple(shift) for shift in back}) > 10
