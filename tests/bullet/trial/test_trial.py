"""Whole trials: docking by rendered images, other plants and perceptions, and what a seed determines."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from msrr_bullet.log import CameraWindow, MemoryRecorder
from msrr_bullet.log.codec import to_bytes
from msrr_bullet.log.formats import format_of
from msrr_bullet.run import run_trial
from msrr_bullet.trial.result import TrialResult
from msrr_bullet.trial.trial import Trial
from msrr_scenes.messages import Phase, WheelOdometry
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.scene import Scene

SEED = 7
Load = Callable[..., Scene]


@dataclass(frozen=True)
class Docking:
    """One docking by rendered images."""

    scene: Scene
    result: TrialResult


@pytest.fixture(scope="module")
def docking(shipped: Load) -> Docking:
    scene = shipped("close_range")
    return Docking(scene, Trial(scene, SEED).run())


def texts(found: list[tuple[str, int, object]]) -> list[tuple[str, int, bytes]]:
    return [(topic, stamp_ns, to_bytes(format_of(m).encode(m))) for topic, stamp_ns, m in found]


def messages(scene: Scene, seed: int) -> list[tuple[str, int, bytes]]:
    """Every message of a trial: topic, time, text."""
    recorder = MemoryRecorder()
    Trial(scene, seed, recorder=recorder).run()
    return texts(recorder.messages)


def on(log: list[tuple[str, int, bytes]], topic: str) -> list[tuple[str, int, bytes]]:
    return [m for m in log if m[0] == topic]


def test_a_unit_docks_by_rendered_images(docking: Docking) -> None:
    result = docking.result
    assert result.outcome is Outcome.DOCKED
    assert result.docked
    assert (result.plant, result.perception, result.seed, result.scene) == (
        "bullet",
        "images",
        SEED,
        "close_range",
    )
    (step,) = result.steps
    assert (step.unit, step.port, step.target) == ("a", "front", "b.rear")
    assert (step.phase, len(step.attempts), step.docked) == (Phase.DONE, 1, True)
    assert (step.started_s, step.ended_s) == (0.0, result.duration_s)
    assert step.contact is not None
    assert step.contact.lateral_m < 0.003
    assert abs(step.contact.port.y_m) == step.contact.lateral_m
    assert abs(step.contact.port.yaw_rad) == step.contact.yaw_rad
    assert step.contact.yaw_rad < math.radians(1.5)
    assert step.seating is not None
    assert step.seating.seated
    assert step.seating.axial_gap_m < docking.scene.judge.seated_depth_m
    assert step.lock_closed
    assert step.lock_engaged
    assert step.pull_test_passed


def test_the_result_holds_belief_and_truth(docking: Docking) -> None:
    (step,) = docking.result.steps
    assert step.belief == "docked"
    assert step.contact is not None
    error = step.contact.estimate_error
    assert error is not None
    assert math.hypot(error.x_m, error.y_m) < 0.003
    assert abs(error.yaw_rad) < math.radians(1.0)
    assert error.x_m != 0.0  # an estimate that equals the truth bit for bit would be the truth
    (attempt,) = step.attempts
    assert attempt.believed is not None
    true, believed = attempt.true, attempt.believed
    assert math.hypot(believed.x_m - true.x_m, believed.y_m - true.y_m) < 0.003
    assert attempt.true.x_m == pytest.approx(-docking.scene.geometry("a").port("front").x, abs=0.003)


def test_plant_and_perception_are_independent_axes(shipped: Load) -> None:
    """In their other combinations units dock in other tests of this file and of all outcomes."""
    result = run_trial(shipped("weak_lock", {"plant": "unicycle", "lock.strength_n": "60"}), 2)
    assert result.outcome is Outcome.DOCKED, result.decisive_step.belief_reason
    assert (result.plant, result.perception) == ("unicycle", "images")


def test_kinematic_units_with_parametric_perception_dock_at_the_first_attempt(shipped: Load) -> None:
    """The fast variant replaces the full one in studies, so it must not add failures."""
    scene = shipped("close_range", blind=True)
    results = [run_trial(scene, seed) for seed in range(5)]
    assert [(r.outcome, len(r.steps[0].attempts)) for r in results] == [(Outcome.DOCKED, 1)] * 5


@pytest.mark.parametrize("plant", ["bullet", "unicycle"])
def test_wheels_do_not_slip_against_the_port(plant: str, shipped: Load) -> None:
    """A seated unit with a dead switch goes on pressing, and the encoders show no motion."""
    recorder = MemoryRecorder()
    scene = shipped("dead_seat_switch", {"plant": plant, "perception": "parametric", "time_limit_s": "6.5"})
    Trial(scene, 1, recorder=recorder).run()
    wheel = scene.geometry("a").wheel_radius
    distance = {
        ns: 0.5 * wheel * (m.left + m.right) for _, ns, m in recorder.messages if isinstance(m, WheelOdometry)
    }
    pressed = [w for ns, w in distance.items() if 5.2e9 < ns < 6.0e9]
    assert len(pressed) > 70
    assert max(pressed) - min(pressed) < 0.002


def test_earlier_trials_in_the_process_change_nothing(shipped: Load) -> None:
    """The native detector and the caches of PyBullet outlive a trial and must not change a later one."""
    scene = shipped("weak_lock", {"time_limit_s": "0.8"})
    first, other, again = messages(scene, 1), messages(scene, 2), messages(scene, 1)
    assert first == again
    assert len(first) > 200
    drawn = ("/truth/start", "/sensors/a/odometry", "/camera/a/onboard/window", "/perception/a/detections")
    for topic in drawn:
        assert on(first, topic) != on(other, topic), topic


def searching(shipped: Load, **changes: str) -> MemoryRecorder:
    """A unit that searches a covered marker, so that the camera has no effect on the motion."""
    keys = {"noise": "cameras.onboard.noise_grey", "dropout": "cameras.onboard.dropout"}
    scene = shipped(
        "hidden_marker", {"docking.search_time_s": "0.6", **{keys[k]: v for k, v in changes.items()}}
    )
    recorder = MemoryRecorder()
    assert Trial(scene, SEED, recorder=recorder).run().outcome is Outcome.NEVER_DETECTED
    return recorder


def exposed(recorder: MemoryRecorder) -> dict[int, CameraWindow]:
    """The first window of every frame that reached the robot, by the frame's number."""
    windows = [m for _, _, m in recorder.messages if isinstance(m, CameraWindow)]
    return {w.exposure.frame: w for w in reversed(windows)}


def without_camera(recorder: MemoryRecorder) -> list[tuple[str, int, object]]:
    """The messages that do not depend on a camera that detects nothing."""
    return [m for m in recorder.messages if m[0].startswith(("/sensors/", "/truth/", "/control/"))]


def test_a_random_stream_that_is_switched_off_changes_no_other(shipped: Load) -> None:
    clean = searching(shipped, noise="0", dropout="0")
    noisy = searching(shipped, noise="8", dropout="0")
    lossy = searching(shipped, noise="8", dropout="0.4")
    quiet = searching(shipped, noise="0", dropout="0.4")
    expected = texts(without_camera(clean))
    assert len(expected) > 80
    assert any(isinstance(m, WheelOdometry) for _, _, m in without_camera(clean))
    assert all(texts(without_camera(other)) == expected for other in (noisy, lossy, quiet))
    # Frame loss does not depend on noise, and the noise of a frame does not depend on lost frames.
    assert exposed(lossy).keys() == exposed(quiet).keys() < exposed(noisy).keys() == exposed(clean).keys()
    for frame, window in exposed(lossy).items():
        np.testing.assert_array_equal(window.pixels, exposed(noisy)[frame].pixels)
        assert (window.pixels != exposed(clean)[frame].pixels).mean() > 0.5


def test_a_trial_leaves_nothing_in_the_temporary_folder(
    shipped: Load, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    assert run_trial(shipped("short_time", {"time_limit_s": "0.2"}), SEED).outcome is Outcome.TIMEOUT
    assert list(tmp_path.iterdir()) == []
