"""Bodies of a client: shapes of any kind, drawn where TinyRenderer has them, added, moved and removed."""

from __future__ import annotations

import math
import os
from pathlib import Path

import numpy as np
import pybullet
import pytest

from msrr_bullet.render import RenderContext
from msrr_bullet.render.raster.bodies import LoadedBodies
from msrr_bullet.render.raster_renderer import RasterRenderer
from msrr_bullet.render.tiny_renderer import TinyRenderer
from msrr_bullet.simulation.tag_plates import plate_scale, write_plate
from msrr_perception.detection.detector import PupilDetector
from msrr_scenes.errors import GeometryError
from msrr_scenes.geometry.pinhole import PinholeCamera, optical_pose
from msrr_scenes.geometry.se3 import SE3
from tests.bullet.render.conftest import add_box, place, plain_floor

CAMERA = PinholeCamera.from_hfov(640, 480, math.radians(75.0))
SMALL = PinholeCamera.from_hfov(320, 240, math.radians(75.0))
X_OVERHEAD = SE3(np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, 2.0]))


@pytest.mark.parametrize(
    "urdf", ["duck_vhacd.urdf", "teddy_vhacd.urdf", "cube_small.urdf", "soccerball.urdf"]
)
def test_a_users_mesh_appears_as_tiny_shows_it(client: int, urdf: str) -> None:
    """Concave bodies, with a texture, without, with normals of their own, standing anyhow."""
    size = {"duck_vhacd.urdf": 2.0, "teddy_vhacd.urdf": 2.0, "cube_small.urdf": 3.0, "soccerball.urdf": 0.2}
    context = RenderContext(client, 4)
    renderer = RasterRenderer(context)
    empty = renderer.render(SMALL, X_OVERHEAD, SMALL.frame).astype(int)
    body = pybullet.loadURDF(urdf, globalScaling=size[urdf], physicsClientId=client)
    place(body, SE3.from_xyz_rpy([0.05, 0.0, 1.5], [0.7, 0.4, -0.5]))
    raster = renderer.render(SMALL, X_OVERHEAD, SMALL.frame)
    tiny = TinyRenderer(context).render(SMALL, X_OVERHEAD, SMALL.frame)
    seen = [np.abs(image.astype(int) - empty) > 8 for image in (raster, tiny)]
    assert seen[1].sum() > 300, "the body is in view"
    assert (seen[0] & seen[1]).sum() > 0.97 * (seen[0] | seen[1]).sum()
    both = seen[0] & seen[1]
    assert np.abs(raster.astype(int) - tiny)[both].mean() < 5.0


def test_links_joints_and_offset_frames_stand_where_tiny_has_them(client: int) -> None:
    """A robot with moved joints, visual offsets and inertial frames apart from the link frames."""
    robot = pybullet.loadURDF("kuka_iiwa/model.urdf", [0.1, 0.0, 0.6], physicsClientId=client)
    renderer = RasterRenderer(RenderContext(client))
    X_WC = optical_pose(SE3.from_xyz_rpy([-1.4, 0.1, 1.2], [0.1, 0.0, 0.0]))
    rng = np.random.default_rng(2)
    for _ in range(2):
        for joint in range(pybullet.getNumJoints(robot)):
            pybullet.resetJointState(robot, joint, rng.uniform(-0.8, 0.8))
        place(robot, SE3.from_xyz_rpy([0.1, 0.0, 0.6], rng.uniform(-0.3, 0.3, 3)))
        raster = renderer.render(SMALL, X_WC, SMALL.frame).astype(int)
        tiny = TinyRenderer(RenderContext(client, 2)).render(SMALL, X_WC, SMALL.frame).astype(int)
        assert np.mean(np.abs(raster - tiny) > 40) < 2e-3


def test_bodies_that_are_added_moved_or_removed_are_noticed(client: int) -> None:
    renderer = RasterRenderer(RenderContext(client, floor=plain_floor(0.0)))

    def middle() -> float:
        image = renderer.render(SMALL, X_OVERHEAD, SMALL.frame).astype(float)
        return float((image.sum(axis=0) @ np.arange(320)) / image.sum()) if image.any() else math.nan

    assert math.isnan(middle())
    body = add_box([0.1, 0.1, 0.1], SE3(p=np.array([0.0, 0.0, 1.0])))
    assert middle() == pytest.approx(159.5, abs=0.1)
    place(body, SE3(p=np.array([0.3, 0.0, 1.0])))
    assert middle() > 200.0
    pybullet.removeBody(body)
    assert body == add_box([0.1, 0.1, 0.1], SE3(p=np.array([0.3, 0.1, 1.0])), grey=0.0), "PyBullet reuses ids"
    assert math.isnan(middle())
    pybullet.removeBody(body)
    assert math.isnan(middle())


def test_a_shape_that_cannot_be_drawn_is_an_error(client: int, tmp_path: Path) -> None:
    shape = pybullet.createVisualShape(
        pybullet.GEOM_MESH, vertices=[[0, 0, 0], [1, 0, 0], [0, 1, 0]], indices=[0, 1, 2]
    )
    body = pybullet.createMultiBody(0.0, baseVisualShapeIndex=shape)
    renderer = RasterRenderer(RenderContext(client))
    with pytest.raises(GeometryError, match="meshes from files"):
        renderer.render(SMALL, X_OVERHEAD, SMALL.frame)
    pybullet.removeBody(body)
    assert renderer.render(SMALL, X_OVERHEAD, SMALL.frame).shape == (240, 320)


def test_a_plate_written_anew_is_read_anew(client: int, tmp_path: Path) -> None:
    """Files are cached by name, time and size; two trials of one process may read two meshes of one name."""
    for tag in (3, 4):
        for file in write_plate(tmp_path, tag):
            file.replace(tmp_path / f"plate{file.suffix}")
        mesh = tmp_path / "plate.obj"
        os.utime(mesh, ns=(tag, tag))
        shape = pybullet.createVisualShape(
            pybullet.GEOM_MESH, fileName=str(mesh), meshScale=plate_scale(0.1), rgbaColor=[1, 1, 1, 1]
        )
        body = pybullet.createMultiBody(0.0, baseVisualShapeIndex=shape)
        place(body, SE3.from_xyz_rpy([0.0, 0.0, 1.5], [math.pi, 0.0, 0.0]))
        image = RasterRenderer(RenderContext(client)).render(CAMERA, X_OVERHEAD, CAMERA.frame)
        assert [t.tag_id for t in PupilDetector().detect(image, CAMERA.frame)] == [tag]
        pybullet.removeBody(body)


def test_links_that_cannot_move_against_each_other_share_a_frame(client: int) -> None:
    """The visual shapes of seven joints and the base; a body without joints has one frame."""
    robot = pybullet.loadURDF("kuka_iiwa/model.urdf", physicsClientId=client)
    pybullet.loadURDF("cube_small.urdf", [2.0, 3.0, 4.0], physicsClientId=client)
    bodies = LoadedBodies(client)
    assert {shape.frame for shape in bodies.shapes} == set(range(bodies.frame_count))
    assert bodies.frame_count == 1 + pybullet.getNumJoints(robot) + 1
    assert [2.0, 3.0, 4.0] in bodies.poses()[:, :3].round(6).tolist()
