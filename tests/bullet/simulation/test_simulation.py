"""The simulated world of a trial: the parts that a scene needs, true poses, and the mounting of cameras."""

from __future__ import annotations

import itertools
import math
from pathlib import Path

import pybullet
import pytest

from msrr_bullet.built_poses import camera_pose
from msrr_bullet.plant.kinematic_plant import KinematicPlant
from msrr_bullet.simulation.bullet_plant import BulletPlant
from msrr_bullet.simulation.simulation import open_simulation
from msrr_scenes.as_built import as_drawn
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
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
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with open_simulation(scene(plant, perception), PLACEMENT) as simulation:
        assert type(simulation.plant) is (BulletPlant if plant == "bullet" else KinematicPlant)
        assert (simulation.world is None) is (plant == "unicycle" and perception == "parametric")
        client = None if simulation.world is None else simulation.world.client
        files = {path.suffix for folder in tmp_path.iterdir() for path in folder.iterdir()}
        assert files == ({".urdf", ".obj", ".png"} if perception == "images" else set())
    assert client is None or not pybullet.isConnected(client)
    assert list(tmp_path.iterdir()) == []


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


def test_a_misaligned_camera_is_turned_and_the_geometry_of_the_robot_is_not() -> None:
    """The fault changes the simulated world; the robot gets the geometry of the URDF."""
    faulty = scene("unicycle", "parametric")
    X_UB = faulty.geometry("a").frame("camera")
    built = as_drawn(faulty)
    between = (X_UB.inverse() @ camera_pose(faulty, built, "a")).to_se2()
    assert (between.x, between.y, between.yaw) == pytest.approx((0.0, 0.0, math.radians(5.0)))
    assert isinstance(camera_pose(faulty, built, "b"), SE3)
    assert camera_pose(faulty, built, "b").to_se2() == X_UB.to_se2()
