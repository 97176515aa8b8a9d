"""Checks of the start poses: each contradiction is found, placed and mended, and nothing else is."""

import re
import time
from collections.abc import Mapping
from pathlib import Path

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
        ({"units.a.pose": "{frame: b.rear, x_m: -0.03}"}, "units.a.pose", "stands 0.012 m from 'b'"),
        ({"judge.min_clearance_m": "0.5"}, "obstacles.post.pose", "nearer than judge.min_clearance_m = 0.5"),
        (
            {"obstacles.post.pose": "{x_m: 0.4, y_m: -0.175}"},
            "obstacles.post.pose",
            "stands 0.015 m from 'b'",
        ),
        (  # b is where it was
            {"obstacles.post.pose": "{x_m: 0.45}", "obstacles.post.appears_at_s": "5"},
            "obstacles.post.pose",
            "overlaps 'b'",
        ),
        (
            {"obstacles.post.pose": "{x_m: 0.4, y_m: -0.175}", "obstacles.post.appears_at_s": "5"},
            "obstacles.post.pose",
            "stands 0.015 m from 'b'",
        ),
        ({"obstacles.post.height_m": "3"}, "obstacles.post.height_m", "raise cameras.overhead.height_m"),
        (  # the plate of its tag is 2 mm thick
            {"obstacles.post.height_m": "2.499", "cameras.overhead.height_m": "2.5"},
            "obstacles.post.height_m",
            "found 2.501",
        ),
        (
            {"units.c.frames": "{tag_top: {link: tag_top, z_m: -0.4}}", "cameras.overhead.height_m": "0.6"},
            "units.c.urdf",
            "reaches up to the overhead camera at 0.6 m, found 0.63",
        ),
        (  # c moves with a
            {"units.c.pose": "{frame: a.left, x_m: -0.2}", "obstacles.post.pose": "{x_m: -0.5, y_m: 0.4}"},
            "obstacles.post.pose",
            "overlaps 'c' for some start within its spread",
        ),
        ({"obstacles.post.pose.x_m": "1e15"}, "obstacles.post.pose.x_m", "less than or equal to 100"),
        ({"units.c.pose.x_m": "-99"}, "units.c.pose", "outside the arena"),
        ({"los.half_width_m": "0.08"}, "los.half_width_m", "move the tags: nearer together"),
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
        {"obstacles.post.pose": "{frame: a.front}", "obstacles.post.appears_at_s": "5"},  # a is gone by then
        {"units.c.pose.frame": "a.left", "units.c.pose.x_m": "-0.2", "units.c.pose.y_m": "0"},  # moves with a
        {"cameras.overhead": "null", "units.c.pose": "{x_m: 0.9, y_m: 0.3}"},  # in the view of a
        {"obstacles.wall": "{shape: cylinder, radius_m: 0.06, pose: {x_m: 0.125, y_m: -0.45}}"},  # 5 mm apart
    ],
)
def test_what_is_allowed(overrides: Mapping[str, str]) -> None:
    load_scene("bystander", overrides)


@pytest.mark.parametrize(
    ("pose", "says"), [({"units.a.pose.yaw_deg": "60"}, "turn it"), ({"units.c.pose.y_m": "1.45"}, "outside")]
)
def test_one_problem_of_a_unit_is_enough(pose: Mapping[str, str], says: str) -> None:
    """Nobody sees it either, which is told of others."""
    (unit,) = (key.split(".")[1] for key in pose)
    with pytest.raises(SceneError) as caught:
        load_scene("bystander", {**pose, "cameras.overhead": "null"})
    (told,) = (line for line in str(caught.value).splitlines() if f"units.{unit}.pose: " in line)
    assert says in told


def test_each_way_out_of_a_target_that_is_too_wide_is_wide_enough() -> None:
    wide = {"los.half_width_m": 0.08}
    with pytest.raises(SceneError, match="too wide for the cone") as caught:
        load_scene("bystander", wide)
    widest, ahead, now = map(float, re.findall(r"(\d\.\d{4}) m", str(caught.value)))
    setback = load_scene("bystander").los.setback_m
    for factor, fits in ((1.01, True), (0.99, False)):
        for way in (
            {"los.half_width_m": widest / factor},
            {**wide, "los.setback_m": setback + factor * ahead - now},
        ):
            if fits:
                load_scene("bystander", way)
            else:
                with pytest.raises(SceneError, match="too wide for the cone"):
                    load_scene("bystander", way)


@pytest.mark.parametrize(
    ("camera", "says"),
    [
        ("{link: camera, y_m: 0.02}", ""),
        ("{link: camera, yaw_deg: 8}", ""),
        (
            "{link: camera, y_m: 0.06}",
            r"camera is 60 mm beside the x axis .* by 0 deg, .* edge of b.rear at 3",
        ),
        ("{link: camera, yaw_deg: 20}", r"camera is 0 mm beside .* by 20 deg, .* edge of b.rear at 3"),
    ],
)
def test_a_camera_beside_the_axis_sees_the_target_within_the_cone_at_contact(camera: str, says: str) -> None:
    """The line-of-sight correction takes a robot aside that sees it farther out."""
    frames = {"units.a.frames": f"{{camera: {camera}}}"}
    if not says:
        load_scene("close_range", frames)
        return
    with pytest.raises(SceneError, match=rf"units.a.urdf: unit.urdf: the {says}"):
        load_scene("close_range", frames)


def test_a_start_that_hardly_ever_sees_its_target_is_refused() -> None:
    """A trial of it would draw starts until it gives up, with some seeds."""
    narrow = {"los.half_width_m": "0.015", "los.inner_deg": "6.2", "los.outer_deg": "6.5"}
    with pytest.raises(SceneError, match="narrow the spreads"):
        load_scene("close_range", {**narrow, "units.a.pose.spread.yaw_deg": "180"})
    load_scene("close_range", narrow)


def test_fifty_units_are_checked_in_a_moment() -> None:
    """6,000 units took a minute; 50 are the most, and each pair of them is looked at."""
    units = {
        f"u{i}": f"{{number: {i}, pose: {{x_m: {0.6 * (i % 10)}, y_m: {0.6 * (i // 10)}}}}}"
        for i in range(50)
    }
    body = ", ".join(f"{name}: {unit}" for name, unit in units.items())
    wide = {"arena": "{x_m: [-9, 9], y_m: [-9, 9]}", "cameras.overhead": "{height_m: 20, width_px: 4096}"}
    begun = time.process_time()
    scene = load_scene("close_range", {**wide, "units": f"{{{body}}}", "plan": "[{unit: u0, to: u49.rear}]"})
    assert len(scene.units) == 50
    assert time.process_time() - begun < 5.0
    with pytest.raises(SceneError, match="at most 50 entries, found 51"):
        load_scene("close_range", {"units": f"{{{body}, b: {{number: 1}}}}"})


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


@pytest.mark.parametrize(("k1", "seen_m", "unseen_m"), [(-0.15, 1.9, 2.1), (0.3, 1.5, 1.7)])
def test_a_unit_is_seen_from_above_where_the_lens_shows_it(
    tmp_path: Path, k1: float, seen_m: float, unseen_m: float
) -> None:
    """A barrel lens shows more of the floor than the ideal camera of its focal length, a pincushion less."""
    path = tmp_path / "scene.yaml"
    for x_m in (seen_m, unseen_m):
        path.write_text(
            "arena: {x_m: [-3, 3], y_m: [-3, 3]}\n"
            "cameras: {overhead: {calibration: {fx_px: 966.9, fy_px: 966.9, cx_px: 639.5, cy_px: 479.5,"
            f" k1: {k1}, k2: {0.02 if k1 < 0.0 else 0.0}}}}}}}\n"
            f"units: {{a: {{number: 0, pose: {{x_m: -{x_m}}}}}, b: {{number: 1, pose: {{x_m: 0.5}}}}}}\n"
            "plan: [{unit: a, to: b.rear}]\n"
        )
        if x_m == seen_m:
            load_scene(path)
        else:
            with pytest.raises(SceneError, match="out of the overhead view"):
                load_scene(path)
