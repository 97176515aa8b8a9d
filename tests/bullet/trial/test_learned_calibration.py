"""What units that were built with care learn during a trial, with contact and rendered images."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from msrr_bullet.log import MemoryRecorder
from msrr_bullet.trial.trial import Trial
from msrr_perception.estimation.calibration_memory import CalibrationMemory
from msrr_perception.estimation.corner_filter import CornerEkf
from msrr_perception.motion.filter_state import CalibrationEstimate
from msrr_perception.pose.target import TargetModel
from msrr_scenes.errors import SceneError
from msrr_scenes.loading.load import load_scene
from msrr_scenes.messages import Action, Phase, PoseEstimate
from msrr_scenes.outcome import Outcome

BLIND = {"plant": "unicycle", "perception": "parametric", "radio": "{}"}


@pytest.mark.nightly
@pytest.mark.timeout(3000)
@pytest.mark.parametrize("learns", [True, False])
def test_the_second_time_a_port_looks_as_it_did_from_its_seat(learns: bool) -> None:
    """5 seeds: seen seated to 0.6 mm and 0.6 deg by those that learn, farther off by some of the others.

    The seat itself varies: in seed 3 the lock closes the first time on a unit that is turned by 0.45 deg.
    """
    scene, off = load_scene("dock_again", {"docking.learn_seats": str(learns).lower()}), []
    for seed in range(5):
        recorder = MemoryRecorder()
        result = Trial(scene, seed, recorder=recorder).run()
        assert result.outcome is Outcome.COMPLETE
        assert [step.outcome for step in result.steps] == [Outcome.DOCKED, Outcome.UNDOCKED, Outcome.DOCKED]
        last = [m for _, _, m in recorder.messages if isinstance(m, PoseEstimate)][-1]
        off.append([abs(last.X_DU.x + 0.1), abs(last.X_DU.yaw)])
    largest = np.max(off, axis=0)
    assert ((largest < [6e-4, math.radians(0.6)]).all()) is np.bool_(learns)


@pytest.mark.timeout(300)
def test_a_unit_calibrates_in_front_of_the_port_and_docks() -> None:
    recorder = MemoryRecorder()
    scene = load_scene("close_range", {"plan.0.calibrate": "true", "units.a.pose.x_m": "-0.45"})
    result = Trial(scene, 0, recorder=recorder).run()
    assert result.docked
    actions = [m for _, _, m in recorder.messages if isinstance(m, Action)]
    phases = list(dict.fromkeys(action.phase for action in actions))
    assert phases[:3] == [Phase.HAND_OVER, Phase.CALIBRATE, Phase.DOCK]
    drive = [action.twist for action in actions if action.phase is Phase.CALIBRATE]
    assert min(twist.v for twist in drive) < 0.0 < max(twist.v for twist in drive)
    assert min(twist.w for twist in drive) < -0.2 < 0.2 < max(twist.w for twist in drive)


def test_units_that_a_base_station_leads_do_not_calibrate(tmp_path: Path) -> None:
    text = load_scene("dock_again").source
    assert text is not None
    path = tmp_path / "pair.yaml"
    path.write_text(text.read_text().replace("name: again", "name: again, calibrate: true"))
    with pytest.raises(SceneError, match=r"plan\.2\.calibrate: only units on their own calibrate"):
        load_scene(path)


@pytest.mark.parametrize("by_sight", [True, False])
def test_a_seat_teaches_a_unit_without_pixels_as_well(
    monkeypatch: pytest.MonkeyPatch, by_sight: bool
) -> None:
    """How the marker is turned to the port: poses, measured however often, tell nothing of it."""
    kept: dict[str, CalibrationEstimate] = {}
    monkeypatch.setattr(CalibrationMemory, "keep", lambda _, port, estimate: kept.update({port: estimate}))
    verify = {"docking.verify.by_sight": str(by_sight).lower()}
    scene = load_scene("dock_again", {**BLIND, **verify, "plan": "[{unit: a, to: b.rear}]"})
    assert Trial(scene, 0).run().outcome is Outcome.COMPLETE
    prior = CornerEkf(TargetModel.from_scene(scene, scene.docks[0]), scene.odometry).prior
    sigmas = [np.sqrt(known.covariance[-1, -1]) for known in (kept.pop("b.rear"), prior)]
    assert sigmas[0] < 0.9 * sigmas[1]
    assert not kept


def test_a_unit_backs_out_with_what_its_seat_has_taught() -> None:
    """Its own camera alone, so that nothing but the seat makes a difference."""
    sigmas = []
    for learns in ("true", "false"):
        changes = {"docking.learn_seats": learns, "control.overhead_correction": "false"}
        plan = "[{unit: a, to: b.rear}, {undock: a, name: leave}]"
        recorder = MemoryRecorder()
        scene = load_scene("dock_again", {**BLIND, **changes, "plan": plan})
        assert Trial(scene, 0, recorder=recorder).run().outcome is Outcome.COMPLETE
        last = [m for _, _, m in recorder.messages if isinstance(m, PoseEstimate)][-1]
        sigmas.append(np.sqrt(np.diag(last.covariance)))
    assert (sigmas[0] < 0.7 * sigmas[1]).all()
