"""How a camera and the bodies before it move during an exposure of some milliseconds.

An exposure is centred on the instant at which it is taken, and the renderer sees the world at that instant.
Before and after it every body is where its velocity of that instant takes it. A unit under the limits of the
shipped scenes changes its speed by 4 mm/s in 10 ms, which is 0.02 mm from its place: far below a pixel.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
import pybullet

from msrr_bullet.simulation.simulation import Simulation
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.pinhole import PinholeCamera
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.specs.bodies import BoxSpec

#: Height of a unit with its mast and its tag on top [m].
_UNIT_HEIGHT_M = 0.25

#: Nothing is taken to be nearer than this, where a camera could no longer see a tag as a whole [m].
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

    @property
    def stands(self) -> bool:
        """Whether the body does not move at all."""
        return not (self.v_W.any() or self.w_W.any())

    def displacement(self, dt: float) -> SE3:
        """Return where points of the body, in W, are ``dt`` seconds later if the velocity is constant."""
        R = np.asarray(cv2.Rodrigues(self.w_W * dt)[0], dtype=np.float64)
        return SE3(R, self.p_W + self.v_W * dt - R @ self.p_W)

    def velocity_at(self, p_W: Array) -> Array:
        """Return the velocities of points of the body [m/s], both of shape (..., 3)."""
        x, y, z = self.w_W.tolist()
        turning: Array = (p_W - self.p_W) @ np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])
        return turning + self.v_W


@dataclass(frozen=True, eq=False)
class CameraMotion:
    """Velocities of a camera and of the bodies that it may see, at the instant of an exposure.

    Attributes:
        bodies: Bodies that move, by their PyBullet ids.
        carrier: The one that carries the camera; None for a camera that stands.
        outlines: Corners of a box about every body but the carrier, in W, shape (8, 3) [m], by id.
    """

    bodies: Mapping[int, BodyMotion]
    carrier: int | None
    outlines: Mapping[int, Array]

    def displaced(self, dt: float) -> dict[int, SE3]:
        """Return the displacement, in W, of every moving body ``dt`` seconds after the instant."""
        return {body: motion.displacement(dt) for body, motion in self.bodies.items()}

    def image_speed(self, camera: PinholeCamera, X_WC: SE3) -> float:
        """Return how fast the image of bodies in the frame moves at most [px/s].

        It is taken at the corners of their boxes, and for what is far away in the middle of the image. The
        floor is not counted: it may be near, but its texture is smooth.

        Args:
            camera: Intrinsics.
            X_WC: Pose of the camera.
        """
        own = self.bodies.get(self.carrier) if self.carrier is not None else None
        fastest = 0.0 if own is None else camera.focal * float(np.linalg.norm(own.w_W @ X_WC.R[:, :2]))
        left, right = (-0.5 - camera.cx) / camera.focal, (camera.width - 0.5 - camera.cx) / camera.focal
        top, bottom = (-0.5 - camera.cy) / camera.focal, (camera.height - 0.5 - camera.cy) / camera.focal
        for body, corners in self.outlines.items():
            px, py, pz = X_WC.R.T @ (corners - X_WC.p).T
            outside = (px < left * pz, px > right * pz, py < top * pz, py > bottom * pz, pz < _NEAREST_M)
            if any(side.all() for side in outside):
                continue
            v_W = np.zeros(corners.shape)
            if body in self.bodies:
                v_W += self.bodies[body].velocity_at(corners)
            if own is not None:
                v_W -= own.velocity_at(corners)
            vx, vy, vz = X_WC.R.T @ v_W.T
            z = np.maximum(pz, _NEAREST_M)
            # A box may reach beyond the frame; its part in the frame moves as its border does at that depth.
            x, y = np.clip(px / z, left, right), np.clip(py / z, top, bottom)
            fastest = max(fastest, camera.focal * float((np.hypot(vx - x * vz, vy - y * vz) / z).max()))
        return fastest


class MotionSensor:
    """Reads from a simulation with images how a camera and all bodies move."""

    def __init__(self, simulation: Simulation, carrier: str | None) -> None:
        """Observe a camera.

        Args:
            simulation: True state of the trial.
            carrier: Unit that carries the camera; None for a camera that stands.
        """
        self._simulation = simulation
        self._carrier = carrier

    def __call__(self) -> CameraMotion:
        """Return the motion at this instant."""
        simulation, world = self._simulation, self._simulation.world
        assert world is not None, "a simulation with images has a world"
        ids = {unit: world.unit(unit).body for unit in simulation.scene.units} | world.obstacles
        motions = {ids[unit]: _unit_motion(simulation, unit) for unit in simulation.scene.units}
        outlines = {
            ids[name]: SE3.from_se2(X_WB).act(self._boxes[name])
            for name, X_WB in simulation.poses().items()
            if name in ids and name != self._carrier
        }
        return CameraMotion(
            bodies={body: motion for body, motion in motions.items() if not motion.stands},
            carrier=None if self._carrier is None else ids[self._carrier],
            outlines=outlines,
        )

    @cached_property
    def _boxes(self) -> dict[str, Array]:
        """Corners of the box about each body, in the body's frame on the floor, shape (8, 3) [m]."""
        scene = self._simulation.scene
        boxes = {}
        for unit in scene.units:
            outline = scene.geometry(unit).footprint
            boxes[unit] = _box(outline.min(axis=0), outline.max(axis=0), _UNIT_HEIGHT_M)
        for name, spec in scene.obstacles.items():
            reach = np.full(2, spec.radius_m)
            if isinstance(spec, BoxSpec):
                reach = 0.5 * np.array([spec.length_m, spec.width_m])
            boxes[name] = _box(-reach, reach, spec.height_m)
        return boxes


def _box(low: Array, high: Array, height: float) -> Array:
    """Return the corners of an upright box on the floor, shape (8, 3), from two corners of its base (2,)."""
    corners = np.meshgrid((low[0], high[0]), (low[1], high[1]), (0.0, height))
    return np.stack(corners, axis=-1).reshape(8, 3)


def _unit_motion(simulation: Simulation, unit: str) -> BodyMotion:
    """Return the velocity of a unit: of its body in PyBullet, or of a plant that only places that body."""
    world, plant = simulation.world, simulation.plant
    assert world is not None, "a simulation with images has a world"
    if simulation.scene.plant == "bullet":
        body = world.unit(unit).body
        p_W = pybullet.getBasePositionAndOrientation(body, physicsClientId=world.client)[0]
        v_W, w_W = pybullet.getBaseVelocity(body, physicsClientId=world.client)
        return BodyMotion(np.array(p_W), np.array(v_W), np.array(w_W))
    X_WU, twist = plant.pose3(unit), plant.twist(unit)
    return BodyMotion(X_WU.p, twist.v * X_WU.R[:, 0], np.array([0.0, 0.0, twist.w]))
