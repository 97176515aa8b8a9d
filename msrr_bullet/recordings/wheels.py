"""Wheel angles from what a recording says of the motion."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.urdf_file import WheelJoint

WHEELS, JOINT_STATE, ODOMETRY = "msrr.WheelOdometry", "sensor_msgs/msg/JointState", "nav_msgs/msg/Odometry"

#: Largest angle of a joint that wraps at -pi and pi, and how far from a whole turn it jumps there [rad].
_WRAPS, _WRAP_JUMP = math.pi + 0.01, 1.0


@dataclass
class WheelReader:
    """Reads the angles of both wheels from messages: ours, joint states, or a pose by odometry.

    A pose is turned into the angles by which wheels without any slip would have driven there. The radius of
    the wheels and the distance between them, ``track``, are in metres. ``joints`` are those of the left and
    the right wheel in joint states; None if others tell of them.
    """

    radius: float
    track: float
    joints: tuple[WheelJoint, WheelJoint] | None = None
    _pose: SE2 | None = field(default=None, init=False)
    _told: dict[str, float] = field(default_factory=dict, init=False)  # angle of each joint as it was told
    _widest: dict[str, float] = field(default_factory=dict, init=False)  # largest angle that was told
    _turns: dict[str, float] = field(default_factory=dict, init=False)  # by which that has wrapped [rad]
    _left: float = field(default=0.0, init=False)
    _right: float = field(default=0.0, init=False)

    def angles(self, schema: str, message: Any) -> tuple[float, float] | None:
        """Return the angles of both wheels [rad], left first, forwards positive; None if it tells none."""
        if schema == WHEELS:
            return float(message.left), float(message.right)
        if schema == JOINT_STATE:
            assert self.joints is not None
            known = dict(zip(message.name, message.position, strict=False))
            if any(joint.name not in known for joint in self.joints):
                return None
            first, second = (
                joint.forward * self._unwrapped(joint.name, float(known[joint.name])) for joint in self.joints
            )
            return first, second
        return self._driven(message.pose.pose)

    def _unwrapped(self, joint: str, angle: float) -> float:
        """Return the angle of a wheel with the turns that a driver leaves out which tells of -pi to pi."""
        before, self._told[joint] = self._told.get(joint, angle), angle
        jump, self._widest[joint] = angle - before, max(self._widest.get(joint, 0.0), abs(angle))
        if self._widest[joint] < _WRAPS and abs(abs(jump) - 2.0 * math.pi) < _WRAP_JUMP:
            self._turns[joint] = self._turns.get(joint, 0.0) - math.copysign(2.0 * math.pi, jump)
        return angle + self._turns.get(joint, 0.0)

    def _driven(self, pose: Any) -> tuple[float, float] | None:
        q = pose.orientation
        ww, xx, yy, zz = q.w * q.w, q.x * q.x, q.y * q.y, q.z * q.z
        yaw = math.atan2(2.0 * (q.w * q.z + q.x * q.y), ww + xx - yy - zz)
        X = SE2(float(pose.position.x), float(pose.position.y), yaw)
        # A pose that is no number would stay in the sums below; four zeros are a rotation nobody has set.
        if not all(map(math.isfinite, (X.x, X.y, X.yaw))) or ww + xx + yy + zz == 0.0:
            return None
        if self._pose is not None:
            forward, _, turn = (float(part) for part in (self._pose.inverse() @ X).log())
            self._left += (forward - 0.5 * turn * self.track) / self.radius
            self._right += (forward + 0.5 * turn * self.track) / self.radius
        self._pose = X
        return self._left, self._right
