"""Checks of the start poses: each contradiction is found, placed and mended, and nothing else is."""

from collections.abc import Mapping

import pytest

from msrr_scenes import load_scene
from msrr_scenes.errors import SceneError


@pytest.mark.parametrize(
    ("overrides", "place", "mend"),
    [
        ({"obstacles.post.pose": "{x_m: 0.45}"}, "obstacles.post.pose", "overlaps 'b'"),
        ({"units.a.pose.x_m": "-0.02"}, "units.a.pose", "overlaps 'b' for some start within its spread"),
        ({"units.c.pose.y_m": "1.45"}, "units.c.pose", "enlarge the arena"),
        ({"arena.x_m": "[-0.5, 2]"}, "units.a.pose", "for some start within its spread"),
        ({"cameras.overhead": "null"}, "units.c.pose", "no camera sees this unit"),
        ({"cameras.overhead.x_m": "3"}, "units.c.pose", "out of the overhead view"),
        ({"units.a.pose.yaw_deg": "60"}, "units.a.pose", "turn it towards the port"),
        ({"los.half_width_m": "0.08"}, "los.half_width_m", "lower half_width_m below 0.05"),
    ],
)
def test_starts_that_contradict_each_other(overrides: Mapping[str, str], place: str, mend: str) -> None:
    with pytest.raises(SceneError) as caught:
        load_scene("bystander", overrides)
    assert f": {place}: " in str(caught.value)
    assert mend in str(caught.value)


@pytest.mark.parametrize(
    "overrides",
    [
        {"lock.strength_n": "1"},  # weaker than the pull: a trial that ends in lock_failed
        {"obstacles.post.pose": "{x_m: 0.45}", "obstacles.post.appears_at_s": "5"},  # not there at the start
        {"units.c.pose.frame": "a.left", "units.c.pose.x_m": "-0.2", "units.c.pose.y_m": "0"},  # moves with a
        {"cameras.overhead": "null", "units.c.pose": "{x_m: 0.9, y_m: 0.3}"},  # in the view of a
    ],
)
def test_what_is_allowed(overrides: Mapping[str, str]) -> None:
    load_scene("bystander", overrides)


def test_a_unit_that_carries_another_is_compared_in_its_own_frame() -> None:
    # In the world the two regions overlap widely, but c hangs on a and cannot come nearer.
    scene = load_scene(
        "bystander",
        {
            "units.a.pose.spread": "{x_m: 0.05, y_m: 0.10, yaw_deg: 20}",
            "units.c.pose": "{frame: a.rear, x_m: -0.05}",
            "obstacles": "{}",
        },
    )
    assert scene.units["c"].pose.frame == "a.rear"
