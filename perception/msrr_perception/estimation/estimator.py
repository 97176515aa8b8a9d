"""The estimator protocol, and the implementations that ship."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Protocol

from msrr_perception.estimation.corner_filter import CornerEkf
from msrr_scenes.messages import Detections, PoseEstimate, PoseMeasurement, WheelOdometry


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


ESTIMATORS: Mapping[str, Callable[..., Estimator]] = MappingProxyType({"corner_ekf": CornerEkf})
