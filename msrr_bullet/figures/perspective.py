"""The scene as a camera has it before it: outlines of solids, tags and lines on the floor, in pixels."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import ArrayLike

from msrr_bullet.simulation.simulation import camera_pose
from msrr_bullet.simulation.tag_plates import PLATE_RATIO
from msrr_bullet.timeline.palette import OBSTACLE, TYRE, unit_colour
from msrr_perception.pose.global_pose import flat_tags, overhead_pose
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.pinhole import PinholeCamera, optical_pose
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.unit_geometry import tag_corners
from msrr_scenes.specs.bodies import CylinderSpec, ObstacleSpec
from msrr_scenes.specs.faults import MarkerHidden
from msrr_scenes.specs.scene import Scene

#: What is nearer to the camera than this is cut off [m].
NEAR = 0.01


@dataclass(frozen=True, eq=False)
class Perspective:
    """A camera in its place.

    Attributes:
        camera: Its optics.
        X_WC: Its optical frame in the world.
    """

    camera: PinholeCamera
    X_WC: SE3

    @classmethod
    def overhead(cls, scene: Scene) -> Perspective:
        """Return the camera above the arena, which the scene has to have."""
        assert scene.cameras.overhead is not None
        return cls(scene.cameras.overhead.pinhole, overhead_pose(scene.cameras.overhead))

    @classmethod
    def onboard(cls, scene: Scene, unit: str, X_WU: SE2) -> Perspective:
        """Return a unit's camera where it really is, errors of its mounting included."""
        X_WC = SE3.from_se2(X_WU) @ optical_pose(camera_pose(scene, unit))
        return cls(scene.cameras.onboard.pinhole, X_WC)

    def pixels(self, points_W: ArrayLike) -> Array:
        """Project points, shape (N, 3) [m], to pixels (N, 2); NaN for those not in front of the camera."""
        p = self._seen_from(points_W)
        front = p[:, 2] > NEAR
        found = np.full((len(p), 2), np.nan)
        found[front] = self.camera.project(p[front])
        return found

    def hull(self, points_W: ArrayLike) -> Array:
        """Return the outline in pixels, shape (K, 2), of the convex solid that ``points_W`` (N, 3) span.

        What lies behind the camera is cut off; K is 0 when nothing is left.
        """
        p = self._seen_from(points_W)
        front = p[:, 2] > NEAR
        if not front.any():
            return np.empty((0, 2))
        if not front.all():
            # A corner of the cut lies on an edge, and every edge joins a point on this side to one beyond.
            a, b = p[front][:, None], p[~front][None]
            share = (a[..., 2:] - NEAR) / (a[..., 2:] - b[..., 2:])
            p = np.concatenate([p[front], (a + share * (b - a)).reshape(-1, 3)])
        outline = cv2.convexHull(self.camera.project(p).astype(np.float32))
        found: Array = outline.reshape(-1, 2).astype(np.float64)
        return found

    def line(self, points_W: ArrayLike) -> Iterator[Array]:
        """Yield the stretches of a line, shape (N, 3), that lie in front of the camera, each (K, 2)."""
        p = self._seen_from(points_W)
        for a, b in pairwise(p):
            if a[2] <= NEAR and b[2] <= NEAR:
                continue
            if min(a[2], b[2]) <= NEAR:
                cut = a + (a[2] - NEAR) / (a[2] - b[2]) * (b - a)
                a, b = (cut, b) if a[2] <= NEAR else (a, cut)
            yield self.camera.project(np.stack([a, b]))

    def depth(self, points_W: ArrayLike) -> float:
        """Return how far along the camera's axis the middle of points lies [m]."""
        return float(self._seen_from(points_W)[:, 2].mean())

    def faces(self, X_WT: SE3) -> bool:
        """Say whether the camera is on the side from which tag T can be read."""
        away: Array = X_WT.p - self.X_WC.p
        return float(away @ X_WT.R[:, 2]) > 0.0

    def _seen_from(self, points_W: ArrayLike) -> Array:
        return self.X_WC.inverse().act(np.asarray(points_W, dtype=np.float64).reshape(-1, 3))


@dataclass(frozen=True, eq=False)
class Solids:
    """A body to draw, in its own frame B.

    Attributes:
        shapes: Convex solids, each the points (N, 3) [m] that span it, and its colour.
        plates: Tags: ``X_BT`` and the edge of the black square [m].
    """

    shapes: tuple[tuple[Array, int], ...]
    plates: tuple[tuple[SE3, float], ...]

    @property
    def points(self) -> Array:
        """All points of all solids, shape (N, 3) [m]."""
        return np.concatenate([points for points, _ in self.shapes])

    def squares(self, X_WB: SE2) -> Iterator[tuple[SE3, Array, Array]]:
        """Yield ``X_WT`` of every tag with the corners of its plate and of its square in W, (4, 3) [m]."""
        for X_BT, size in self.plates:
            X_WT = SE3.from_se2(X_WB) @ X_BT
            yield X_WT, X_WT.act(tag_corners(PLATE_RATIO * size)), X_WT.act(tag_corners(size))


def bodies(scene: Scene) -> dict[str, Solids]:
    """Return every body of a scene by its name; covered tags are left out."""
    hidden = {fault.unit for fault in scene.faults if isinstance(fault, MarkerHidden)}
    docking = {step.unit for step in scene.plan}
    found = {}
    for index, unit in enumerate(scene.units):
        geometry, colour = scene.geometry(unit), unit_colour(index, unit in docking)
        shapes = tuple(
            (solid.points(), TYRE if solid.link.startswith(("wheel", "caster")) else colour)
            for solid in geometry.solids
        )
        slots = () if unit in hidden else geometry.tag_slots
        found[unit] = Solids(shapes, tuple((geometry.frame(s), scene.tag_size(s)) for s in slots))
    lids = {tag.name: tag for tag in flat_tags(scene).values()}
    for name, spec in scene.obstacles.items():
        plates: tuple[tuple[SE3, float], ...] = ()
        if name in lids:
            lid = SE3(np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, lids[name].height]))
            plates = ((lid, spec.tag_m),)
        found[name] = Solids(((_prism(spec), OBSTACLE),), plates)
    return found


def _prism(spec: ObstacleSpec) -> Array:
    if isinstance(spec, CylinderSpec):
        rim = spec.radius_m * circle()
    else:
        rim = np.array([[i * spec.length_m, j * spec.width_m] for i in (-0.5, 0.5) for j in (-0.5, 0.5)])
    return np.concatenate([on_floor(rim, z) for z in (0.0, spec.height_m)])


@lru_cache(maxsize=1)
def circle() -> Array:
    """Return points on the unit circle, shape (48, 2)."""
    t = np.linspace(0.0, 2.0 * math.pi, 48, endpoint=False)
    return np.column_stack([np.cos(t), np.sin(t)])


def on_floor(points: ArrayLike, z: float = 0.0) -> Array:
    """Lift points of the plane, shape (N, 2), to height ``z`` [m]."""
    p = np.asarray(points, dtype=np.float64).reshape(-1, 2)
    return np.column_stack([p, np.full(len(p), z)])
