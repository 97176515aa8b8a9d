"""The line of sight to the docking target: the bearings of its edges, measured in the image."""

from __future__ import annotations

import math
from dataclasses import dataclass

from msrr_perception.estimation.estimator import Estimator
from msrr_perception.pose.target import TargetModel
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import NS_PER_S, Detections, LosObservation, LosStatus, PoseMeasurement

#: Time for which a measured edge counts as seen, and for which predictions are trusted without any detection
#: [ns]; longer where the newest frame is older than that, by the rate and the latency of the camera.
_SEEN_NS, _TRUSTED_NS = 300_000_000, 500_000_000

#: Number of frames in which every tag of a port is read: close to it they take turns.
_FRAMES = 3


@dataclass(frozen=True, slots=True)
class _EdgeBearing:
    """The bearing [rad] of one edge in one exposure."""

    stamp_ns: int
    bearing: float


def edge_bearings(target: TargetModel, X_DU: SE2) -> tuple[float, float]:
    """Return the bearings (left, right) of the target's edges from a pose, counter-clockwise positive [rad].

    Source: Zheng et al., eq. 21, with the camera anywhere on the unit and looking along its own axis.
    """
    (r00, r01, r02, p0), (r20, r21, r22, p2) = target.lateral_and_depth_rows
    c, s = math.cos(X_DU.yaw), math.sin(X_DU.yaw)
    bearings = []
    for x_D, y_D, z in target.edge_points_D:
        dx, dy = x_D - X_DU.x, y_D - X_DU.y
        x, y = c * dx + s * dy, c * dy - s * dx  # in U
        bearings.append(math.atan2(-(r00 * x + r01 * y + r02 * z + p0), r20 * x + r21 * y + r22 * z + p2))
    left, right = bearings
    return left, right


def measured_bearings(target: TargetModel, detections: Detections) -> tuple[float | None, float | None]:
    """Return the bearings (left, right) of those edges whose tag was read [rad].

    An upright edge is upright in the image of a level camera, so its column is the mean of its corners'.
    """
    corners = {t.tag_id: t.corners for t in detections.tags}

    def bearing(side: int) -> float | None:
        edge = target.edges[side]
        of_tag = corners.get(edge.tag_id)
        if of_tag is None:
            return None
        lower, upper = edge.corners
        return float(target.camera.bearing(0.5 * (of_tag[lower, 0] + of_tag[upper, 0])))

    return bearing(0), bearing(1)


class LosEstimator:
    """Estimates the bearings of the target's edges.

    An edge measured in a recent image is *seen* (close to the target, frames read the tags in turn); its
    bearing is advanced by the motion since that exposure, as the estimator's poses give it. An edge that was
    not seen is *predicted* from the estimator's pose. The target is *lost* without a pose that rests on a
    recent detection of any tag.
    """

    def __init__(self, target: TargetModel) -> None:
        """Create an estimator that has seen nothing yet, with the camera and the map of the tags."""
        self.target = target
        oldest_ns = round((target.latency_s + _FRAMES * target.frame_period_s) * NS_PER_S)
        self._seen_ns, self._trusted_ns = max(_SEEN_NS, oldest_ns), max(_TRUSTED_NS, oldest_ns)
        self.reset()

    def reset(self) -> None:
        """Forget all measured bearings."""
        self._measured: list[_EdgeBearing | None] = [None, None]

    def add_detections(self, detections: Detections) -> None:
        """Add the tags of one exposure; an older one than the newest known changes nothing."""
        self._add(detections.exposure.stamp_ns, measured_bearings(self.target, detections))

    def add_pose(self, measurement: PoseMeasurement) -> None:
        """Add the bearings of a measured pose."""
        self._add(measurement.exposure.stamp_ns, measurement.edge_bearings)

    def observe(self, now_ns: int, estimator: Estimator) -> LosObservation:
        """Return the line of sight at the time of the estimator's estimate.

        Args:
            now_ns: Current time.
            estimator: Estimator whose pose predicts the edges out of view, and advances measured edges from
                their exposure to the time of the estimate (now, or without delay compensation the last
                exposure).

        Returns:
            The bearings; NaN when the target is lost and no pose is known.
        """
        estimate = estimator.estimate(now_ns)
        if estimate is None:
            return LosObservation(now_ns, math.nan, math.nan, math.nan, LosStatus.LOST)
        predicted = edge_bearings(self.target, estimate.X_DU)
        bearings = {estimate.stamp_ns: predicted}
        seen_left = self._advanced(0, now_ns, estimate.stamp_ns, bearings, estimator)
        seen_right = self._advanced(1, now_ns, estimate.stamp_ns, bearings, estimator)
        left = predicted[0] if seen_left is None else seen_left
        right = predicted[1] if seen_right is None else seen_right
        if now_ns - estimate.last_seen_ns > self._trusted_ns:
            status = LosStatus.LOST
        elif seen_left is None or seen_right is None:
            status = LosStatus.PREDICTED
        else:
            status = LosStatus.SEEN
        to_left, to_right = self.target.lens.field_of_view
        margin = min(to_left - max(left, right), to_right + min(left, right))
        return LosObservation(estimate.stamp_ns, left, right, margin, status)

    def _advanced(
        self,
        side: int,
        now_ns: int,
        stamp_ns: int,
        bearings: dict[int, tuple[float, float]],
        estimator: Estimator,
    ) -> float | None:
        """Return an edge's last bearing advanced to ``stamp_ns``; None when it was not measured recently.

        ``bearings`` has the bearings by pose at ``stamp_ns``; those at other instants are added.
        """
        last = self._measured[side]
        if last is None or now_ns - last.stamp_ns > self._seen_ns:
            return None
        if last.stamp_ns == stamp_ns:
            return last.bearing
        if last.stamp_ns not in bearings:  # both edges were often measured in the same exposure
            then = estimator.predict(last.stamp_ns)
            if then is None:
                return None
            bearings[last.stamp_ns] = edge_bearings(self.target, then.X_DU)
        turned = bearings[stamp_ns][side] - bearings[last.stamp_ns][side]
        return last.bearing + math.remainder(turned, 2.0 * math.pi)

    def _add(self, stamp_ns: int, edges: tuple[float | None, float | None]) -> None:
        for side, bearing in enumerate(edges):
            known = self._measured[side]
            if bearing is not None and (known is None or stamp_ns > known.stamp_ns):
                self._measured[side] = _EdgeBearing(stamp_ns, bearing)
