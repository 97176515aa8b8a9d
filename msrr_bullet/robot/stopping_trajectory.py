"""How far a unit still goes after a command, and how near that brings it to what is known around it."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator, Mapping

from msrr_bullet.collision.clearance import Clearance
from msrr_bullet.collision.clearance_model import ClearanceModel
from msrr_control.kinematics.drive_limits import follower, nested_limit
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se2 import SE2, wrap_angle
from msrr_scenes.messages import NS_PER_S, ArenaEstimate, GlobalPose, ObstacleEstimate, Twist, seconds
from msrr_scenes.specs.scene import Scene

#: Way of the unit's farthest point between two measurements of clearance [m].
_STEP_M = 0.01
#: Time step with which the drive is followed [s].
_STEP_S = 0.01
#: Below these speeds a unit stands.
_STANDS_MPS = 0.002
_STANDS_RADPS = 0.01
#: FCL's search fails where two shapes face each other to within some micrometres (measured: a disc straight
#: before a face, 34 mm too far away), and a unit that is driven at something ends up just so. Measured from
#: here beside where it is, it never does.
_ASIDE = SE2(1.7e-4, 2.3e-4, 3e-4)
#: No way ahead takes longer than this [s]: limits that brake so slowly are not worth looking at farther.
_LONGEST_S = 5.0


class Surroundings:
    """What is known around one unit at one instant."""

    def __init__(
        self,
        model: ClearanceModel,
        situation: ArenaEstimate,
        reaches: Mapping[str, float],
        exempt: str | None = None,
    ) -> None:
        """Gather the estimates.

        Args:
            model: The shapes.
            situation: The estimates.
            reaches: Largest distance of every body's footprint from its own origin [m].
            exempt: A unit that may be touched.
        """
        self._model = model
        self._own = situation.own.name
        self._reaches = reaches
        self.reach = reaches[self._own]
        known: list[GlobalPose | ObstacleEstimate] = [
            situation.target,
            *situation.others,
            *situation.obstacles,
        ]
        bodies = [b for b in known if b.name != exempt]
        self._poses = {b.name: b.X_WB for b in bodies}
        own = _variance(situation.own.covariance, self.reach)
        others = max((_variance(b.covariance, reaches[b.name]) for b in bodies), default=0.0)
        #: Standard deviation of the distance between the unit and what is known least of the others [m].
        self.sigma = math.sqrt(own + others)

    def at_least(self, X_WU: SE2) -> float:
        """Return what the clearance at ``X_WU`` is at least [m], from the circles about all bodies."""
        apart = (
            math.hypot(X.x - X_WU.x, X.y - X_WU.y) - self._reaches[name] for name, X in self._poses.items()
        )
        return min(apart, default=math.inf) - self.reach

    def clearance(self, X_WU: SE2) -> Clearance | None:
        """Return the smallest clearance of the unit at ``X_WU``; None when there is nothing around it."""
        return self._model.nearest(self._own, X_WU @ _ASIDE, self._poses)

    def distance(self, X_WU: SE2) -> float:
        """Return the same as a number [m]; infinite when there is nothing around the unit."""
        clearance = self.clearance(X_WU)
        return math.inf if clearance is None else clearance.distance


def _variance(covariance: Array, reach: float) -> float:
    """Return the largest variance that a point of a body has in any direction [m^2]."""
    (a, c, _), (_, b, _), (_, _, turn) = covariance.tolist()
    return float(0.5 * (a + b) + math.hypot(0.5 * (a - b), c) + reach**2 * turn)


class StoppingTrajectory:
    """Follows a unit's drive through its commands, and says where a command would take it.

    The way ahead of a command: what is under way to the drive arrives, then the command, and when the next
    one could arrive the unit brakes to a stand, all behind the nested limits of Zheng et al., eq. 3.
    """

    def __init__(self, scene: Scene) -> None:
        """Take limits, control rate and latency from the scene; the unit stands."""
        self._limits = at = scene.limits
        self._follow_v = follower(at.v_max_mps, at.a_max_mps2, at.kappa_per_s, _STEP_S)
        self._follow_w = follower(at.w_max_radps, at.dw_max_radps2, at.kappa_per_s, _STEP_S)
        self._period_s = 1.0 / scene.control.rate_hz
        self._latency_s = 1e-3 * scene.link.latency_ms
        self._delay_s = self._latency_s + self._period_s + 2.0 * _STEP_S + 1.0 / at.kappa_per_s
        self.reset()

    def reset(self) -> None:
        """The unit stands and has no command."""
        self._speed = Twist()
        self._command = Twist()  # that the drive has now
        self._under_way: deque[tuple[int, Twist]] = deque()  # with their times of arrival
        self._now_ns: int | None = None

    def advance(self, now_ns: int) -> None:
        """Let the drive follow its commands up to now."""
        before_ns = now_ns if self._now_ns is None else self._now_ns
        while self._under_way and self._under_way[0][0] <= now_ns:
            arrived_ns, command = self._under_way.popleft()
            self._speed = self._follow(self._speed, self._command, seconds(arrived_ns - before_ns))
            before_ns, self._command = arrived_ns, command
        self._speed = self._follow(self._speed, self._command, seconds(now_ns - before_ns))
        self._now_ns = now_ns

    def passed(self, command: Twist) -> None:
        """Take note of a command that goes to the drive now."""
        assert self._now_ns is not None, "advance comes first"
        self._under_way.append((self._now_ns + round(self._latency_s * NS_PER_S), command))

    def present_pose(self, own: GlobalPose, now_ns: int) -> SE2:
        """Return ``X_WU`` now: an estimate that is not compensated for its delay is moved up to now."""
        age = seconds(max(now_ns - own.stamp_ns, 0))
        if age == 0.0:
            return own.X_WB
        return own.X_WB @ SE2.exp(self._speed.v * age, 0.0, self._speed.w * age)

    def closest(self, wish: Twist, X_WU: SE2, present: float, around: Surroundings, enough: float) -> float:
        """Return the smallest clearance on the way ahead of a command [m].

        Args:
            wish: The command.
            X_WU: Where the unit is.
            present: Its clearance there [m].
            around: What is known around it.
            enough: Clearance above which the exact value does not matter [m].
        """
        if present - self.longest(wish, around.reach) >= enough:
            return present
        closest = at_hand = present
        gone, x, y, yaw = 0.0, 0.0, 0.0, 0.0
        for x, y, yaw, way in self._stages(wish, around.reach):
            gone += way
            # No point of the unit has gone farther than `gone`, so no distance has shrunk by more.
            if gone >= _STEP_M and gone >= at_hand - enough:
                at_hand, gone = around.distance(X_WU @ SE2(x, y, yaw)), 0.0
                closest = min(closest, at_hand)
        if gone > 0.0 and at_hand - gone < enough:
            closest = min(closest, around.distance(X_WU @ SE2(x, y, yaw)))
        return closest

    def longest(self, wish: Twist, reach: float) -> float:
        """Return a length [m] that no point of the unit exceeds on its way ahead."""
        v, w = abs(wish.v), abs(wish.w)
        for _, command in ((0, self._command), *self._under_way):
            v, w = max(v, abs(command.v)), max(w, abs(command.w))
        at, speed = self._limits, self._speed
        v, w = max(abs(speed.v), min(v, at.v_max_mps)), max(abs(speed.w), min(w, at.w_max_radps))
        braking = 0.5 * v**2 / at.a_max_mps2 + 0.5 * reach * w**2 / at.dw_max_radps2
        return (v + reach * w) * self._delay_s + braking

    def _stages(self, wish: Twist, reach: float) -> Iterator[tuple[float, float, float, float]]:
        """Yield the way, many steps of it for every command, and so in plain floats.

        Yields:
            The pose (x, y, yaw) seen from the unit now, and how far its farthest point went since the last.
        """
        follow_v, follow_w = self._follow_v, self._follow_w
        coming = self._coming(wish)
        told = Twist()
        v_now, w_now = self._speed.v, self._speed.w
        x, y, yaw, t = 0.0, 0.0, 0.0, 0.0
        while t < _LONGEST_S:
            while coming and coming[0][0] <= t:
                _, told = coming.popleft()
            v_next, w_next = follow_v(v_now, told.v), follow_w(w_now, told.w)
            # The larger of both speeds: rather a millimetre too far than one too short.
            v = v_now if abs(v_now) >= abs(v_next) else v_next
            w = w_now if abs(w_now) >= abs(w_next) else w_next
            if not coming and abs(v) < _STANDS_MPS and abs(w) < _STANDS_RADPS:
                return
            v_now, w_now = v_next, w_next
            t += _STEP_S
            ahead, aside = _arc(v * _STEP_S, w * _STEP_S)
            c, s = math.cos(yaw), math.sin(yaw)
            x, y = x + c * ahead - s * aside, y + s * ahead + c * aside
            yaw = wrap_angle(yaw + w * _STEP_S)
            yield x, y, yaw, (abs(v) + reach * abs(w)) * _STEP_S

    def _coming(self, wish: Twist) -> deque[tuple[float, Twist]]:
        """Return what the drive will be told, and how far from now [s], if ``wish`` is sent now."""
        coming = deque([(0.0, self._command)])
        for arrival_ns, command in self._under_way:
            arrival = seconds(arrival_ns - (self._now_ns or 0))
            if arrival < self._latency_s:
                coming.append((arrival, command))
        coming.append((self._latency_s, wish))
        coming.append((self._latency_s + self._period_s, Twist()))  # when the next one could arrive
        return coming

    def _follow(self, speed: Twist, wish: Twist, dt: float) -> Twist:
        at = self._limits
        return Twist(
            nested_limit(float(speed.v), float(wish.v), at.v_max_mps, at.a_max_mps2, at.kappa_per_s, dt),
            nested_limit(float(speed.w), float(wish.w), at.w_max_radps, at.dw_max_radps2, at.kappa_per_s, dt),
        )


def _arc(way: float, turn: float) -> tuple[float, float]:
    """Return where an arc ends, ahead and to the left of where it began: :meth:`SE2.exp` without the pose."""
    if abs(turn) < 1e-6:
        return (1.0 - turn * turn / 6.0) * way, 0.5 * turn * way
    half = 0.5 * turn
    return math.sin(turn) / turn * way, math.sin(half) ** 2 / half * way
