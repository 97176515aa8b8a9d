"""Start regions: the ground that a body can cover at the start, over its whole start distribution.

Regions are convex outlines, shape (N, 2) [m]. Where a rotation is approximated by steps they are too large,
never too small, so that two disjoint regions prove that no draw makes the bodies overlap.
"""

from __future__ import annotations

import math

import numpy as np

from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.solid import convex_hull, hull_or_line
from msrr_scenes.placement.placement import FRONT, split_frame
from msrr_scenes.specs.bodies import BoxSpec, ObstacleSpec
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.spec import PoseSpec

_MAX_TURN = math.radians(5.0)
_CIRCLE = 48
_SQUARE: Array = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


def overlap(a: Array, b: Array) -> bool:
    """Return whether two convex outlines have inner points in common (separating axes)."""
    for outline in (a, b):
        edges = np.roll(outline, -1, axis=0) - outline
        normals = np.stack([edges[:, 1], -edges[:, 0]], axis=1)
        pa, pb = a @ normals.T, b @ normals.T
        if np.any((pa.max(axis=0) <= pb.min(axis=0)) | (pb.max(axis=0) <= pa.min(axis=0))):
            return False
    return True


def distance(a: Array, b: Array) -> float:
    """Return the distance [m] of two convex outlines, 0 if they overlap."""
    return 0.0 if overlap(a, b) else min(_to_edges(a, b), _to_edges(b, a))


def _to_edges(points: Array, outline: Array) -> float:
    """Return the smallest distance [m] of points, shape (N, 2), from the edges of an outline."""
    edges = np.roll(outline, -1, axis=0) - outline
    to_points = points[:, None] - outline
    share = np.clip((to_points * edges).sum(axis=2) / (edges**2).sum(axis=1), 0.0, 1.0)
    return float(np.linalg.norm(to_points - share[..., None] * edges, axis=2).min())


def obstacle_outline(spec: ObstacleSpec) -> Array:
    """Return the outline of an obstacle in its own frame; a circle is replaced by a polygon around it."""
    if isinstance(spec, BoxSpec):
        return 0.5 * np.array([spec.length_m, spec.width_m]) * _SQUARE
    t = np.arange(_CIRCLE) * (2.0 * math.pi / _CIRCLE)
    return spec.radius_m / math.cos(math.pi / _CIRCLE) * np.stack([np.cos(t), np.sin(t)], axis=1)


def spread_over(pose: PoseSpec, points: Array) -> Array:
    """Return the region in the pose's frame that ``points`` of the posed frame cover over the spread."""
    half = math.radians(pose.spread.yaw_deg)
    steps = math.ceil(half / _MAX_TURN)
    # The arc between two steps lies inside their chord if both are moved out by 1 / cos(step / 2).
    grown = points / math.cos(0.5 * half / steps) if steps else points
    turns = [half * k / steps for k in range(-steps, steps + 1)] if steps else [0.0]
    yaw = pose.nominal.yaw
    turned = np.concatenate([SE2(pose.x_m, pose.y_m, yaw + turn).act(grown) for turn in turns])
    corners = np.array([pose.spread.x_m, pose.spread.y_m]) * _SQUARE
    # Of the turned points, thousands, only those on their hull can be on that of the moved ones.
    return convex_hull((hull_or_line(turned)[None] + corners[:, None]).reshape(-1, 2))


def ancestors(scene: Scene, pose: PoseSpec) -> list[str]:
    """Return the units in whose frames a pose is given, directly or through each other, nearest first."""
    chain: list[str] = []
    while frame := split_frame(pose.frame):
        chain.append(frame[0])
        pose = scene.start_pose(frame[0])
    return chain


def region(scene: Scene, name: str, points: Array, within: str | None = None) -> Array:
    """Return the ground that ``points`` in a body's own frame, shape (N, 2) [m], can cover.

    It is returned in the frame U of the ancestor ``within``, in the world without one.
    """
    pose = scene.start_pose(name)
    frame = split_frame(pose.frame)
    if frame is not None and name in scene.units:
        points = scene.geometry(name).port(FRONT).inverse().act(points)
    reached = spread_over(pose, points)
    if frame is None:
        return reached
    unit, port = frame
    reached = scene.geometry(unit).dock_frame(port).act(reached)
    return reached if unit == within else region(scene, unit, reached, within)


def outline(scene: Scene, name: str) -> Array:
    """Return the outline of a unit or an obstacle in its own frame."""
    if name in scene.units:
        return scene.geometry(name).footprint
    return obstacle_outline(scene.obstacles[name])


def smallest_distance(scene: Scene, a: str, b: str) -> float:
    """Return a lower bound of the distance [m] of two bodies over all draws; 0 if they may overlap."""
    chains = {name: [name, *ancestors(scene, scene.start_pose(name))] for name in (a, b)}
    # A common ancestor moves both together, so they are compared in its frame.
    common = next((u for u in chains[a] if u in chains[b]), None)
    regions = [
        outline(scene, name) if name == common else region(scene, name, outline(scene, name), common)
        for name in (a, b)
    ]
    return distance(*regions)
