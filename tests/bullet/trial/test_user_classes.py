"""Classes of a user's own in the loop: when one fails, the unit stops, and the trial says which and where."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from msrr_bullet.log import TruePose, read_log
from msrr_bullet.replay.comparison import ReplayError
from msrr_bullet.replay.log_replay import replay
from msrr_bullet.run import run_trial
from msrr_bullet.trial.check import check_trial
from msrr_bullet.trial.result import TrialResult
from msrr_bullet.trial.trial import Trial
from msrr_scenes.errors import SceneError
from msrr_scenes.loading.load import load_scene
from msrr_scenes.messages import Action, Twist
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.scene import Scene

SEED = 1
Load = Callable[..., Scene]

#: Shipped implementations under names of a user's own, and failures in the middle of an approach.
CLASSES = """
import math
from dataclasses import replace

import numpy as np

from msrr_bullet.render.raster_renderer import RasterRenderer
from msrr_control.docking.barrier import BarrierLaw, BarrierParams
from msrr_control.docking.controller import LawController
from msrr_control.path_following.c1 import C1PathFollowingLaw
from msrr_control.staging.parameters import AssemblyParams
from msrr_control.staging.state_machine import LongDistanceAssembler
from msrr_perception.detection.detector import PupilDetector
from msrr_perception.estimation.corner_filter import CornerEkf
from msrr_scenes.geometry.se2 import SE2


class Controller(LawController):
    def __init__(self, setup):
        super().__init__(BarrierLaw(BarrierParams(), setup))


class Assembler(LongDistanceAssembler):
    def __init__(self, setup):
        params = AssemblyParams()
        super().__init__(params, setup, C1PathFollowingLaw(params, setup.limits, setup.offset))


Detector, Estimator, Renderer = PupilDetector, CornerEkf, RasterRenderer


class Failing:
    FAILS_AFTER = 15
    calls = 0

    def late(self):
        self.calls += 1
        return self.calls > self.FAILS_AFTER


class NoCommand(Failing, Controller):
    def step(self, inputs):
        return None if self.late() else super().step(inputs)


class Raising(Failing, Controller):
    def step(self, inputs):
        if self.late():
            raise KeyError("gain")  # the line that is to be named
        return super().step(inputs)


class LateLaw(Failing, BarrierLaw):
    def step(self, state, inputs, dt):
        command, state = super().step(state, inputs, dt)
        return (command[None] if self.late() else command), state


class RowsCommand(LawController):
    def __init__(self, setup):
        super().__init__(LateLaw(BarrierParams(), setup))


class Leaving(Failing, Controller):
    def reset(self, inputs):
        raise SystemExit(0)


class Unbuildable(Failing, Controller):
    def __init__(self, setup):
        raise OSError("no such device")


class NoPose(Failing, Estimator):
    def estimate(self, now_ns):
        pose = super().estimate(now_ns)
        return replace(pose, X_DU=SE2(math.nan, 0.0, 0.0)) if pose and self.late() else pose


class Ahead(Failing, Estimator):
    def estimate(self, now_ns):
        pose = super().estimate(now_ns)
        return replace(pose, last_seen_ns=now_ns + 2 * 10**9) if pose and self.late() else pose


class AheadPrediction(Failing, Estimator):
    def predict(self, stamp_ns):
        pose = super().predict(stamp_ns)
        return replace(pose, stamp_ns=stamp_ns + 2 * 10**9) if pose and self.late() else pose

    def estimate(self, now_ns):
        return super().predict(now_ns)


class NoReading(Failing, Estimator):
    FAILS_AFTER = 150

    def add_odometry(self, reading):
        super().add_odometry(replace(reading, left=math.nan) if self.late() else reading)


class NoFilter(Failing, Estimator):
    def add_pose(self, measurement):
        if self.late():
            np.linalg.inv(np.zeros((3, 3)))
        super().add_pose(measurement)


class WritingController(Failing, Controller):
    def step(self, inputs):
        if self.late():
            inputs.pose.covariance[0, 0] = 0.0
        return super().step(inputs)


class WritingEstimator(Failing, Estimator):
    def add_pose(self, measurement):
        if self.late():
            measurement.covariance[:] *= 2.0
        super().add_pose(measurement)


class WritingFilter(Failing, Estimator):
    FAILS_AFTER = 6

    def add_detections(self, detections):
        if self.late():
            detections.tags[0].corners[:] += 1.0
        super().add_detections(detections)


class WritingMap(Failing, Estimator):
    FAILS_AFTER = 6

    def __init__(self, target, odometry, delay_compensation):
        super().__init__(target, odometry, delay_compensation)
        self.target = target

    def add_detections(self, detections):
        if self.late():
            self.target.corners_D[detections.tags[0].tag_id][:] += 0.01
        super().add_detections(detections)


class WritingDetector(Failing, Detector):
    FAILS_AFTER = 6

    def detect(self, pixels, window):
        if self.late():
            pixels[:] = 0
        return super().detect(pixels, window)


class WritingAssembler(Failing, Assembler):
    def step(self, observation):
        if self.late():
            observation.arena.own.covariance[:] = 0.0
        return super().step(observation)


class Blind(Failing, Detector):
    FAILS_AFTER = 6

    def detect(self, pixels, window):
        return None if self.late() else super().detect(pixels, window)


class HalfTurned(Detector):
    def detect(self, pixels, window):
        tags = super().detect(pixels, window)
        return tuple(replace(tag, corners=tag.corners[[2, 3, 0, 1]].copy()) for tag in tags)


class Mirrored(Blind):
    def detect(self, pixels, window):
        tags = PupilDetector.detect(self, pixels, window)
        return tuple(replace(tag, corners=tag.corners[::-1]) for tag in tags) if self.late() else tags


class Torn(Failing, Renderer):
    FAILS_AFTER = 6

    def render(self, camera, X_WC, window):
        image = super().render(camera, X_WC, window)
        return image[1:] if self.late() else image


class OneInstant:
    def __init__(self, context):
        self.inner = Renderer(context)

    def render(self, camera, X_WC, window):
        return self.inner.render(camera, X_WC, window)


class NoImages(Renderer):
    def render_instants(self, camera, views, distortion=None):
        return []


class TornImages(Renderer):
    def render_instants(self, camera, views, distortion=None):
        return [image[1:] for image in super().render_instants(camera, views, distortion)]


class NoRenderer(Failing, Renderer):
    def __init__(self, context):
        raise OSError("no such device")


class NoProgress(Failing, Assembler):
    def step(self, observation):
        decision = super().step(observation)
        self.progress = "soon" if self.late() else self.progress
        return decision


class NoRoute(Failing, Assembler):
    def step(self, observation):
        return math.nan if self.late() else super().step(observation)
"""

RAISING_LINE = 1 + CLASSES.splitlines().index(
    '            raise KeyError("gain")  # the line that is to be named'
)

#: What numpy says of an array that may not be written.
READ_ONLY = "is read-only"

#: Extension point -> key of a scene.
KEYS = {
    "controller": "control.docking",
    "assembler": "control.assembly",
    "detector": "control.detector",
    "estimator": "control.estimator",
    "renderer": "cameras.onboard.renderer",
}


@pytest.fixture(autouse=True)
def in_the_folder_of_the_classes(
    tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Stand in a folder with the module, which is not on the path."""
    folder = tmp_path_factory.mktemp("classes")
    (folder / "users_classes.py").write_text(CLASSES)
    monkeypatch.chdir(folder)
    monkeypatch.delitem(sys.modules, "users_classes", raising=False)  # of another folder


def test_tags_that_are_read_but_agree_with_no_pose_are_told_from_none(shipped: Load) -> None:
    """As on a robot whose tags are glued on by half a turn, or with corners in another order."""
    brief = {"docking.attempts": "1", "docking.search_time_s": "1"}
    turned, blind = (
        Trial(shipped("close_range", {**overrides, **brief}), SEED).run()
        for overrides in (
            {"control.detector": "users_classes:HalfTurned"},
            {"cameras.onboard.dropout": "1"},
        )
    )
    assert turned.reason.startswith("no pose agrees with the tags that were read")
    assert blind.reason.startswith("no marker seen")
    assert (turned.outcome, blind.outcome) == (Outcome.GAVE_UP, Outcome.NEVER_DETECTED)


@pytest.mark.nightly
def test_guards_change_nothing_in_a_trial(shipped: Load) -> None:
    """Shipped implementations give the same trial, bit for bit, under names of a user's own."""
    near = {"time_limit_s": "4"}
    far = {"plant": "unicycle", "perception": "parametric", "time_limit_s": "6"}
    for name, overrides, idle in (
        ("close_range", near, {"assembler"}),
        ("two_units", far, {"detector", "renderer"}),
    ):
        own = {key: f"users_classes:{kind.title()}" for kind, key in KEYS.items() if kind not in idle}
        shipped_result, own_result = (
            Trial(shipped(name, {**overrides, **named}), SEED).run() for named in ({}, own)
        )
        assert own_result.model_copy(update={"scene_hash": ""}) == shipped_result.model_copy(
            update={"scene_hash": ""}
        )


def _careful(name: str) -> Scene:
    """A second of an approach whose camera exposes for 10 ms and distorts."""
    return load_scene("close_range", {KEYS["renderer"]: name, "time_limit_s": "1"})


def test_a_renderer_of_one_s_own_draws_exposures_and_distortion() -> None:
    """Only the shipped one might, so that a renderer of one's own went with perfect calibration alone."""
    shipped, own = (Trial(_careful(name), SEED).run() for name in ("raster", "users_classes:Renderer"))
    assert own.model_copy(update={"scene_hash": ""}) == shipped.model_copy(update={"scene_hash": ""})
    assert shipped.steps[0].attempts[-1].believed is not None, "the pixels were read"


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("NoImages", r"render_instants returned \[\]; expected a list of \d+ images, one for each window"),
        ("TornImages", r"render_instants returned an array of uint8 of shape .* expected uint8 of shape"),
    ],
)
def test_the_images_of_an_exposure_are_checked(name: str, says: str) -> None:
    result = Trial(_careful(f"users_classes:{name}"), SEED).run()
    assert result.outcome is Outcome.PROGRAM_FAILED
    assert re.search(says, result.steps[0].belief_reason)


def test_a_renderer_without_the_method_that_a_camera_needs_is_refused() -> None:
    own = "users_classes:OneInstant"
    with pytest.raises(SceneError, match=r"cameras\.onboard\.renderer: .* no method render_instants"):
        check_trial(_careful(own))
    check_trial(load_scene("close_range", {KEYS["renderer"]: own, "as_built": "perfect"}))


@pytest.mark.parametrize(
    ("kind", "name", "says"),
    [
        ("controller", "NoCommand", "step returned None; expected a Twist"),
        ("controller", "Raising", f"users_classes.py line {RAISING_LINE}: step raised KeyError: 'gain'"),
        ("controller", "RowsCommand", "LateLaw.step returned a command of shape (1, 2); expected (2,)"),
        ("controller", "Leaving", "reset raised SystemExit: 0"),
        ("controller", "Unbuildable", "__init__ raised OSError: no such device"),
        ("estimator", "NoPose", "expected a pose of finite numbers"),
        ("estimator", "Ahead", "estimate returned a last_seen_ns that is 2.000 s in the future"),
        ("estimator", "AheadPrediction", "predict returned a stamp_ns that is 2.000 s ahead of the instant"),
        ("estimator", "NoReading", "estimate returned SE2(x=nan, y=nan, yaw=nan); expected a pose of finite"),
        ("estimator", "NoFilter", "raised numpy.linalg.LinAlgError: Singular matrix"),
        ("detector", "Blind", "detect returned None; expected a tuple of TagDetections"),
        ("detector", "Mirrored", "expected corners in the order bottom left"),
        ("renderer", "Torn", "render returned an array of uint8 of shape"),
        ("renderer", "NoRenderer", "__init__ raised OSError: no such device"),
        ("assembler", "NoProgress", "progress returned 'soon'; expected AssemblyProgress or None"),
        ("assembler", "NoRoute", "step returned nan; expected a Twist, a GiveUp or None"),
        ("controller", "WritingController", READ_ONLY),
        ("estimator", "WritingEstimator", READ_ONLY),
        ("estimator", "WritingFilter", READ_ONLY),
        ("estimator", "WritingMap", READ_ONLY),
        ("detector", "WritingDetector", READ_ONLY),
        ("assembler", "WritingAssembler", READ_ONLY),
    ],
)
@pytest.mark.usefixtures("undrawn_runs")
def test_a_failure_stops_the_unit_and_ends_the_trial(
    kind: str, name: str, says: str, shipped: Load, tmp_path: Path
) -> None:
    """All of these ended in a traceback that asked to be reported, or drove on.

    Those that write into what they are given would change what the log and the rest of the robot have.
    """
    pixels = kind in ("detector", "renderer") or name in ("WritingFilter", "WritingMap")
    overrides = {KEYS[kind]: f"users_classes:{name}"}
    scene = shipped("two_units" if kind == "assembler" else "close_range", overrides, blind=not pixels)
    result = run_trial(scene, SEED, out=tmp_path)
    (step,) = result.steps
    assert (result.outcome, step.belief, result.docked) == (Outcome.PROGRAM_FAILED, "undecided", False)
    assert step.belief_reason.startswith(f"{kind} 'users_classes:{name}', users_classes.py line ")
    assert says in step.belief_reason
    assert TrialResult.from_json((tmp_path / "result.json").read_text()) == result

    log = read_log(tmp_path)
    assert log.complete
    actions = [action for _, action in log.messages(Action)]
    assert actions[-1].twist == Twist()
    assert actions[-1].reason == step.belief_reason
    if name not in ("Leaving", "Unbuildable", "NoRenderer"):
        assert any(abs(a.twist.v) + abs(a.twist.w) > 0.01 for a in actions), "it was under way"
    stand = [pose for _, pose in log.messages(TruePose, "/truth/a/pose")][-5:]
    assert max(abs(p.X_WB.x - stand[-1].X_WB.x) for p in stand) < 1e-4, "and it has come to rest"

    report = replay(tmp_path, trust=True)
    assert report.mismatches == ()
    assert report.identical
    if kind == "renderer":  # a replay builds none
        assert replay(tmp_path).identical
    else:
        with pytest.raises(ReplayError, match=f"users_classes:{name} by import path.* --trust"):
            replay(tmp_path)
