"""The body of a unit on the ground: its outline, gaps between bodies, and where it stands when docked."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.unit_geometry import UnitGeometry
from msrr_scenes.messages import ObstacleEstimate

#: Port by which units dock to others.
ACTIVE_PORT = "front"

#: Error of the distance between two units, to the next millimetre, for which the gaps between moving bodies
#: have room [m]: that of robots which are built with care (two standard deviations).
_EXPECTED_ERROR_M = 0.011

#: Gap to a body beside the start up to which a route may only lead away [m]: what the collision monitor keeps
#: (30 mm), what the body may be nearer than it seems (11 mm), and some millimetres off the path.
BESIDE_GAP_M = 0.045

#: Loss of such a gap that counts as none [m].
LOSS_M = 0.001

#: Covariance of the pose of a unit in a port, in x, y and yaw [m, rad]: the play of pins in their holes.
SEATED = np.diag([0.0009**2, 0.0009**2, math.radians(0.2) ** 2])

#: Distance below which two corners of an outline count as one [m].
_SAME_CORNER_M = 1e-6


@dataclass(frozen=True, eq=False)
class Body:
    """What coordination knows about the form of the units, which are all alike.

    Attributes:
        outline: Corners of the convex outline in U, counter-clockwise, shape (N, 2) [m].
        dock_frames: Dock frame ``X_UD`` of each passive port.
        offset: l, distance of the active port's face ahead of the axle [m].
        extra_gap: What moving bodies stay farther apart than robots that are built with care, because the
            distance between two of them is known less well [m].
    """

    outline: Array
    dock_frames: Mapping[str, SE2]
    offset: float
    extra_gap: float = 0.0

    @classmethod
    def of(cls, geometry: UnitGeometry, distance_error: float = 0.0) -> Body:
        """Read the body from a unit's geometry.

        Two units that are beside each other may be nearer than they seem by ``distance_error`` [m].
        """
        points = geometry.footprint
        apart = np.linalg.norm(points - np.roll(points, 1, axis=0), axis=1)
        frames = {port: geometry.dock_frame(port) for port in geometry.passive_ports}
        extra_gap = max(1e-3 * math.ceil(1e3 * distance_error) - _EXPECTED_ERROR_M, 0.0)
        return cls(points[apart > _SAME_CORNER_M], frames, geometry.control_offset(ACTIVE_PORT), extra_gap)

    @cached_property
    def radius(self) -> float:
        """Radius of the circle about the outline [m]."""
        return float(np.linalg.norm(self.outline, axis=1).max())

    @cached_property
    def half_width(self) -> float:
        """Half the width of the body [m]."""
        return float(np.abs(self.outline[:, 1]).max())

    @cached_property
    def _core(self) -> float:
        """Radius of the largest circle about the axle inside the outline [m]."""
        return float(self._offsets.min())

    @cached_property
    def _normals(self) -> Array:
        """Outward unit normals of the edges in U, shape (N, 2)."""
        edge = np.roll(self.outline, -1, axis=0) - self.outline
        normal = np.stack([edge[:, 1], -edge[:, 0]], axis=-1)
        unit: Array = normal / np.linalg.norm(normal, axis=1, keepdims=True)
        return unit

    @cached_property
    def _offsets(self) -> Array:
        """Distances of the edges from the axle, shape (N,) [m]."""
        offsets: Array = np.einsum("ij,ij->i", self._normals, self.outline)
        return offsets

    def docked(self, X_WP: SE2, port: str) -> SE2:
        """Return the pose of a unit that is docked to ``port`` of a unit at ``X_WP``."""
        return X_WP @ self.dock_frames[port] @ SE2(-self.offset, 0.0, 0.0)

    def gap(self, X_WA: SE2, X_WB: SE2) -> float:
        """Return the gap between two bodies [m], negative where they overlap; see :meth:`gaps`."""
        return float(self.gaps(X_WA.as_array(), X_WB.as_array()))

    def gaps(self, a: Array, b: Array) -> Array:
        """Return the gaps between bodies at poses ``a`` and ``b``, shapes (..., 3) that broadcast [m].

        The gap is the widest strip between the bodies that is parallel to an edge of one of them. It is the
        distance where an edge is nearest, and less where two corners are: up to 8 % for the shipped outline,
        29 % for a square. Where the bodies overlap, it is negative.
        """
        first, second = np.broadcast_arrays(a, b)
        result: Array = np.maximum(self._strip(first, second), self._strip(second, first))
        return result

    def gaps_to_disc(self, poses: Array, x: float, y: float, radius: float) -> Array:
        """Return the gaps between bodies at ``poses``, shape (N, 3), and a disc [m], as :meth:`gaps` does."""
        c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
        dx, dy = x - poses[:, 0], y - poses[:, 1]
        middle = np.stack([c * dx + s * dy, c * dy - s * dx], axis=-1)
        beyond: Array = (middle @ self._normals.T - self._offsets).max(axis=1) - radius
        return beyond

    def comes_near(self, poses: Array, obstacle: ObstacleEstimate) -> bool:
        """Return whether a body at ``poses``, shape (N, 3), comes nearer to an obstacle than it may."""
        gaps = self.gaps_to_disc(poses, obstacle.X_WB.x, obstacle.X_WB.y, obstacle.radius)
        kept = min(float(gaps[0]), BESIDE_GAP_M + self.extra_gap) - LOSS_M
        return bool(gaps.min() < kept)

    def near(self, a: Array, b: Array, gap: Array | float) -> NDArray[np.bool_]:
        """Return which bodies at poses ``a`` and ``b``, shapes (..., 3), are nearer than ``gap`` [m]."""
        first, second = np.broadcast_arrays(a, b)
        wanted = np.broadcast_to(np.asarray(gap, dtype=np.float64), first.shape[:-1])
        distance = np.hypot(first[..., 0] - second[..., 0], first[..., 1] - second[..., 1])
        result: NDArray[np.bool_] = np.asarray(distance < 2.0 * self._core + wanted)
        doubtful = ~result & (distance < 2.0 * self.radius + wanted)
        result[doubtful] = self.gaps(first[doubtful], second[doubtful]) < wanted[doubtful]
        return result

    def _strip(self, a: Array, b: Array) -> Array:
        """Return how far the corners of ``b`` lie beyond the edge of ``a`` that separates them best."""
        c, s = np.cos(b[..., 2] - a[..., 2]), np.sin(b[..., 2] - a[..., 2])
        x, y = self.outline[:, 0], self.outline[:, 1]
        ca, sa = np.cos(a[..., 2]), np.sin(a[..., 2])
        dx, dy = b[..., 0] - a[..., 0], b[..., 1] - a[..., 1]
        px = (ca * dx + sa * dy)[..., None] + c[..., None] * x - s[..., None] * y
        py = (ca * dy - sa * dx)[..., None] + s[..., None] * x + c[..., None] * y
        nx, ny = self._normals[:, 0], self._normals[:, 1]
        beyond = nx * px[..., None] + ny * py[..., None] - self._offsets
        strip: Array = beyond.min(axis=-2).max(axis=-1)
        return strip
