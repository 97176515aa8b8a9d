import itertools
from dataclasses import replace

import numpy as np
import pytest

from msrr_control.staging.setup import AssemblySetup
from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.loading.load import load_scene
from msrr_scenes.specs.scene import Scene


@pytest.fixture(scope="module")
def setup() -> AssemblySetup:
    scene = load_scene("two_obstacles")
    return AssemblySetup.of(scene, scene.plan[0])


def test_the_facts_are_those_of_the_scene(setup: AssemblySetup) -> None:
    scene = load_scene("two_obstacles")
    step = scene.plan[0]
    assert (setup.unit, setup.target) == (step.unit, step.target_unit)
    assert setup.obstacle_radius == {name: o.radius_m for name, o in scene.obstacles.items()}
    assert set(setup.unit_radius) == set(scene.units)
    assert setup.unit_radius[step.unit] > setup.half_width > 0.0
    x0, x1, y0, y1 = setup.box
    assert scene.arena.x_m[0] <= x0 < x1 <= scene.arena.x_m[1]
    assert scene.arena.y_m[0] <= y0 < y1 <= scene.arena.y_m[1]
    setup.check(0.22, 0.5, 0.1)


@pytest.mark.parametrize(
    ("changes", "args", "says"),
    [
        ({"offset": -0.1}, (0.22, 0.5, 0.1), "ahead of the axle"),
        ({}, (0.39, 0.5, 0.1), "three quarters"),
        ({"obstacle_radius": {"fence": 0.8}}, (0.22, 0.5, 0.1), "fence: its radius is 0.80 m"),
        ({}, (0.22, 0.5, 1.5), "cannot move in it"),
    ],
)
def test_what_cannot_work_anywhere_is_refused(setup: AssemblySetup, changes, args, says: str) -> None:
    with pytest.raises(SceneError, match=says):
        replace(setup, **changes).check(*args)


def _arena(**cameras: object) -> Scene:
    return Scene.model_validate(
        {
            "name": "wide",
            "arena": {"x_m": [-2.0, 2.0], "y_m": [-1.5, 1.5]},
            "units": {"a": {"number": 0}, "b": {"number": 1, "pose": {"x_m": 1.0}}},
            "cameras": cameras,
            "plan": [{"unit": "a", "to": "b.rear"}],
        }
    )


_CALIBRATED = {"fx_px": 966.9, "fy_px": 966.9, "cx_px": 660.0, "cy_px": 529.5}


@pytest.mark.parametrize("yaw", [0.0, 0.4, 0.785, 2.0])
@pytest.mark.parametrize(
    "calibration", [None, _CALIBRATED, _CALIBRATED | {"k1": -0.15, "k2": 0.02}, _CALIBRATED | {"k1": 0.2}]
)
def test_the_top_tag_is_in_view_wherever_a_path_may_lead(
    yaw: float, calibration: dict[str, float] | None
) -> None:
    """At the corners of the box the lens shows every corner of the plate."""
    scene = _arena(overhead={"x_m": 0.1, "y_m": -0.05, "calibration": calibration})
    setup, camera = AssemblySetup.of(scene, scene.plan[0]), scene.cameras.overhead
    assert camera is not None
    X_WC = SE3(np.diag([1.0, -1.0, -1.0]), np.array([camera.x_m, camera.y_m, camera.height_m]))
    half = 0.5 * 1.25 * scene.tag_size(scene.plan[0].unit, "tag_top")
    plate = np.array([[i * half, j * half, 0.0] for i in (-1, 1) for j in (-1, 1)])
    X_UT = scene.geometry("a").frame("tag_top")
    x0, x1, y0, y1 = setup.box
    for x, y in itertools.product((x0, x1), (y0, y1)):
        corners = (SE3.from_se2(SE2(x, y, yaw)) @ X_UT).act(plate)
        assert camera.lens.sees(X_WC.inverse().act(corners)).all()
    assert (x0, x1, y0, y1) != (-2.0, 2.0, -1.5, 1.5), "the camera does not see the whole arena"


def test_a_camera_that_sees_the_whole_arena_takes_nothing_from_it() -> None:
    scene = _arena(overhead={"height_m": 4.0})
    assert AssemblySetup.of(scene, scene.plan[0]).box == (-2.0, 2.0, -1.5, 1.5)
