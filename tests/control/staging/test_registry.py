from __future__ import annotations

import pytest

from msrr_control.staging.registry import ASSEMBLERS, build_assembler
from msrr_control.staging.setup import AssemblySetup
from msrr_scenes.errors import SceneError, UnknownNameError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.loading.load import load_scene
from msrr_scenes.specs.scene import ArenaSpec
from msrr_scenes.specs.spec import Choice
from msrr_scenes.specs.vehicle import LimitsSpec


def test_the_assembler_c2_is_built_from_a_scene() -> None:
    scene = load_scene("two_units", {"control.assembly": "{name: c2, params: {repulsion: {eta: 0.01}}}"})
    setup = AssemblySetup.of(scene, scene.plan[0])
    assembler = build_assembler(scene.control.assembly, setup)
    assert assembler.progress is None
    with pytest.raises(SceneError, match="controller 'c2'"):
        build_assembler(Choice(name="c2", params={"repulsion": {"eta": -1.0}}), setup)


HALF = 0.1  # the unit is a square


def make_setup(limits: str = "normal", **obstacles: float) -> AssemblySetup:
    return AssemblySetup(
        unit="a",
        target="b",
        offset=0.1,
        half_width=HALF,
        X_TD=SE2(-0.1, 0.0, 0.0),
        unit_radius={"a": 0.128, "b": 0.128, "c": 0.128},
        obstacle_radius=obstacles,
        arena=ArenaSpec(),
        limits=LimitsSpec.model_validate({"setting": limits}),
        rate_hz=50.0,
    )


@pytest.mark.parametrize(
    ("choice", "error", "says"),
    [
        (Choice(name="c3"), UnknownNameError, "Known: c1"),
        (Choice(name="c1", params={"envelop": False}), SceneError, "envelope"),
        (Choice(name="c1", params={"guidance": {"u_max_mps2": 0.1}}), SceneError, "less than u_max_mps2"),
        (Choice(name="c1", params={"pace": {"cruise_mps": 0.39}}), SceneError, "three quarters"),
        (Choice(name="c1", params={"route": {"border_m": 1.5}}), SceneError, "cannot move in it"),
    ],
)
def test_bad_choices_are_refused(choice: Choice, error: type[Exception], says: str) -> None:
    with pytest.raises(error, match=says):
        build_assembler(choice, make_setup())
    assert "c1" in ASSEMBLERS


def test_an_obstacle_that_no_circle_can_stand_for_is_refused() -> None:
    with pytest.raises(SceneError, match=r"obstacles\.fence has a radius of 0\.80 m"):
        build_assembler(Choice(name="c1"), make_setup(fence=0.8))
