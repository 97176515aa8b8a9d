"""The line of sight to the docking target: the bearings of its edges, measured in the image."""

from __future__ import annotations

import math
from dataclasses import dataclass

from msrr_perception.estimation.corner_filter import CornerEkf
from msrr_perception.estimation.estimator import AHEAD_NS, Estimator
from msrr_perception.pose.target import TargetModel
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import (
    NS_PER_S,
    Detections,
    LosObservation,
    LosStatus,
    PoseEstimate,
    PoseMeasurement,
)

#: Time for which a measured edge counts as seen, and for which predictions are trusted without any detection
#: [ns]; longer where the newest frame is older than that, by the rate and the latency of the camera.
_SEEN_NS, _TRUSTED_NS = 300_000_000, 500_000_000

#: Number of frames in which every tag of a port is read: close to it they take turns.
_FRAMES = 3

#: A measured edge may lie this far, and so many standard deviations of the pose, from where the pose has it:
#: what lies farther is another tag with the same id, or a misread one.
_FARTHEST_RAD, _FARTHEST_SIGMAS = math.radians(3.0), 5.0


@dataclass(frozen=True, slots=True)
class _EdgeBearing:
    """The bearing [rad] of one edge in one exposure; that of a tag may be of another tag with the same id."""

    stamp_ns: int
    bearing: float
    of_tag: bool


def edge_bearings(target: TargetModel, X_DU: SE2) -> tuple[float, float]:
    """Return the bearings (left, right) of the target's edges from a pose, counter-clockwise positive [rad].

    Source: Zheng et al., eq. 21, with the camera anywhere on the unit and looking along its own axis.
    """
    left, right = _edges_in_camera(target, X_DU)
    return math.atan2(*left), math.atan2(*right)


def _edges_in_camera(target: TargetModel, X_DU: SE2) -> list[tuple[float, float]]:
    """Return how far (to the left, ahead) of the camera the left and the right edge are by a pose [m]."""
    (r00, r01, r02, p0), (r20, r21, r22, p2) = target.lateral_and_depth_rows
    c, s = math.cos(X_DU.yaw), math.sin(X_DU.yaw)
    edges = []
    for x_D, y_D, z in target.edge_points_D:
        dx, dy = x_D - X_DU.x, y_D - X_DU.y
        x, y = c * dx + s * dy, c * dy - s * dx  # in U
        edges.append((-(r00 * x + r01 * y + r02 * z + p0), r20 * x + r21 * y + r22 * z + p2))
    return edges


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
    not seen, or seen where the pose at that exposure rules it out, is *predicted* from the estimator's pose.
    The target is *lost* without a pose that rests on a recent detection of any tag.
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
        self._add(detections.exposure.stamp_ns, measured_bearings(self.target, detections), of_tags=True)

    def add_pose(self, measurement: PoseMeasurement) -> None:
        """Add the bearings of a measured pose."""
        self._add(measurement.exposure.stamp_ns, measurement.edge_bearings, of_tags=False)

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
        self._forget_the_future(now_ns)
        predicted = edge_bearings(self.target, estimate.X_DU)
        poses: dict[int, PoseEstimate | None] = {estimate.stamp_ns: estimate}
        seen_left = self._advanced(0, now_ns, predicted[0], estimate.stamp_ns, poses, estimator)
        seen_right = self._advanced(1, now_ns, predicted[1], estimate.stamp_ns, poses, estimator)
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
        predicted: float,
        stamp_ns: int,
        poses: dict[int, PoseEstimate | None],
        estimator: Estimator,
    ) -> float | None:
        """Return an edge's last bearing advanced to ``stamp_ns``; None when it was not measured recently.

        None as well where the pose at its exposure rules it out. ``predicted`` is the bearing by the pose at
        ``stamp_ns``; ``poses`` has that pose by its time, and those at other instants are added.
        """
        last = self._measured[side]
        if last is None or now_ns - last.stamp_ns > self._seen_ns:
            return None
        # The clock of the camera may be ahead, by as much as the filter has found.
        ahead_s = estimator.clock_ahead_s if isinstance(estimator, CornerEkf) else 0.0
        exposed_ns = last.stamp_ns - round(ahead_s * NS_PER_S)
        if exposed_ns not in poses:  # both edges were often measured in the same exposure
            poses[exposed_ns] = estimator.predict(exposed_ns)
        then = poses[exposed_ns]
        if then is None:
            return None
        left, ahead = _edges_in_camera(self.target, then.X_DU)[side]
        before = math.atan2(left, ahead)
        off = abs(math.remainder(last.bearing - before, 2.0 * math.pi))
        if last.of_tag and off > _FARTHEST_RAD and off > _farthest(then, math.hypot(left, ahead)):
            return None
        return last.bearing + math.remainder(predicted - before, 2.0 * math.pi)

    def _forget_the_future(self, now_ns: int) -> None:
        """Forget bearings of a time that no clock can show, for those that follow would seem to be older."""
        for side, last in enumerate(self._measured):
            if last is not None and last.stamp_ns - now_ns > AHEAD_NS:
                self._measured[side] = None

    def _add(self, stamp_ns: int, edges: tuple[float | None, float | None], of_tags: bool) -> None:
        for side, bearing in enumerate(edges):
            known = self._measured[side]
            if bearing is not None and (known is None or stamp_ns > known.stamp_ns):
                self._measured[side] = _EdgeBearing(stamp_ns, bearing, of_tags)


def _farthest(pose: PoseEstimate, distance: float) -> float:
    """Return how far a bearing may be from that of a pose, of an edge so far from the camera [rad]."""
    (xx, _, _), (_, yy, _), (_, _, yaw) = pose.covariance.tolist()
    sigma = math.sqrt(max(yaw, 0.0)) + math.sqrt(max(xx + yy, 0.0)) / max(distance, 1e-6)
    return _FARTHEST_RAD + _FARTHEST_SIGMAS * sigma
