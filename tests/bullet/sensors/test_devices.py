"""The devices of a trial: which cameras a scene gets, and the state that they keep from step to step."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from msrr_bullet.profiler import NullProfiler
from msrr_bullet.sensors.camera_sensors import RenderedCameraSensor
from msrr_bullet.sensors.parametric_cameras import ParametricOnboardCamera, ParametricOverheadCamera
from msrr_bullet.trial.environment import open_environment
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import Detections, Exposure, Fetch
from msrr_scenes.specs.scene import Scene

Load = Callable[..., Scene]

#: Pose of the docking unit in the dock frame, half a metre in front of the port.
X_DU = SE2(-0.6, 0.02, 0.1)


class WindowReader:
    """A robot that keeps the pixels of one window of every exposure."""

    def __init__(self) -> None:
        self.frames: list[int] = []
        self.pixels: list[np.ndarray] = []

    def expose(self, exposure: Exposure, fetch: Fetch) -> Detections | None:
        self.frames.append(exposure.frame)
        self.pixels.append(fetch(Window(20, 20, 32, 24)))
        return Detections(exposure, (), ())


def environment_of(scene: Scene, seed: int = 0):
    return open_environment(scene, seed)


@pytest.mark.parametrize("blind", [False, True])
@pytest.mark.parametrize(("name", "number"), [("close_range", 1), ("two_units", 2)])
def test_a_step_gets_the_cameras_of_the_scene(shipped: Load, name: str, number: int, blind: bool) -> None:
    scene = shipped(name, blind=blind)
    step = scene.plan[0]
    with environment_of(scene) as environment:
        cameras = environment.devices.cameras(step, lambda: X_DU, NullProfiler())
    kinds = (
        (ParametricOverheadCamera, ParametricOnboardCamera)
        if blind
        else (RenderedCameraSensor, RenderedCameraSensor)
    )
    assert tuple(type(camera) for camera in cameras) == kinds[-number:]
    assert [camera.name for camera in cameras] == ["overhead", f"{step.unit}/onboard"][-number:]
    assert cameras[-1].spec is scene.cameras.onboard
    assert number == 1 or cameras[0].spec is scene.cameras.overhead


def test_a_rendered_camera_keeps_counting_frames_over_the_steps(shipped: Load) -> None:
    """Otherwise the second docking would have the image noise of the first one."""
    scene, reader = shipped("three_units"), WindowReader()
    with environment_of(scene) as environment:
        for step in scene.plan:
            overhead, _ = environment.devices.cameras(step, lambda: X_DU, NullProfiler())
            for _ in range(3):
                overhead.capture(environment.simulation.plant.now_ns(), reader)
    assert reader.frames == list(range(6))
    for i in range(6):
        for j in range(i):
            assert (reader.pixels[i] != reader.pixels[j]).mean() > 0.5


@pytest.mark.parametrize("camera", ["overhead", "onboard"])
def test_a_parametric_camera_continues_its_sequences_over_the_steps(shipped: Load, camera: str) -> None:
    scene = shipped("three_units", blind=True)
    with environment_of(scene) as environment:
        drawn = []
        for _ in range(2):
            cameras = environment.devices.cameras(scene.plan[0], lambda: X_DU, NullProfiler())
            drawn.append(cameras[0 if camera == "overhead" else 1].capture(0, WindowReader()))
    assert drawn[0]
    assert drawn[1]
    if camera == "overhead":
        assert all(a.X_WB != b.X_WB for a, b in zip(*drawn, strict=True))
    else:
        assert drawn[0][0].exposure.frame + 1 == drawn[1][0].exposure.frame
        assert drawn[0][0].X_DU != drawn[1][0].X_DU


def test_encoders_of_the_units_have_their_own_errors_given_by_the_seed(shipped: Load) -> None:
    scene = shipped("three_units", blind=True)
    scales = []
    for seed in (1, 1, 2):
        with environment_of(scene, seed) as environment:
            assert (
                environment.devices.encoders.keys() == environment.devices.links.keys() == scene.units.keys()
            )
            scales.append([encoders.scale for encoders in environment.devices.encoders.values()])
    assert scales[0] == scales[1]
    assert len({*scales[0], *scales[2]}) == 6


@pytest.mark.parametrize("wheel", ["left", "right"])
def test_an_encoder_is_stuck_from_the_time_that_the_scene_names(wheel: str, shipped: Load) -> None:
    """The other wheel, and those of other units, go on."""
    fault = f"{{kind: encoder_stuck, unit: a, wheel: {wheel}, from_s: 2}}"
    scene = shipped("three_units", {"faults": f"[{fault}]"}, blind=True)
    with environment_of(scene) as environment:
        encoders = environment.devices.encoders
    turned = {}
    for unit in ("a", "b"):
        readings = [encoders[unit].read((k, k), k * 1_000_000_000) for k in range(4)]
        turned[unit] = {
            side: np.diff([getattr(r, side) for r in readings]) > 0.5 for side in ("left", "right")
        }
    other = "right" if wheel == "left" else "left"
    assert turned["a"][wheel].tolist() == [True, False, False]
    for goes_on in (turned["a"][other], *turned["b"].values()):
        assert goes_on.all()
