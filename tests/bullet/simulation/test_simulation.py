"""The simulated world of a trial: the parts that a scene needs, true poses, and the mounting of cameras."""

from __future__ import annotations

import itertools
import math
from pathlib import Path

import pybullet
import pytest

from msrr_bullet.built_poses import camera_pose
from msrr_bullet.plant.kinematic_plant import KinematicPlant
from msrr_bullet.render import RenderContext
from msrr_bullet.render.tiny_renderer import TinyRenderer
from msrr_bullet.simulation.bullet_plant import BulletPlant
from msrr_bullet.simulation.simulation import open_simulation
from msrr_bullet.simulation.tag_plates import plate_folder
from msrr_perception.detection.detector import PupilDetector
from msrr_scenes.as_built import as_designed
from msrr_scenes.geometry.pinhole import PinholeCamera
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.loading.load import load_scene
from msrr_scenes.messages import Twist
from msrr_scenes.placement.placement import Placement
from msrr_scenes.specs.scene import Scene

PLACEMENT = Placement(
    {"a": SE2(-0.5, 0.1, 0.3), "b": SE2(0.5, 0.0, 0.0)}, {"post": SE2(0.0, 1.0), "late": SE2(0.0, -1.0)}
)


def scene(plant: str, perception: str) -> Scene:
    return Scene.model_validate(
        {
            "name": "simulated",
            "plant": plant,
            "perception": perception,
            "units": {"a": {"number": 0}, "b": {"number": 1}},
            "obstacles": {
                "post": {"shape": "cylinder", "radius_m": 0.05},
                "late": {"shape": "cylinder", "radius_m": 0.05, "appears_at_s": 0.1},
            },
            "faults": [{"kind": "camera_misaligned", "unit": "a", "yaw_deg": 5.0}],
            "plan": [{"unit": "a", "to": "b.rear"}],
        }
    )


KINDS = list(itertools.product(("bullet", "unicycle"), ("images", "parametric")))


@pytest.mark.parametrize(("plant", "perception"), KINDS)
def test_a_scene_gets_its_plant_and_a_world_only_if_it_needs_one(
    plant: str, perception: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plate_folder()  # that of the process, which stays
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with open_simulation(scene(plant, perception), PLACEMENT) as simulation:
        assert type(simulation.plant) is (BulletPlant if plant == "bullet" else KinematicPlant)
        assert (simulation.world is None) is (plant == "unicycle" and perception == "parametric")
        client = None if simulation.world is None else simulation.world.client
        files = {path.suffix for folder in tmp_path.iterdir() for path in folder.iterdir()}
        assert files == ({".urdf"} if perception == "images" else set())
    assert client is None or not pybullet.isConnected(client)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("camera", ["onboard", "overhead"])
def test_pybullet_is_given_the_tags_if_any_camera_lets_it_draw(camera: str) -> None:
    drawn = load_scene("close_range", {"as_built": "perfect", f"cameras.{camera}.renderer": "tiny"})
    placement = Placement({"a": SE2(-0.5, 0.0, 0.0), "b": SE2(0.5, 0.0, 0.0)}, {})
    X_UT = drawn.geometry("a").frame("tag_top")
    view = PinholeCamera(320, 240, 300.0)
    with open_simulation(drawn, placement) as simulation:
        assert simulation.world is not None
        X_WT = simulation.plant.pose3("a") @ X_UT
        X_WC = X_WT @ SE3.from_xyz_rpy([0.0, 0.0, -0.4], [0.0, 0.0, 0.0])
        image = TinyRenderer(RenderContext(simulation.world.client)).render(view, X_WC, view.frame)
    found = [tag.tag_id for tag in PupilDetector().detect(image, view.frame)]
    assert found == [drawn.tag_ids("a")["tag_top"]]


@pytest.mark.parametrize(("plant", "perception"), KINDS)
def test_poses_are_those_of_the_plant_and_of_the_obstacles_that_have_appeared(
    plant: str, perception: str
) -> None:
    with open_simulation(scene(plant, perception), PLACEMENT) as simulation:
        simulation.plant.command("a", Twist(0.2, 0.5))
        for _ in range(60):
            poses = simulation.poses()
            expected = {"a", "b", "post"} | ({"late"} if simulation.plant.now_ns() >= 1e8 else set())
            assert poses.keys() == expected
            assert poses["a"] == simulation.plant.pose("a")
            assert poses["post"] == PLACEMENT.obstacles["post"]
            if simulation.world is not None:
                assert simulation.world.obstacles.keys() == expected - {"a", "b"}
                between = simulation.world.pose("a").inverse() @ poses["a"]
                assert math.hypot(between.x, between.y) < 1e-6
            simulation.plant.step()


@pytest.mark.parametrize("plant", ["bullet", "unicycle"])
def test_an_obstacle_stands_in_the_world_from_the_tick_on_at_which_it_has_a_pose(plant: str) -> None:
    """888 / 240 s is 3.7 s, but 888 times the rounded 1 / 240 s is less: a camera found no body."""
    late = scene(plant, "images")
    post = late.obstacles["late"].model_copy(update={"appears_at_s": 3.7})
    late = late.model_copy(update={"obstacles": {**late.obstacles, "late": post}})
    with open_simulation(late, PLACEMENT) as simulation:
        assert simulation.world is not None
        simulation.plant.tick = 886
        for _ in range(2):
            assert ("late" in simulation.poses(), "late" in simulation.world.obstacles) == (False, False)
            simulation.plant.step()
        assert ("late" in simulation.poses(), "late" in simulation.world.obstacles) == (True, True)


def test_a_misaligned_camera_is_turned_and_the_geometry_of_the_robot_is_not() -> None:
    """The fault changes the simulated world; the robot gets the geometry of the URDF."""
    faulty = scene("unicycle", "parametric")
    X_UB = faulty.geometry("a").frame("camera")
    built = as_designed(faulty)
    between = (X_UB.inverse() @ camera_pose(faulty, built, "a")).to_se2()
    assert (between.x, between.y, between.yaw) == pytest.approx((0.0, 0.0, math.radians(5.0)))
    assert isinstance(camera_pose(faulty, built, "b"), SE3)
    assert camera_pose(faulty, built, "b").to_se2() == X_UB.to_se2()
