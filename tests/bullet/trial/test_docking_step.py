"""Plans of several steps: what goes on from one to the next, and what a later step may undo."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from msrr_bullet.profiler import NullProfiler
from msrr_bullet.run import run_trial
from msrr_bullet.sweep.summary import summarise
from msrr_bullet.trial.docking_step import DockingStep
from msrr_bullet.trial.environment import open_environment
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.loading.load import load_scene
from msrr_scenes.messages import Detections, Exposure, Fetch
from msrr_scenes.outcome import Outcome
from msrr_scenes.placement.placement import draw_placement
from msrr_scenes.random_streams import stream
from msrr_scenes.specs.scene import Scene

Load = Callable[..., Scene]

#: Half a metre before the port, in the dock frame.
SEEN = SE2(-0.6, 0.02, 0.1)

IDEAL = {"plant": "unicycle", "perception": "parametric"}


class Keeper:
    """A reader that keeps the pixels of one window of every exposure."""

    def __init__(self) -> None:
        self.frames: list[int] = []
        self.pixels: list[np.ndarray] = []

    def expose(self, exposure: Exposure, fetch: Fetch) -> Detections | None:
        self.frames.append(exposure.frame)
        self.pixels.append(fetch(Window(20, 20, 32, 24)))
        return Detections(exposure, (), ())


def test_the_noise_of_a_step_is_not_that_of_the_step_before(shipped: Load) -> None:
    """A camera goes on counting its frames; else a second docking would meet the noise of the first again."""
    scene = shipped("three_units")
    keeper = Keeper()
    with open_environment(scene, 0, draw_placement(scene, lambda name: stream(0, name))) as environment:
        for step in scene.plan:
            overhead, _ = environment.devices.cameras(step, lambda: SEEN, NullProfiler())
            for _ in range(3):
                overhead.capture(environment.simulation.plant.now_ns(), keeper)
    assert keeper.frames == list(range(6))
    for i in range(6):
        for j in range(i):
            assert (keeper.pixels[i] != keeper.pixels[j]).mean() > 0.5


@pytest.mark.parametrize("camera", ["overhead", "onboard"])
def test_modelled_cameras_go_on_too(shipped: Load, camera: str) -> None:
    scene = shipped("three_units", IDEAL)
    with open_environment(scene, 0, draw_placement(scene, lambda name: stream(0, name))) as environment:
        drawn = []
        for _ in range(2):
            cameras = environment.devices.cameras(scene.plan[0], lambda: SEEN, NullProfiler())
            drawn.append(cameras[0 if camera == "overhead" else 1].capture(0, Keeper()))
    assert drawn[0]
    assert drawn[1]
    if camera == "overhead":
        assert all(a.X_WB != b.X_WB for a, b in zip(*drawn, strict=True))
    else:
        assert drawn[0][0].exposure.frame + 1 == drawn[1][0].exposure.frame
        assert drawn[0][0].X_DU != drawn[1][0].X_DU


def test_a_lock_that_opens_later_undoes_the_plan(shipped: Load, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first pair parts when the second step begins, and nothing else goes wrong."""
    begin = DockingStep.__init__

    def sabotaged(self, environment, index, *rest) -> None:
        begin(self, environment, index, *rest)
        if index == 1:
            environment.simulation.plant.set_lock("a", False)

    monkeypatch.setattr(DockingStep, "__init__", sabotaged)
    result = run_trial(shipped("three_units", IDEAL), 1)
    assert result.outcome is Outcome.LOCK_FAILED
    assert not result.docked


def test_attempts_are_counted_by_step(shipped: Load) -> None:
    scene = shipped("three_units", IDEAL)
    result = run_trial(scene, 1)
    assert result.outcome is Outcome.DOCKED
    assert [(record.step, record.attempt) for record in result.records] == [(0, 1), (1, 1)]
    summary = summarise(scene, "hash", "code", [result])
    assert summary.docked_by_attempt == {1: 1}, "docked at the first attempt, twice"


def test_done_in_the_last_instant_is_done_in_time(shipped: Load) -> None:
    free = run_trial(shipped("close_range", IDEAL), 1)
    limit = {"time_limit_s": repr(free.duration_s)}
    in_time = run_trial(shipped("close_range", {**IDEAL, **limit}), 1)
    assert (in_time.outcome, in_time.duration_s) == (Outcome.DOCKED, free.duration_s)


WITNESS = """
description: The target's tags are covered, and those of a third unit are in view.
units:
  b: {number: 1, pose: {x_m: 0.4}}
  a: {number: 0, pose: {frame: b.rear, x_m: -0.50}}
  c: {number: 2, pose: {x_m: 0.9, y_m: 0.25}}
faults: [{kind: marker_hidden, unit: b}]
docking: {attempts: 1, search_time_s: 1}
plan: [{unit: a, to: b.rear}]
"""


def test_somebody_elses_tags_are_not_the_target(tmp_path: Path) -> None:
    path = tmp_path / "witness.yaml"
    path.write_text(WITNESS)
    assert run_trial(load_scene(path), 1).outcome is Outcome.NEVER_DETECTED
