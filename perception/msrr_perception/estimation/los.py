"""The line of sight to the docking target: the angles of its edges, measured in the image."""

from __future__ import annotations

import math
from dataclasses import dataclass

from msrr_perception.estimation.estimator import Estimator
from msrr_perception.pose.target import TargetModel
from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import NS_PER_S, Detections, LosObservation, LosStatus, PoseMeasurement


@dataclass(frozen=True, slots=True)
class _Sight:
    """Bearing [rad] of one edge in one exposure."""

    stamp_ns: int
    bearing: float


def edge_bearings(target: TargetModel, X_DU: SE2) -> tuple[float, float]:
    """Return the bearings (left, right) of the target's edges from a pose, counter-clockwise positive [rad].

    Source: Zheng et al., eq. 21, with the camera anywhere on the unit and looking along its own axis.
    """
    (r00, r01, r02, p0), (r20, r21, r22, p2) = target.sideways_and_ahead
    c, s = math.cos(X_DU.yaw), math.sin(X_DU.yaw)

    def bearing(point: tuple[float, float, float]) -> float:
        dx, dy, z = point[0] - X_DU.x, point[1] - X_DU.y, point[2]
        x, y = c * dx + s * dy, c * dy - s * dx  # in U
        return math.atan2(-(r00 * x + r01 * y + r02 * z + p0), r20 * x + r21 * y + r22 * z + p2)

    left, right = target.edge_places_D
    return bearing(left), bearing(right)


def measured_bearings(target: TargetModel, detections: Detections) -> tuple[float | None, float | None]:
    """Return the bearings (left, right) of those edges whose tag was read [rad].

    An upright edge stands upright in the image of a level camera; the mean of its two corners' columns is it.
    """
    corners = {t.tag_id: t.corners for t in detections.tags}

    def bearing(side: int) -> float | None:
        edge = target.edges[side]
        if edge.tag_id not in corners:
            return None
        return float(target.camera.bearing(corners[edge.tag_id][list(edge.corners), 0].mean()))

    return bearing(0), bearing(1)


class LosEstimator:
    """Tells control under which angles the target's edges are seen.

    An edge measured in an image of the last moments is *seen* (close up, frames look at the tags in turn); it
    is turned on by as much as the estimator's poses say it has moved since that exposure. An edge that was
    not seen is *predicted* from the estimator's pose. Without a pose that rests on a recent sight of any tag,
    the target is *lost*.
    """

    def __init__(self, target: TargetModel, max_age_s: float = 0.3, lost_after_s: float = 0.5) -> None:
        """Set up an estimator that has seen nothing yet.

        Args:
            target: Camera and map of the tags.
            max_age_s: For how long a seen edge counts as seen.
            lost_after_s: For how long predictions are trusted without any tag seen.

        Raises:
            SceneError: A parameter out of its range.
        """
        if not 0.0 < max_age_s <= lost_after_s:
            raise SceneError("los: 0 < max_age_s <= lost_after_s is needed")
        self.target = target
        self._max_age_ns = round(max_age_s * NS_PER_S)
        self._lost_after_ns = round(lost_after_s * NS_PER_S)
        self._sights: list[_Sight | None] = [None, None]

    def reset(self) -> None:
        """Forget what was seen."""
        self._sights = [None, None]

    def add_detections(self, detections: Detections) -> None:
        """Take in one exposure; older ones than the newest known are of no use."""
        self._add(detections.exposure.stamp_ns, measured_bearings(self.target, detections))

    def add_pose(self, measurement: PoseMeasurement) -> None:
        """Take in the bearings of a ready-made measurement."""
        self._add(measurement.exposure.stamp_ns, measurement.edge_bearings)

    def observe(self, now_ns: int, estimator: Estimator) -> LosObservation:
        """Return the line of sight as it is at the time of the estimator's estimate.

        Args:
            now_ns: The time.
            estimator: Whose estimate is used for edges out of view, and to carry seen edges from their
                exposure to the time the estimate speaks of (now, or without delay compensation the last
                exposure).

        Returns:
            The angles; NaN when the target is lost and no pose is known.
        """
        estimate = estimator.estimate(now_ns)
        if estimate is None:
            return LosObservation(now_ns, math.nan, math.nan, math.nan, LosStatus.LOST)
        predicted = edge_bearings(self.target, estimate.X_DU)
        seen = [self._carried(side, now_ns, estimate.stamp_ns, predicted, estimator) for side in (0, 1)]
        left, right = (p if s is None else s for s, p in zip(seen, predicted, strict=True))
        if now_ns - estimate.last_seen_ns > self._lost_after_ns:
            status = LosStatus.LOST
        else:
            status = LosStatus.PREDICTED if None in seen else LosStatus.SEEN
        margin = self.target.camera.half_fov - max(abs(left), abs(right))
        return LosObservation(estimate.stamp_ns, left, right, margin, status)

    def _carried(
        self, side: int, now_ns: int, stamp_ns: int, predicted: tuple[float, float], estimator: Estimator
    ) -> float | None:
        """Return an edge's last seen bearing carried to ``stamp_ns``; None when it was not seen lately."""
        sight = self._sights[side]
        if sight is None or now_ns - sight.stamp_ns > self._max_age_ns:
            return None
        if sight.stamp_ns == stamp_ns:
            return sight.bearing
        then = estimator.predict(sight.stamp_ns)
        if then is None:
            return None
        turned = predicted[side] - edge_bearings(self.target, then.X_DU)[side]
        return sight.bearing + math.remainder(turned, 2.0 * math.pi)

    def _add(self, stamp_ns: int, edges: tuple[float | None, float | None]) -> None:
        for side, bearing in enumerate(edges):
            known = self._sights[side]
            if bearing is not None and (known is None or stamp_ns > known.stamp_ns):
                self._sights[side] = _Sight(stamp_ns, bearing)
