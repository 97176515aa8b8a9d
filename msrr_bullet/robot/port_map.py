"""The least distances of a unit at a port from its neighbours, over the poses that the unit may have."""

from __future__ import annotations

import math
from collections.abc import Mapping

from msrr_bullet.collision.clearance import Clearance
from msrr_bullet.collision.clearance_model import ClearanceModel
from msrr_bullet.robot.local_map import OFFSET, LocalMap
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import ArenaEstimate


class PortMap(LocalMap):
    """The neighbours of a port in its dock frame D, about a unit that docks there by its own camera.

    From the clearances of other maps the collision monitor subtracts ``sigmas`` standard deviations of the
    worst point of a body in the worst direction. At a port that is more than can be lost: a unit knows its
    gap and its yaw worst, a neighbour that it passes with a corner becomes no nearer by a turn about the
    axle, and the port itself limits where the unit can be. So the distances of this map are the smallest of
    all poses on or in the ellipsoid of ``sigmas`` standard deviations that matter:

    - For a neighbour in its seat those with the pins before the holes. Where the gap is smaller the pins are
      in the holes, which keep the unit farther from the neighbour than its limit.
    - For any other neighbour those with a gap that is not negative.

    Distances are taken to be linear in the errors of the poses. A shift of the unit leaves it no nearer than
    that, because the distance of convex bodies is a convex function of their places.
    """

    def __init__(
        self,
        model: ClearanceModel,
        arena: ArenaEstimate,
        reaches: Mapping[str, float],
        sigmas: float,
        offset: float,
        least_gaps: Mapping[str, float],
    ) -> None:
        """Collect the estimates.

        Poses of the arena are in D, and may be wrong by ``sigmas`` standard deviations. ``reaches`` are the
        largest distances of the footprints from the origins of their bodies, ``offset`` is that of the face
        of the unit's port ahead of its axle, and ``least_gaps`` are the smallest gaps at which each neighbour
        matters [m].
        """
        super().__init__(model, arena, reaches, least_gaps)
        self._doubt, self._offset, self._least_gaps = sigmas, offset, least_gaps
        self._own_covariance = _entries(arena.own.relative)
        self._covariances = {b.name: _entries(b.relative) for b in arena.others}

    def uncertainty(self, sigmas: float) -> float:
        """Return 0: the uncertainty of the estimates is subtracted already [m]."""
        return 0.0

    def least(self, X_WU: SE2, present: Clearance) -> float:
        """Return the smallest possible clearance of the unit at ``X_WU`` [m], a pose in D here."""
        return self.distance(X_WU)

    def distance(self, X_WU: SE2) -> float:
        """Return the smallest possible clearance of the unit at ``X_WU`` [m], a pose in D here."""
        least = math.inf
        for name, X_WB in self._poses.items():
            clearance = self._model.nearest(self._own, X_WU @ OFFSET, {name: X_WB})
            if clearance is not None:
                least = min(least, clearance.distance - self._loss(clearance, X_WU, name, X_WB))
        return least

    def _loss(self, clearance: Clearance, X_DU: SE2, name: str, X_DB: SE2) -> float:
        """Return by how much the clearance from a body may be smaller than with the estimated poses [m]."""
        if clearance.distance <= 0.0:
            return self._doubt * self.sigmas[name]
        own, other = clearance.point_a, clearance.point_b
        if clearance.body_a == name:
            own, other = other, own
        nx, ny = (own[0] - other[0]) / clearance.distance, (own[1] - other[1]) / clearance.distance
        # The distance grows by these when the poses (x, y, yaw) of the unit and, negative, of the body grow.
        by_pose = (nx, ny, ny * (own[0] - X_DU.x) - nx * (own[1] - X_DU.y))
        by_body = (nx, ny, ny * (other[0] - X_DB.x) - nx * (other[1] - X_DB.y))
        gap_by_pose = (-1.0, 0.0, self._offset * math.sin(X_DU.yaw))
        P = self._own_covariance
        return -_least_change(
            _product(by_pose, P, by_pose) + _product(by_body, self._covariances[name], by_body),
            _product(gap_by_pose, P, by_pose),
            _product(gap_by_pose, P, gap_by_pose),
            self._least_gaps[name] + X_DU.x + self._offset * math.cos(X_DU.yaw),
            self._doubt,
        )


def _least_change(
    variance: float, covariance: float, variance_of_limited: float, at_least: float, sigmas: float
) -> float:
    """Return the smallest change of a linear function over the part of an ellipsoid on one side of a plane.

    It is at the point of the ellipsoid where the function is least, or else on the plane, where the ellipsoid
    is that of the conditional distribution. Where the ellipsoid ends before the plane, it is at the point of
    the plane that is most likely. ``variance`` is that of the function, and ``covariance`` that of the
    function and the quantity that the plane limits, which changes by ``at_least``. ``sigmas`` is the size of
    the ellipsoid.
    """
    sigma = math.sqrt(variance)
    if -sigmas * covariance >= at_least * sigma:
        return -sigmas * sigma
    if variance_of_limited <= 0.0:
        return -sigmas * sigma
    slope = covariance / variance_of_limited
    left = max(variance - slope * covariance, 0.0)
    inside = max(sigmas * sigmas - at_least * at_least / variance_of_limited, 0.0)
    return slope * at_least - math.sqrt(inside * left)


_Rows = tuple[tuple[float, float, float], ...]


def _entries(covariance: Array) -> _Rows:
    """Return the entries of a matrix, shape (3, 3), as plain floats, with which small sums are faster."""
    return tuple((a, b, c) for a, b, c in covariance.tolist())


def _product(a: tuple[float, float, float], P: _Rows, b: tuple[float, float, float]) -> float:
    """Return the bilinear form of a symmetric matrix."""
    return sum(x * (p * b[0] + q * b[1] + r * b[2]) for x, (p, q, r) in zip(a, P, strict=True))
