"""How a camera and the bodies before it move during an exposure of some milliseconds.

An exposure is centred on the instant at which it is taken, and the renderer sees the world at that instant.
Before and after it every body is where its velocity of that instant takes it. A unit under the limits of the
shipped scenes changes its speed by 4 mm/s in 10 ms, which is 0.02 mm from its place: far below a pixel.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import cv2
import numpy as np
import pybullet

from msrr_bullet.simulation.simulation import Simulation
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se3 import SE3

#: Distance from the middle of a unit or of an obstacle to what is seen of it [m]: half a unit's width.
_REACH_M = 0.1

#: Height of what a camera that looks down sees of a unit [m].
_TALLEST_M = 0.25

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

    def speed_at(self, p_W: Array) -> float:
        """Return the speed of a point of the body [m/s]."""
        return float(np.linalg.norm(self.v_W + np.cross(self.w_W, p_W - self.p_W)))


@dataclass(frozen=True, eq=False)
class CameraMotion:
    """Velocities of a camera and of the bodies that it may see, at the instant of an exposure.

    Attributes:
        bodies: Bodies that move, by their PyBullet ids.
        carrier: The one that carries the camera; None for a camera that stands.
        nearest_m: Distance from the camera to the nearest other body, or less [m].
    """

    bodies: Mapping[int, BodyMotion]
    carrier: int | None
    nearest_m: float

    def displaced(self, dt: float) -> dict[int, SE3]:
        """Return the displacement, in W, of every moving body ``dt`` seconds after the instant."""
        return {body: motion.displacement(dt) for body, motion in self.bodies.items()}

    def rate(self, p_WC: Array) -> float:
        """Return how fast what the camera sees moves over its image, or more [rad/s].

        Args:
            p_WC: Position of the camera, shape (3,) [m].
        """
        own = self.bodies.get(self.carrier) if self.carrier is not None else None
        turning = 0.0 if own is None else float(np.linalg.norm(own.w_W))
        speed = 0.0 if own is None else own.speed_at(p_WC)
        others = (
            float(np.linalg.norm(motion.v_W) + _REACH_M * np.linalg.norm(motion.w_W))
            for body, motion in self.bodies.items()
            if body != self.carrier
        )
        return turning + (speed + max(others, default=0.0)) / self.nearest_m


def camera_motion(simulation: Simulation, p_WC: Array, carrier: str | None) -> CameraMotion:
    """Return the motion of a camera of a simulation with images, at this instant.

    Args:
        simulation: True state of the trial.
        p_WC: Position of the camera, shape (3,) [m].
        carrier: Unit that carries the camera; None for a camera that stands.
    """
    world = simulation.world
    assert world is not None, "a simulation with images has a world"
    motions = {world.unit(unit).body: _unit_motion(simulation, unit) for unit in simulation.scene.units}
    away = (
        float(np.hypot(X_WB.x - p_WC[0], X_WB.y - p_WC[1]))
        for body, X_WB in simulation.poses().items()
        if body != carrier
    )
    height = max(float(p_WC[2]) - _TALLEST_M, 0.0)
    return CameraMotion(
        bodies={body: motion for body, motion in motions.items() if not motion.stands},
        carrier=None if carrier is None else world.unit(carrier).body,
        nearest_m=max(float(np.hypot(min(away, default=np.inf) - _REACH_M, height)), _NEAREST_M),
    )


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
