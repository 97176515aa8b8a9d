"""The trajectory of a unit that stops after one more command, and the clearance along the trajectory."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator

from msrr_bullet.robot.local_map import LocalMap
from msrr_control.kinematics.drive_limits import nested_limit, nested_limiter
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import NS_PER_S, GlobalPose, Twist, seconds
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.vehicle import LimitsSpec

#: Travel of the farthest point of the unit between two measurements of clearance [m].
_STEP_M = 0.01
#: Travel of the farthest point of the unit between two poses of an intent [m].
_INTENT_STEP_M = 0.05
#: Travel below which a unit counts as being at rest already [m].
_AT_REST_M = 0.001
#: Longest time step with which the drive is simulated [s]. Steps end where a command arrives: one that is
#: taken 5 ms late turns a unit by half a degree more or less, millimetres at the end of a trajectory.
_STEP_S = 0.01
#: Times that are no farther apart are the same [s].
_SAME_S = 1e-9
#: Below these speeds a unit counts as stopped.
_STANDSTILL_MPS = 0.002
_STANDSTILL_RADPS = 0.01
#: Longest trajectory that is simulated [s], for limits of the drive that brake very slowly.
_MAX_TIME_S = 5.0


class StoppingTrajectory:
    """A model of the drive of a unit that predicts where a command leads.

    The trajectory of a command: the commands on the link arrive, then the command itself, and from the time
    at which the next command could arrive the unit brakes to a stop, all within the nested limits of Zheng et
    al., eq. 3. How far the drive lags behind that of the drawing is not known. So the trajectory begins at
    the larger of the speeds of two drives, one as drawn and one that lags by as much as is likely, and brakes
    as the latter does.
    """

    def __init__(self, scene: Scene) -> None:
        """Take limits, control rate and latency from the scene; the unit starts at rest."""
        self._limits = lim = scene.limits
        lag_s = scene.as_built.drive.longest_lag_s
        self._drawn = _Drive(lim, lim.kappa_per_s)
        self._lagging = _Drive(lim, 1.0 / (1.0 / lim.kappa_per_s + lag_s)) if lag_s else self._drawn
        self._period_s = 1.0 / scene.control.rate_hz
        self._latency_s = 1e-3 * scene.link.latency_ms
        self._delay_s = self._latency_s + self._period_s + 2.0 * _STEP_S + 1.0 / self._lagging.kappa
        self._command = Twist()  # the command that is in force in the drive
        self._link: deque[tuple[int, Twist]] = deque()  # commands with their times of arrival [ns]
        self._now_ns: int | None = None

    def advance(self, now_ns: int) -> None:
        """Simulate the drive up to ``now_ns``."""
        before_ns = now_ns if self._now_ns is None else self._now_ns
        while self._link and self._link[0][0] <= now_ns:
            arrival_ns, command = self._link.popleft()
            self._follow(seconds(arrival_ns - before_ns))
            before_ns, self._command = arrival_ns, command
        self._follow(seconds(now_ns - before_ns))
        self._now_ns = now_ns

    def send(self, command: Twist) -> None:
        """Add a command that is sent to the drive now."""
        assert self._now_ns is not None, "advance is called first"
        self._link.append((self._now_ns + round(self._latency_s * NS_PER_S), command))

    def present_pose(self, own: GlobalPose, now_ns: int) -> SE2:
        """Return ``X_WU`` at ``now_ns``, extrapolated from an estimate of the past if necessary."""
        age = seconds(max(now_ns - own.stamp_ns, 0))
        if age == 0.0:
            return own.X_WB
        return own.X_WB @ SE2.exp(self._drawn.v * age, 0.0, self._drawn.w * age)

    def min_clearance(
        self, command: Twist, X_WU: SE2, present: float, local_map: LocalMap, threshold: float
    ) -> float:
        """Return the smallest clearance along the trajectory of a command [m].

        The clearance of the unit is ``present``, and the exact value does not matter above ``threshold`` [m].
        """
        if present - self.max_travel(command, local_map.reach) >= threshold:
            return present
        smallest = last = present
        travel = 0.0
        for x, y, yaw, step in self._poses(command, local_map.reach):
            travel += step
            # No point of the unit has moved farther than `travel`, so no distance has shrunk by more.
            if travel >= _STEP_M and travel >= last - threshold:
                last, travel = local_map.distance(X_WU @ SE2(x, y, yaw)), 0.0
                smallest = min(smallest, last)
        if travel > 0.0 and last - travel < threshold:
            smallest = min(smallest, local_map.distance(X_WU @ SE2(x, y, yaw)))
        return smallest

    def stopping_poses(self, X_WU: SE2, reach: float) -> list[SE2]:
        """Return poses that a unit at ``X_WU`` would pass if it stopped now, about 5 cm apart; none at rest.

        ``reach`` is the largest distance of its footprint from the origin of U [m].
        """
        poses: list[SE2] = []
        travel, last = 0.0, SE2()
        for x, y, yaw, step in self._poses(Twist(), reach):
            travel, last = travel + step, SE2(x, y, yaw)
            if travel >= _INTENT_STEP_M:
                poses.append(X_WU @ last)
                travel = 0.0
        return [*poses, X_WU @ last] if travel > _AT_REST_M else poses

    def max_travel(self, command: Twist, reach: float) -> float:
        """Return an upper bound of the travel of any point of the unit on the trajectory [m]."""
        v, w = abs(command.v), abs(command.w)
        for earlier in (self._command, *(sent for _, sent in self._link)):
            v, w = max(v, abs(earlier.v)), max(w, abs(earlier.w))
        lim = self._limits
        v_now, w_now = self._fastest()
        v, w = max(abs(v_now), min(v, lim.v_max_mps)), max(abs(w_now), min(w, lim.w_max_radps))
        braking = 0.5 * v**2 / lim.a_max_mps2 + 0.5 * reach * w**2 / lim.dw_max_radps2
        return (v + reach * w) * self._delay_s + braking

    def _poses(self, command: Twist, reach: float) -> Iterator[tuple[float, float, float, float]]:
        """Yield the poses of a trajectory, as plain floats and written out: there are dozens per command.

        Yields:
            The pose (x, y, yaw) in the present frame U, and the travel of the farthest point of the unit
            since the pose before.
        """
        drive, sin, cos = self._lagging, math.sin, math.cos
        follow_v, follow_w = drive.follow_v, drive.follow_w
        upcoming = self._upcoming(command)
        v_now, w_now = self._fastest()
        x, y, yaw, t = 0.0, 0.0, 0.0, 0.0
        while t < _MAX_TIME_S:
            while upcoming and upcoming[0][0] <= t + _SAME_S:
                _, in_force = upcoming.popleft()
                v_sent, w_sent = in_force.v, in_force.w
            step = _STEP_S
            if upcoming and upcoming[0][0] - t < step:
                step = upcoming[0][0] - t
                v_next, w_next = drive.after(v_now, w_now, v_sent, w_sent, step)
            else:
                v_next, w_next = follow_v(v_now, v_sent), follow_w(w_now, w_sent)
            v, w = 0.5 * (v_now + v_next), 0.5 * (w_now + w_next)
            speed, rate = abs(v), abs(w)
            if speed < _STANDSTILL_MPS and rate < _STANDSTILL_RADPS and not upcoming:
                return
            v_now, w_now = v_next, w_next
            t += step
            length, turn = v * step, w * step  # of an arc
            if -1e-6 < turn < 1e-6:
                dx, dy = (1.0 - turn * turn / 6.0) * length, 0.5 * turn * length
            else:
                half = 0.5 * turn
                dx, dy = sin(turn) / turn * length, sin(half) ** 2 / half * length
            c, s = cos(yaw), sin(yaw)
            x, y = x + c * dx - s * dy, y + s * dx + c * dy
            yaw += turn
            yield x, y, yaw, (speed + reach * rate) * step

    def _upcoming(self, command: Twist) -> deque[tuple[float, Twist]]:
        """Return the commands of the drive, and the times from now on [s], if ``command`` is sent now."""
        upcoming = deque([(0.0, self._command)])
        for arrival_ns, sent in self._link:
            upcoming.append((seconds(arrival_ns - (self._now_ns or 0)), sent))
        upcoming.append((self._latency_s, command))
        upcoming.append((self._latency_s + self._period_s, Twist()))  # when the next command could arrive
        return upcoming

    def _follow(self, dt: float) -> None:
        """Let the command that is in force act for ``dt`` [s]."""
        self._drawn.follow(self._command, dt)
        if self._lagging is not self._drawn:
            self._lagging.follow(self._command, dt)

    def _fastest(self) -> tuple[float, float]:
        """Return the largest speed and turn rate that the unit may have now, with their signs."""
        drawn, lagging = self._drawn, self._lagging
        return max(drawn.v, lagging.v, key=abs), max(drawn.w, lagging.w, key=abs)


class _Drive:
    """A drive with the nested limits, as it follows commands, from rest on.

    Attributes:
        kappa: Bandwidth of its inner loop [1/s].
        follow_v: Speed [m/s] a step of ``_STEP_S`` later, by the present one and the command.
        follow_w: Turn rate [rad/s], likewise.
        v: Present speed [m/s].
        w: Present turn rate [rad/s].
    """

    def __init__(self, limits: LimitsSpec, kappa: float) -> None:
        """Begin at rest."""
        self._limits, self.kappa = limits, kappa
        self.follow_v = nested_limiter(limits.v_max_mps, limits.a_max_mps2, kappa, _STEP_S)
        self.follow_w = nested_limiter(limits.w_max_radps, limits.dw_max_radps2, kappa, _STEP_S)
        self.v = self.w = 0.0

    def follow(self, command: Twist, dt: float) -> None:
        """Follow a command that is in force for ``dt`` [s]."""
        v_sent, w_sent = float(command.v), float(command.w)
        while dt > _SAME_S:
            step = min(_STEP_S, dt)
            self.v, self.w = self.after(self.v, self.w, v_sent, w_sent, step)
            dt -= step

    def after(self, v: float, w: float, v_sent: float, w_sent: float, step: float) -> tuple[float, float]:
        """Return the speeds one step of at most ``_STEP_S`` later."""
        if step == _STEP_S:  # nearly all are
            return self.follow_v(v, v_sent), self.follow_w(w, w_sent)
        lim = self._limits
        return (
            nested_limit(v, v_sent, lim.v_max_mps, lim.a_max_mps2, self.kappa, step),
            nested_limit(w, w_sent, lim.w_max_radps, lim.dw_max_radps2, self.kappa, step),
        )
