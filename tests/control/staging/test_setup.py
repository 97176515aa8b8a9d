from dataclasses import replace

import pytest

from msrr_control.staging.setup import AssemblySetup
from msrr_scenes.errors import SceneError
from msrr_scenes.loading.load import load_scene


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
    assert setup.box == (*scene.arena.x_m, *scene.arena.y_m)
    setup.check(0.22, 0.5, 0.1)


@pytest.mark.parametrize(
    ("changes", "args", "says"),
    [
        ({"offset": -0.1}, (0.22, 0.5, 0.1), "ahead of the axle"),
        ({}, (0.39, 0.5, 0.1), "three quarters"),
        ({"obstacle_radius": {"fence": 0.8}}, (0.22, 0.5, 0.1), "fence has a radius of 0.80 m"),
        ({}, (0.22, 0.5, 1.5), "cannot move in it"),
    ],
)
def test_what_cannot_work_anywhere_is_refused(setup: AssemblySetup, changes, args, says: str) -> None:
    with pytest.raises(SceneError, match=says):
        replace(setup, **changes).check(*args)
