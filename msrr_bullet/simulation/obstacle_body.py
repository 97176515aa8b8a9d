"""An obstacle as a PyBullet body."""

from __future__ import annotations

from msrr_bullet.silent_pybullet import pybullet
from msrr_bullet.simulation.unit_body import ROOT
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.specs.bodies import BoxSpec, CylinderSpec

OBSTACLE_FRICTION = 0.5
OBSTACLE_RGBA = (0.55, 0.55, 0.55, 1.0)


def add_obstacle(client: int, spec: CylinderSpec | BoxSpec, X_WB: SE2) -> int:
    """Add an obstacle to a client and return the id of its body."""
    collision: dict[str, float | list[float]]
    visual: dict[str, float | list[float]]
    if isinstance(spec, CylinderSpec):
        shape = pybullet.GEOM_CYLINDER
        collision, visual = (
            {"radius": spec.radius_m, "height": spec.height_m},
            {"radius": spec.radius_m, "length": spec.height_m},
        )
    else:
        shape = pybullet.GEOM_BOX
        half = [0.5 * spec.length_m, 0.5 * spec.width_m, 0.5 * spec.height_m]
        collision = visual = {"halfExtents": half}
    X_WG = SE3.from_se2(X_WB, 0.5 * spec.height_m)
    body: int = pybullet.createMultiBody(
        baseMass=0.0,
        baseCollisionShapeIndex=pybullet.createCollisionShape(shape, **collision, physicsClientId=client),
        baseVisualShapeIndex=pybullet.createVisualShape(
            shape, **visual, rgbaColor=OBSTACLE_RGBA, physicsClientId=client
        ),
        basePosition=X_WG.p.tolist(),
        baseOrientation=X_WG.quaternion_xyzw().tolist(),
        physicsClientId=client,
    )
    pybullet.changeDynamics(body, ROOT, lateralFriction=OBSTACLE_FRICTION, physicsClientId=client)
    return body
