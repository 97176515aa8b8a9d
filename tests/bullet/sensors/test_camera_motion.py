"""How a camera and bodies move: the next milliseconds of the plant, and the speed of the image."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from msrr_bullet.sensors.camera_motion import BodyMotion, CameraMotion, MotionSensor
from msrr_bullet.sensors.shutter import instant_after
from msrr_bullet.trial.environment import Environment, open_environment
from msrr_scenes.geometry.pinhole import optical_pose
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.unit_geometry import tag_corners
from msrr_scenes.messages import Twist
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.sensors import CameraSpec

Load = Callable[..., Scene]
X_ORIGIN = optical_pose(SE3())


def driven(environment: Environment, unit: str, twist: Twist, ticks: int) -> None:
    plant = environment.simulation.plant
    plant.command(unit, twist)
    for _ in range(ticks):
        plant.step()


@pytest.mark.parametrize("plant", ["bullet", "unicycle"])
def test_a_unit_is_where_its_velocity_takes_it_for_the_next_milliseconds(shipped: Load, plant: str) -> None:
    """The plant itself, 12.5 ms later, while the unit speeds up; the largest exposure of a row is 50 ms."""
    scene = shipped("close_range", {"plant": plant})
    unit = scene.plan[0].unit
    with open_environment(scene, 0) as environment:
        simulation = environment.simulation
        driven(environment, unit, Twist(0.15, 0.8), 24)
        X_WU = simulation.plant.pose3(unit)
        motion = MotionSensor(simulation, unit)()
        assert motion.carrier in motion.bodies
        ticks = 3
        driven(environment, unit, Twist(0.15, 0.8), ticks)
        later = simulation.plant.pose3(unit)
        predicted = motion.displaced(ticks / scene.physics_hz)[motion.carrier] @ X_WU
    assert np.linalg.norm(later.p - X_WU.p) > 3e-4
    assert np.linalg.norm(later.p - predicted.p) < 1e-4
    turned = float(np.arccos(np.clip(0.5 * (np.trace(later.R.T @ predicted.R) - 1.0), -1.0, 1.0)))
    assert turned < math.radians(0.1)


def test_the_speed_of_the_image_is_that_of_the_fastest_tag(shipped: Load) -> None:
    """Against a difference quotient: corners of tags, projected where the next millisecond takes them."""
    scene = shipped("close_range")
    step = scene.plan[0]
    with open_environment(scene, 0) as environment:
        plant, geometry = environment.simulation.plant, scene.geometry(step.target_unit)
        camera = CameraSpec().pinhole
        X_UC = optical_pose(scene.geometry(step.unit).frame("camera"))
        for twist in (Twist(0.15, 0.0), Twist(0.1, 0.5), Twist(0.0, -0.6)):
            driven(environment, step.unit, twist, 30)
            X_WC = plant.pose3(step.unit) @ X_UC
            sizes = [scene.tag_size(step.target_unit, slot) for slot in geometry.tag_slots]
            frames = [plant.pose3(step.target_unit) @ geometry.frame(slot) for slot in geometry.tag_slots]
            facing = [
                X_WT.act(tag_corners(size))
                for X_WT, size in zip(frames, sizes, strict=True)
                if X_WT.R[:, 2] @ (X_WT.p - X_WC.p) > 0.0
            ]
            corners = np.concatenate(facing)
            motion = MotionSensor(environment.simulation, step.unit)()
            later = instant_after(1e-3, X_WC, motion).X_WC
            before, after = (camera.project(X.inverse().act(corners)) for X in (X_WC, later))
            assert camera.contains(before).all()
            far = camera.project(later.inverse().act(X_WC.act([[0.0, 0.0, 1e9]])))[0]
            turning = np.linalg.norm(far - [camera.cx, camera.cy])
            fastest = max(np.linalg.norm(after - before, axis=1).max(), turning) / 1e-3
            assert motion.image_speed(camera, X_WC) == pytest.approx(fastest, rel=0.01, abs=0.01)


@pytest.mark.parametrize(
    ("place", "yaw", "shown"),
    [
        ([1.0, 0.0, 0.0], 0.0, True),
        ([1.0, 0.0, 0.0], math.pi, False),  # seen from behind
        ([-1.0, 0.0, 0.0], math.pi, False),  # behind the camera
        ([1.0, 2.0, 0.0], 0.0, False),  # beside the picture
    ],
)
def test_only_tags_in_the_picture_have_a_speed(place: list[float], yaw: float, shown: bool) -> None:
    corners = (SE3.from_xyz_rpy(place, (0.0, 0.0, yaw)) @ X_ORIGIN).act(tag_corners(0.05))
    moves = BodyMotion(np.zeros(3), np.array([0.0, 1.0, 0.0]), np.zeros(3))
    camera, motion = CameraSpec().pinhole, CameraMotion({3: moves}, None, corners[np.newaxis], np.array([3]))
    assert motion.image_speed(camera, X_ORIGIN) == pytest.approx(camera.focal if shown else 0.0)
