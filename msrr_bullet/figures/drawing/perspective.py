"""Projection of a scene into a camera: outlines of solids, tags and lines on the floor, in pixels."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from msrr_bullet.built_poses import PlacedTag, camera_pose, overhead_camera_pose, placed_tags
from msrr_bullet.timeline.palette import OBSTACLE, link_colour, unit_colours
from msrr_scenes.arrays import Array
from msrr_scenes.as_built import AsBuilt
from msrr_scenes.geometry.pinhole import PinholeCamera, optical_pose
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.unit_geometry import tag_corners
from msrr_scenes.specs.scene import Scene

#: Distance from the camera below which everything is cut off [m].
NEAR = 0.01

#: Width of the rim about a frame in which an area is still drawn, for the sake of its edge [px].
_RIM = 2.0


@dataclass(frozen=True, eq=False)
class Perspective:
    """Pinhole camera at a pose of its optical frame in the world."""

    camera: PinholeCamera
    X_WC: SE3

    @classmethod
    def overhead(cls, scene: Scene, built: AsBuilt) -> Perspective:
        """Return the overhead camera of a scene that has one, as it was built."""
        assert built.overhead is not None
        return cls(built.overhead.pinhole, overhead_camera_pose(scene, built))

    @classmethod
    def onboard(cls, scene: Scene, built: AsBuilt, unit: str, X_WU: SE2) -> Perspective:
        """Return the onboard camera of a unit at its true pose, as it was built."""
        X_WC = SE3.from_se2(X_WU) @ optical_pose(camera_pose(scene, built, unit))
        return cls(built.units[unit].camera.pinhole, X_WC)

    def pixels(self, points_W: ArrayLike) -> Array:
        """Project points, shape (N, 3) [m], to pixels (N, 2); NaN for those not in front of the camera."""
        p = self._in_camera(points_W)
        front = p[:, 2] > NEAR
        pixels = np.full((len(p), 2), np.nan)
        pixels[front] = self.camera.project(p[front])
        return pixels

    def hull(self, points_W: ArrayLike) -> Array:
        """Return the outline in pixels, shape (K, 2), of the convex hull of points (N, 3) [m].

        The part behind the camera is cut off. K is 0 when nothing is left.
        """
        return self._hull(self._in_camera(points_W))

    def areas(self, areas: Sequence[Array]) -> Iterator[tuple[float, Array]]:
        """Yield depth and outline of every area whose hull the camera may show; K is 0 for the others.

        Args:
            areas: Points in W, whose convex hull an area is, each of shape (N, 3) [m].

        Yields:
            The depth of the centroid along the axis of the camera [m], and the outline as of ``hull``.
        """
        p, counts = self._in_camera(np.concatenate(areas)), np.array([len(points) for points in areas])
        starts = np.cumsum(counts) - counts
        depths = np.add.reduceat(p[:, 2], starts) / counts
        in_front = np.minimum.reduceat(p[:, 2], starts) > NEAR
        with np.errstate(divide="ignore", invalid="ignore"):  # of points behind the camera
            pixels = self.camera.project(p).astype(np.float32)
            low, high = (bound.reduceat(pixels, starts) for bound in (np.minimum, np.maximum))
            ends = np.array([self.camera.width, self.camera.height]) + _RIM
            outside = np.any((high < -_RIM) | (low > ends), axis=1)
        for n, (start, count, depth) in enumerate(zip(starts, counts, depths.tolist(), strict=True)):
            if not in_front[n]:
                yield depth, self._hull(p[start : start + count])
            elif outside[n]:
                yield depth, np.empty((0, 2))
            else:
                yield depth, _convex_outline(pixels[start : start + count])

    def line(self, points_W: ArrayLike) -> Iterator[Array]:
        """Yield the pieces of a line, shape (N, 3) [m], in front of the camera, each in pixels (2, 2)."""
        p = self._in_camera(points_W)
        for a, b in pairwise(p):
            if a[2] <= NEAR and b[2] <= NEAR:
                continue
            if min(a[2], b[2]) <= NEAR:
                cut = a + (a[2] - NEAR) / (a[2] - b[2]) * (b - a)
                a, b = (cut, b) if a[2] <= NEAR else (a, cut)
            yield self.camera.project(np.stack([a, b]))

    def sees_front(self, X_WT: SE3) -> bool:
        """Return whether the camera is on the side from which tag T can be read."""
        away: Array = X_WT.p - self.X_WC.p
        return float(away @ X_WT.R[:, 2]) > 0.0

    def _in_camera(self, points_W: ArrayLike) -> Array:
        return self.X_WC.inverse().act(np.asarray(points_W, dtype=np.float64).reshape(-1, 3))

    def _hull(self, p: Array) -> Array:
        front = p[:, 2] > NEAR
        if not front.any():
            return np.empty((0, 2))
        if not front.all():
            # Every corner of the cut lies on a line from a point in front of the plane to one behind it.
            a, b = p[front][:, None], p[~front][None]
            fraction = (a[..., 2:] - NEAR) / (a[..., 2:] - b[..., 2:])
            p = np.concatenate([p[front], (a + fraction * (b - a)).reshape(-1, 3)])
        return _convex_outline(self.camera.project(p).astype(np.float32))


def _convex_outline(pixels: NDArray[np.float32]) -> Array:
    outline: Array = cv2.convexHull(pixels).reshape(-1, 2).astype(np.float64)
    return outline


@dataclass(frozen=True, eq=False)
class Solids:
    """Shapes and tags of a body in its frame B.

    Attributes:
        shapes: Convex solids, each as points (N, 3) [m] whose hull it is, and a colour.
        tags: Tags as they were built.
        plate_ratio: Edge of the print of a tag over its size.
    """

    shapes: tuple[tuple[Array, int], ...]
    tags: tuple[PlacedTag, ...]
    plate_ratio: float

    @property
    def points(self) -> Array:
        """Points of all solids, shape (N, 3) [m]."""
        return np.concatenate([points for points, _ in self.shapes])

    def squares(self, X_WB: SE2) -> Iterator[tuple[SE3, Array, Array]]:
        """Yield ``X_WT`` of every tag, and the corners of plate and square in W, each (4, 3) [m]."""
        for tag in self.tags:
            X_WT = SE3.from_se2(X_WB) @ tag.X_BT
            yield X_WT, X_WT.act(tag_corners(self.plate_ratio * tag.size)), X_WT.act(tag_corners(tag.size))


def scene_solids(scene: Scene, built: AsBuilt) -> dict[str, Solids]:
    """Return the solids of every body of a scene by name, without covered tags, as they were built."""
    shapes = {
        unit: tuple((s.points(), link_colour(s.link, colour)) for s in built.units[unit].geometry.solids)
        for unit, colour in unit_colours(scene).items()
    }
    shapes |= {name: ((spec.solid.points(), OBSTACLE),) for name, spec in scene.obstacles.items()}
    solids, ratio = {}, scene.tags.tag_family.plate_ratio
    for name, own in shapes.items():
        shown = {} if name in scene.covered_units else placed_tags(scene, built, name)
        solids[name] = Solids(own, tuple(shown.values()), ratio)
    return solids


def on_floor(points: ArrayLike, z: float = 0.0) -> Array:
    """Return points of the floor, shape (N, 2), at height ``z`` [m], shape (N, 3) [m]."""
    p = np.asarray(points, dtype=np.float64).reshape(-1, 2)
    return np.column_stack([p, np.full(len(p), z)])
