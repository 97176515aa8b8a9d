"""How a camera and the bodies before it move during an exposure of some milliseconds.

An exposure is centred on the instant at which it is taken, and the renderer sees the world at that instant.
Before and after it every body is where its velocity of that instant takes it. A unit under the limits of the
shipped scenes changes its speed by 5 mm/s at most in 10 ms, which is 0.03 mm from its place: far below a
pixel.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from msrr_bullet.built_poses import placed_tags
from msrr_bullet.sensors.kernels.image_motion import fastest_corner, place_tags
from msrr_bullet.silent_pybullet import pybullet
from msrr_bullet.simulation.simulation import Simulation
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.pinhole import PinholeCamera
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.messages import Twist

#: Tags that are nearer do not count: a camera could no longer see one as a whole [m].
_NEAREST_M = 0.05


@dataclass(frozen=True, eq=False)
class BodyMotion:
    """Velocity of a rigid body at an instant.

    Attributes:
        p_W: A point of the body, shape (3,) [m].
        v_W: Velocity of that point, shape (3,) [m/s].
        w_W: Angular velocity, shape (3,) [rad/s].
    """

    p_W: Array
    v_W: Array
    w_W: Array

    def displacement(self, dt: float) -> SE3:
        """Return where points of the body, in W, are ``dt`` seconds later if the velocity is constant."""
        R = np.asarray(cv2.Rodrigues(self.w_W * dt)[0], dtype=np.float64)
        return SE3(R, self.p_W + self.v_W * dt - R @ self.p_W)

    def packed(self) -> Array:
        """Return point, velocity and angular velocity as one array, shape (9,)."""
        return np.concatenate([self.p_W, self.v_W, self.w_W])


@dataclass(frozen=True, eq=False)
class CameraMotion:
    """Velocities of a camera and of the bodies that it may see, at the instant of an exposure.

    Attributes:
        bodies: Bodies that move, by their PyBullet ids.
        carrier: The one that carries the camera; None for a camera that stands.
        tags: Corners of the tags of all bodies but the carrier, in W, shape (T, 4, 3) [m], in the order of
            :func:`.unit_geometry.tag_corners`.
        owners: PyBullet id of the body of each tag, shape (T,).
    """

    bodies: Mapping[int, BodyMotion]
    carrier: int | None
    tags: Array
    owners: NDArray[np.int64]

    def displaced(self, dt: float) -> dict[int, SE3]:
        """Return the displacement, in W, of every moving body ``dt`` seconds after the instant."""
        return {body: motion.displacement(dt) for body, motion in self.bodies.items()}

    def image_speed(self, camera: PinholeCamera, X_WC: SE3) -> float:
        """Return how fast the image of what is read moves at most [px/s].

        It is taken at the corners of the tags that face the camera, and for what is far away in the middle
        of the image.
        """
        own = self.bodies.get(self.carrier) if self.carrier is not None else None
        fastest = 0.0 if own is None else camera.focal * float(np.linalg.norm(own.w_W @ X_WC.R[:, :2]))
        motions = np.zeros((len(self.owners), 9))
        for body, motion in self.bodies.items():
            motions[self.owners == body] = motion.packed()
        corner = fastest_corner(
            self.tags,
            motions,
            np.zeros(9) if own is None else own.packed(),
            X_WC.R,
            X_WC.p,
            camera.focal,
            0.5 * camera.width,
            0.5 * camera.height,
            camera.cx - 0.5 * (camera.width - 1),
            camera.cy - 0.5 * (camera.height - 1),
            _NEAREST_M,
        )
        return max(fastest, corner)


class MotionSensor:
    """Reads from a simulation with images how a camera and all bodies move."""

    def __init__(self, simulation: Simulation, carrier: str | None) -> None:
        """Observe a camera that is carried by a unit, or stands."""
        self._simulation = simulation
        self._carrier = carrier
        self._shown: tuple[str, ...] | None = None  # bodies whose tags there are; obstacles may appear

    def __call__(self) -> CameraMotion:
        """Return the motion at this instant."""
        simulation, world = self._simulation, self._simulation.world
        assert world is not None, "a simulation with images has a world"
        ids = {unit: world.unit(unit).body for unit in simulation.scene.units}
        motions = {body: _unit_motion(simulation, unit) for unit, body in ids.items()}
        ids |= world.obstacles
        poses = simulation.poses()
        shown = tuple(name for name in self._tags if name in poses)
        if shown != self._shown:
            count = [len(self._tags[name]) for name in shown]
            self._shown, self._which = shown, np.arange(len(shown)).repeat(count)
            self._owners = np.array([ids[name] for name in shown], dtype=np.int64).repeat(count)
            self._corners = np.concatenate([np.empty((0, 4, 3)), *(self._tags[name] for name in shown)])
        planar = [(math.cos(X.yaw), math.sin(X.yaw), X.x, X.y) for X in map(poses.__getitem__, shown)]
        return CameraMotion(
            bodies={body: motion for body, motion in motions.items() if motion is not None},
            carrier=None if self._carrier is None else ids[self._carrier],
            tags=place_tags(self._corners, self._which, np.array(planar).reshape(-1, 4)),
            owners=self._owners,
        )

    @cached_property
    def _tags(self) -> dict[str, Array]:
        """Corners of the tags of each body but the carrier, in the body's frame, shape (K, 4, 3) [m]."""
        scene, built = self._simulation.scene, self._simulation.built
        bodies = (name for name in (*scene.units, *built.obstacle_tags) if name != self._carrier)
        tags = {name: placed_tags(scene, built, name).values() for name in bodies}
        return {
            name: np.array([tag.corners_B for tag in own]).reshape(-1, 4, 3) for name, own in tags.items()
        }


def _unit_motion(simulation: Simulation, unit: str) -> BodyMotion | None:
    """Return the velocity of a unit: of its body in PyBullet, or of a plant that only places that body.

    None if it does not move at all.
    """
    world, plant = simulation.world, simulation.plant
    assert world is not None, "a simulation with images has a world"
    if simulation.scene.plant == "bullet":
        body = world.unit(unit).body
        v_W, w_W = pybullet.getBaseVelocity(body, physicsClientId=world.client)
        if not (any(v_W) or any(w_W)):
            return None
        p_W = pybullet.getBasePositionAndOrientation(body, physicsClientId=world.client)[0]
        return BodyMotion(np.array(p_W), np.array(v_W), np.array(w_W))
    twist = plant.twist(unit)
    if twist == Twist():
        return None
    X_WU = plant.pose3(unit)
    return BodyMotion(X_WU.p, twist.v * X_WU.R[:, 0], np.array([0.0, 0.0, twist.w]))
