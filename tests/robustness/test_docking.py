"""Docking with a poor camera: noise, blur, dropped frames, latency."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from msrr_bullet.log import MemoryRecorder, TruePose
from msrr_bullet.trial.result import TrialResult
from msrr_bullet.trial.trial import Trial
from msrr_perception.pose.target import TargetModel
from msrr_scenes.messages import Detections, Exposure, PoseEstimate
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.scene import Scene

CONDITIONS: Mapping[str, Mapping[str, str]] = {
    "noise 8 grey levels": {"cameras.onboard.noise_grey": "8"},
    "blur 1.0 px": {"cameras.onboard.blur_px": "1.0"},
    "30 % dropped frames": {"cameras.onboard.dropout": "0.3"},
    "120 ms latency": {"cameras.onboard.latency_ms": "120"},
}

#: Success rate that is claimed for every condition.
RATE = 0.99
CONTACT_LATERAL_M, CONTACT_YAW = 0.003, math.radians(1.5)
BELIEF_M = 0.003
NEAR_M = 0.25


@dataclass(frozen=True)
class Tier:
    """The seeds of the trials, and the number of them that have to be good."""

    seeds: range
    needed: int


QUICK, FULL = Tier(range(4), 3), Tier(range(1000, 1050), 47)


@dataclass(frozen=True)
class Docking:
    """One trial and the quality of its perception by the log.

    Attributes:
        result: Result of the trial.
        read: Share of the frames that reached the robot in which it read a tag.
        lateral_rms_m: RMS of the estimate's lateral error during the last quarter of a metre [m].
    """

    result: TrialResult
    read: float
    lateral_rms_m: float


def dock(scene: Scene, seed: int) -> Docking:
    recorder = MemoryRecorder()
    result = Trial(scene, seed, recorder=recorder).run()
    target = TargetModel.from_scene(scene, scene.plan[0])
    tags = [len({t.tag_id for t in m.tags}) for _, _, m in recorder.messages if isinstance(m, Detections)]
    frames = sum(isinstance(m, Exposure) for _, _, m in recorder.messages)
    D_in_target = scene.geometry("b").dock_frame("rear")
    truth: dict[tuple[str, int], TruePose] = {
        (m.name, ns): m for _, ns, m in recorder.messages if isinstance(m, TruePose)
    }
    errors = []
    for _, now_ns, m in recorder.messages:
        if isinstance(m, PoseEstimate):
            X_DU = (truth["b", now_ns].X_WB @ D_in_target).inverse() @ truth["a", now_ns].X_WB
            if -X_DU.x - target.front <= NEAR_M:
                errors.append(m.X_DU.y - X_DU.y)
    rms = float(np.sqrt(np.mean(np.square(errors)))) if errors else math.inf
    return Docking(result, sum(n >= 1 for n in tags) / max(frames, 1), rms)


@pytest.mark.nightly
@pytest.mark.parametrize("condition", ["noise 8 grey levels", "30 % dropped frames"])
def test_it_docks_quickly_checked(
    condition: str, shipped: Callable[..., Scene], claim: Callable[..., Any]
) -> None:
    check(QUICK, condition, CONDITIONS[condition], shipped, claim)


@pytest.mark.nightly
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("condition", CONDITIONS)
def test_it_docks(condition: str, shipped: Callable[..., Scene], claim: Callable[..., Any]) -> None:
    check(FULL, condition, CONDITIONS[condition], shipped, claim)


def check(
    tier: Tier,
    condition: str,
    changes: Mapping[str, str],
    shipped: Callable[..., Scene],
    claim: Callable[..., Any],
) -> None:
    scene, trials = shipped("close_range", changes), len(tier.seeds)
    runs = [dock(scene, seed) for seed in tier.seeds]
    outcomes = [run.result.outcome for run in runs]
    assert not {Outcome.COLLISION, Outcome.CLEARANCE_VIOLATED, Outcome.FALSE_DOCK} & set(outcomes), outcomes

    claim(f"docks with {condition}", RATE, trials, tier.needed).check(
        [r.result.docked for r in runs], outcomes
    )
    contacts = [r.result.steps[0].contact for r in runs]
    claim(f"meets the port to 3 mm and 1.5 deg with {condition}", RATE, trials, tier.needed).check(
        [c is not None and c.lateral_m <= CONTACT_LATERAL_M and c.yaw_rad <= CONTACT_YAW for c in contacts],
        contacts,
    )
    claim(
        f"knows its side of the axis to 3 mm (RMS) at the end, with {condition}", RATE, trials, tier.needed
    ).check([r.lateral_rms_m <= BELIEF_M for r in runs], [r.lateral_rms_m for r in runs])
    claim(f"reads a tag in 19 of 20 frames with {condition}", RATE, trials, tier.needed).check(
        [r.read >= 0.95 for r in runs], [r.read for r in runs]
    )


def test_the_faults_are_real(shipped: Callable[..., Scene]) -> None:
    """Frames are lost and late as the scene says; otherwise the tests above would prove nothing."""
    changes = {"cameras.onboard.dropout": "0.3", "cameras.onboard.latency_ms": "120", "time_limit_s": "4"}
    recorder = MemoryRecorder()
    scene = shipped("close_range", {**changes, "perception": "parametric", "plant": "unicycle"})
    Trial(scene, 3, recorder=recorder).run()
    arrived = [(ns, m.exposure) for _, ns, m in recorder.messages if hasattr(m, "exposure")]
    delays = np.array([ns - exposure.stamp_ns for ns, exposure in arrived]) * 1e-9
    assert delays.min() >= 0.12
    assert delays.max() < 0.12 + 2.0 / scene.physics_hz
    sent = max(exposure.frame for _, exposure in arrived) + 1
    # Binomial(90, 0.7) leaves these bounds in less than one of 10,000 seeds.
    assert 0.5 < len(arrived) / sent < 0.88
