"""The estimator protocol, and the implementations that ship."""

from __future__ import annotations

import math
from numbers import Integral
from typing import Protocol

import numpy as np

from msrr_perception.estimation.corner_filter import CornerEkf
from msrr_scenes.arrays import frozen
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.guarded import no_result, wrong
from msrr_scenes.messages import (
    NS_PER_S,
    Detections,
    ExposureCounts,
    PoseEstimate,
    PoseMeasurement,
    WheelOdometry,
    seconds,
)
from msrr_scenes.registry import ExtensionPoint


class Estimator(Protocol):
    """An object that estimates the docking unit's pose in the dock frame of its target from its own sensors.

    An implementation is built as ``Class(target, odometry, delay_compensation=..., **params)`` with a
    :class:`msrr_perception.pose.target.TargetModel` and an :class:`msrr_scenes.specs.sensors.OdometrySpec`.
    """

    def add_odometry(self, reading: WheelOdometry) -> None:
        """Add an encoder reading of the docking unit."""
        ...

    def add_detections(self, detections: Detections) -> None:
        """Add the tags of one exposure, which may lie in the past."""
        ...

    def add_pose(self, measurement: PoseMeasurement) -> None:
        """Add a measured pose of one exposure, which may lie in the past."""
        ...

    def predict(self, stamp_ns: int) -> PoseEstimate | None:
        """Return the pose at an instant, past or future, for planning; None while nothing is known."""
        ...

    def estimate(self, now_ns: int) -> PoseEstimate | None:
        """Return the pose for control: of now, or without delay compensation of the last exposure."""
        ...

    def reset(self) -> None:
        """Forget the pose, but not the encoder readings."""
        ...


#: Farthest place, largest variance and latest time of an estimate that can be reckoned with [m, rad, ns]. No
#: arena is as wide; a distance in millimetres is more, but for the last tenth of a metre.
_FARTHEST_M, _LARGEST_VARIANCE, _LATEST_NS = 100.0, 1e9, 2**62

#: Largest time by which the clock of a camera, and with it the stamp of an exposure, can be ahead [ns].
AHEAD_NS = NS_PER_S


def _pose(result: object) -> PoseEstimate | None:
    """Return the pose of a class of a user's own; a ValueError says what is wrong with it."""
    if result is None:
        return None
    if not isinstance(result, PoseEstimate) or not isinstance(result.X_DU, SE2):
        wrong(result, "a PoseEstimate with a pose X_DU in SE(2), or None")
    X = result.X_DU
    if not all(map(math.isfinite, (X.x, X.y, X.yaw))):
        wrong(X, "a pose of finite numbers")
    if max(abs(X.x), abs(X.y)) > _FARTHEST_M:
        wrong(X, f"a pose in metres, no farther than {_FARTHEST_M:g} m from the port")
    try:
        covariance = np.asarray(result.covariance)
    except ValueError:  # rows of different lengths
        wrong(result.covariance, "a covariance of numbers of shape (3, 3)")
    if covariance.shape != (3, 3) or covariance.dtype.kind not in "fiu":
        found = f"shape {covariance.shape} and type {covariance.dtype}"
        raise ValueError(f"a covariance of {found}; expected real numbers of shape (3, 3)")
    if not (np.abs(covariance) <= _LARGEST_VARIANCE).all():
        wrong(covariance.tolist(), f"a covariance of numbers up to {_LARGEST_VARIANCE:g}")
    variances = np.linalg.eigvalsh(0.5 * (covariance + covariance.T))
    rounding = 1e-9 * variances[-1]
    if variances[0] < -rounding or np.abs(covariance - covariance.T).max() > rounding:
        wrong(covariance.tolist(), "a covariance that is symmetric and not negative")
    for stamp in (result.stamp_ns, result.last_seen_ns):
        if not isinstance(stamp, Integral) or abs(int(stamp)) > _LATEST_NS:
            wrong(stamp, "a time in whole nanoseconds")
    if result.stamp_ns < 0:  # an exposure can have been before a trial by the clock of a camera
        wrong(result.stamp_ns, "the time of the pose in a trial, which begins at 0")
    if not (result.exposures is None or isinstance(result.exposures, ExposureCounts)):
        wrong(result.exposures, "ExposureCounts, or None")
    covariance = frozen(covariance.astype(float))
    return PoseEstimate(int(result.stamp_ns), X, covariance, int(result.last_seen_ns), result.exposures)


def _prediction(
    result: object, asked_ns: int, ahead: str = "ahead of the instant asked for"
) -> PoseEstimate | None:
    """Return the pose of a class of a user's own, whose times are not far ahead of the instant asked for."""
    pose = _pose(result)
    if pose is None:
        return None
    for name in ("stamp_ns", "last_seen_ns"):
        ahead_ns = getattr(pose, name) - asked_ns
        if ahead_ns > AHEAD_NS:
            raise ValueError(
                f"a {name} that is {seconds(ahead_ns):.3f} s {ahead}; expected the time of the pose, "
                "or of an exposure that was added"
            )
    return pose


def _estimate(result: object, now_ns: int) -> PoseEstimate | None:
    """Return the pose of a class of a user's own for control, which is not of the future."""
    return _prediction(result, now_ns, "in the future")


ESTIMATORS: ExtensionPoint[Estimator] = ExtensionPoint(
    "estimator",
    {"corner_ekf": CornerEkf},
    methods={
        "add_odometry": no_result,
        "add_detections": no_result,
        "add_pose": no_result,
        "predict": _prediction,
        "estimate": _estimate,
        "reset": no_result,
    },
)
