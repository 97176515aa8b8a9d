"""The unit before its port in the few estimated figures by which the phases decide."""

from __future__ import annotations

import math
from typing import NamedTuple

from msrr_control.docking.law import DockSetup
from msrr_scenes.geometry.se2 import wrap_angle
from msrr_scenes.messages import LosObservation, LosStatus, PoseEstimate, seconds


class PortView(NamedTuple):
    """The estimated place of the docking unit before its target.

    Attributes:
        gap: Distance between the two faces along the docking axis, negative if they overlap [m].
        lateral: Offset of the active port's face from the docking axis, left of it positive [m].
        yaw: Heading against the docking axis [rad].
        bearing: Angle from the camera's axis to the middle of the line-of-sight target, left positive [rad].
        widest_edge: Larger magnitude of the two edge angles [rad].
        sigma_gap: Standard deviation of ``gap`` [m].
        sigma_lateral: Standard deviation of ``lateral`` [m].
        sigma_yaw: Standard deviation of ``yaw`` [rad].
        age: Time since the exposure of the last accepted measurement [s].
        last_seen_ns: Time of that exposure.
    """

    gap: float
    lateral: float
    yaw: float
    bearing: float
    widest_edge: float
    sigma_gap: float
    sigma_lateral: float
    sigma_yaw: float
    age: float
    last_seen_ns: int

    def __str__(self) -> str:
        return (
            f"{1e3 * self.gap:z.1f} mm, lateral {1e3 * self.lateral:z.1f} mm,"
            f" {math.degrees(self.yaw):z.1f} deg (sigma {1e3 * self.sigma_gap:.1f} mm,"
            f" {1e3 * self.sigma_lateral:.1f} mm, {math.degrees(self.sigma_yaw):.1f} deg)"
        )

    @classmethod
    def of(cls, pose: PoseEstimate, los: LosObservation | None, setup: DockSetup, now_ns: int) -> PortView:
        """Derive the view from the estimate; edge angles come from the image if the target is seen there."""
        X, target = pose.X_DU, setup.los
        c, s = math.cos(X.yaw), math.sin(X.yaw)
        ahead = target.setback_m - X.x - setup.camera_offset * c
        y_camera = X.y + setup.camera_offset * s
        if los is not None and los.status is not LosStatus.LOST:
            left, right = los.left, los.right
        else:
            left, right = (
                wrap_angle(math.atan2(b - y_camera, ahead) - X.yaw)
                for b in (target.half_width_m, -target.half_width_m)
            )
        P = pose.covariance.tolist()
        along, across = setup.offset * s, setup.offset * c
        return cls(
            gap=-(X.x + setup.offset * c),
            lateral=X.y + setup.offset * s,
            yaw=X.yaw,
            bearing=wrap_angle(math.atan2(-y_camera, ahead) - X.yaw),
            widest_edge=max(abs(left), abs(right)),
            sigma_gap=_sigma(P[0][0] - 2.0 * along * P[0][2] + along * along * P[2][2]),
            sigma_lateral=_sigma(P[1][1] + 2.0 * across * P[1][2] + across * across * P[2][2]),
            sigma_yaw=_sigma(P[2][2]),
            age=seconds(now_ns - pose.last_seen_ns),
            last_seen_ns=pose.last_seen_ns,
        )

    def gap_at(self, aside: float) -> float:
        """Return the gap at a place of the face that lies ``aside`` of its middle, left positive [m]."""
        return self.gap + aside * math.sin(self.yaw)

    def off_seat(self, seated_gap: float) -> float:
        """Return the distance [m] from the place of a seated unit."""
        return math.hypot(self.gap - seated_gap, self.lateral)


def _sigma(variance: float) -> float:
    """Return the square root of a variance, which rounding may have made negative."""
    return math.sqrt(max(variance, 0.0))
