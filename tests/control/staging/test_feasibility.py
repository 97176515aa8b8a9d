from __future__ import annotations

import pytest

from msrr_control.docking.controller import build_controller, promised_speed
from msrr_control.docking.law import DockSetup
from msrr_control.staging.feasibility import check_assembly, check_overhead, check_time
from msrr_control.staging.setup import AssemblySetup
from msrr_scenes.errors import SceneError
from msrr_scenes.loading.load import load_scene
from msrr_scenes.specs.scene import Scene

WORLD = """
name: from_afar
units:
  b: {number: 1, pose: {x_m: 1.2, yaw_deg: %s}}
  a: {number: 0, pose: {x_m: -1.2, y_m: 0.3}}
cameras: {overhead: {height_m: 3.5}}
obstacles:
  crate: {shape: cylinder, radius_m: 0.08, tag_id: 500, pose: {x_m: %s, y_m: %s, spread: {x_m: %s}}}
plan:
  - {unit: a, to: b.rear}
"""


@pytest.mark.parametrize(
    ("yaw", "x", "y", "spread", "says"),
    [
        (0, 0.0, 0.8, 0.0, None),
        (0, 0.35, 0.0, 0.0, "crate stands on the place in front of b.rear"),
        (0, 0.35, 0.0, 0.3, None),
        (180, 0.0, 0.0, 0.0, None),
        (150, 0.0, 0.0, 0.0, None),
    ],
)
def test_scenes_are_checked_before_they_run(tmp_path, yaw, x, y, spread, says: str | None) -> None:
    path = tmp_path / "from_afar.yaml"
    path.write_text(WORLD % (yaw, x, y, spread))
    scene = load_scene(path)
    if says is None:
        check_assembly(scene)
    else:
        with pytest.raises(SceneError, match=says):
            check_assembly(scene)


def test_a_port_that_faces_the_border_is_refused(tmp_path) -> None:
    path = tmp_path / "from_afar.yaml"
    path.write_text((WORLD % (180, 0.0, 0.0, 0.0)).replace("x_m: 1.2,", "x_m: 1.7,"))
    with pytest.raises(SceneError, match=r"lies outside the arena; .*route\.handover_m$"):
        check_assembly(load_scene(path))


@pytest.mark.parametrize(("yaw_deg", "side"), [(0, 0), (180, 1), (90, 2), (270, 3)])
def test_a_place_may_lie_outside_by_what_its_port_is_drawn_anew(yaw_deg: int, side: int) -> None:
    """The port faces each border in turn; the place in front of it is 0.8 m behind the middle of `b`."""

    def scene(x: float, y: float) -> Scene:
        spread = {"x_m": 0.06, "y_m": 0.08}  # 0.1 m in all
        b = {"number": 1, "pose": {"x_m": x, "y_m": y, "yaw_deg": yaw_deg, "spread": spread}}
        a = {"number": 0, "pose": {"x_m": 0.9 if side < 2 else -0.9, "y_m": 0.9}}
        return Scene.model_validate(
            {
                "name": "beside_the_border",
                "units": {"a": a, "b": b},
                "cameras": {"overhead": {"height_m": 3.5}},
                "plan": [{"unit": "a", "to": "b.rear"}],
            }
        )

    sample = scene(0.0, 0.0)
    box = AssemblySetup.of(sample, sample.docks[0]).box
    outwards = -1.0 if side % 2 == 0 else 1.0
    for off, says in ((0.09, None), (0.11, "lies outside")):
        at = box[side] + outwards * (off - 0.8)
        tried = scene(at, 0.0) if side < 2 else scene(0.0, at)
        if says is None:
            check_assembly(tried)
        else:
            with pytest.raises(SceneError, match=says):
                check_assembly(tried)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"units.b.pose.spread.x_m": "0.25"}, None),  # the port may be drawn elsewhere
        ({"units.b.pose.spread.x_m": "0.1"}, "stands on the place"),
        ({"obstacles.crate.appears_at_s": "1"}, None),
        ({"obstacles.crate.pose": "{frame: b.rear, x_m: -0.6}"}, "stands on the place"),
        ({"obstacles.crate.pose": "{frame: b.rear, x_m: -0.4}"}, None),
        ({"units.b.pose": "{x_m: 1.2, y_m: 0.3}"}, None),
        ({"units.b.pose.spread.yaw_deg": "12"}, None),  # and turned, by 0.21 m
        ({"units.b.pose.spread.yaw_deg": "6"}, "stands on the place"),  # by 0.10 m
        # An obstacle is drawn with the unit that it stands before.
        ({"obstacles.crate.pose": "{frame: b.rear, x_m: -0.7}", "units.b.pose.spread.x_m": "0.1"}, None),
        (
            {"units.a.pose": "{x_m: 0.4}", "obstacles.crate.pose": "{y_m: 0.9}"},
            None,
        ),  # who docks stands there
    ],
)
def test_an_obstacle_stands_on_the_place_wherever_both_are_drawn(
    tmp_path, change: dict[str, str], says: str | None
) -> None:
    path = tmp_path / "from_afar.yaml"
    path.write_text(WORLD % (0, 0.35, 0.0, 0.0))
    scene = load_scene(path, change)
    if says is None:
        check_assembly(scene)
    else:
        with pytest.raises(SceneError, match=says):
            check_assembly(scene)


def test_a_place_that_the_overhead_camera_does_not_see_is_refused() -> None:
    """The arena is wider than the picture, and the place in front of b.left lies between their borders."""
    scene = Scene.model_validate(
        {
            "name": "unseen",
            "arena": {"x_m": [-2.0, 2.0], "y_m": [-1.6, 1.6]},
            "units": {"a": {"number": 0, "pose": {"x_m": -1.0}}, "b": {"number": 1, "pose": {"y_m": 0.7}}},
            "cameras": {"overhead": {}},
            "plan": [{"unit": "a", "to": "b.left"}],
        }
    )
    with pytest.raises(SceneError, match=r"outside the picture of the overhead camera.*height_m"):
        check_assembly(scene)


@pytest.mark.parametrize("name", ["two_units", "assemble_tee"])
def test_pictures_from_above_are_newer_than_what_a_unit_drives_by(name: str) -> None:
    """A unit that is last seen so long ago stands still, and was said not to be localised."""
    late = {"cameras.overhead.latency_ms": "1000"}
    with pytest.raises(SceneError, match=r"watch\.stale_s: .* up to 1\.1 s ago, .* found 1$"):
        check_overhead(load_scene(name, late))
    check_overhead(load_scene(name, {**late, "control.assembly.params.watch.stale_s": "1.2"}))
    check_overhead(load_scene(name))
    check_overhead(load_scene("close_range"))


@pytest.mark.parametrize(("assembly", "least_s"), [("c1", 30), ("mypkg.control:MyAssembler", 11)])
def test_a_phase_of_a_users_own_may_drive_as_fast_as_the_drive_can(assembly: str, least_s: int) -> None:
    """The ways of `three_units` are 1.6 m and 2.5 m, and the drive makes 0.4 m/s."""
    scene = load_scene("three_units", {"time_limit_s": "1", "control.assembly": assembly})
    with pytest.raises(SceneError, match=f"the whole plan {least_s} s"):
        check_time(scene)


def test_the_least_time_of_a_plan_is_that_of_its_ways() -> None:
    """Two units start 0.7 m before their ports, of which only the way to the seat and the lock take time."""
    pose = {"x_m": -0.7}
    scene = Scene.model_validate(
        {
            "name": "both_near",
            "units": {
                "b": {"number": 1},
                "a": {"number": 0, "pose": {"frame": "b.rear", **pose}},
                "c": {"number": 2, "pose": {"frame": "b.left", **pose}},
            },
            "plan": [{"unit": "a", "to": "b.rear"}, {"unit": "c", "to": "b.left"}],
        }
    )
    setup = DockSetup.of(scene, scene.docks[0])
    speed = promised_speed(build_controller(scene.control.docking, setup), setup.limits)
    assert speed is not None
    least_s = 2.0 * (0.7 / speed + scene.lock.close_time_s)
    for off, fits in ((0.01, True), (-0.01, False)):
        tried = scene.model_copy(update={"time_limit_s": least_s + off})
        if fits:
            check_time(tried)
        else:
            with pytest.raises(SceneError, match="raise it, or leave out a step"):
                check_time(tried)
