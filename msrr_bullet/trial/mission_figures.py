"""The figures of a mission as a whole, from truth: how long, how far, how much at the same time, how near."""

from __future__ import annotations

import math
from collections.abc import Mapping

from msrr_bullet.collision.clearance import Clearance
from msrr_bullet.trial.docking_step import DockingStep
from msrr_bullet.trial.result import MissionFigures
from msrr_scenes.geometry.se2 import SE2, wrap_angle
from msrr_scenes.messages import seconds
from msrr_scenes.messages.coordination import MissionStatus
from msrr_scenes.outcome import Outcome

#: Velocities above which a unit counts as moving [m/s, rad/s].
_MOVES_MPS, _MOVES_RADPS = 0.01, 0.05


class MissionRecord:
    """Collects the figures while a mission is under way; its least clearance is infinite before the first."""

    def __init__(self, units: tuple[str, ...]) -> None:
        """Begin with nobody having moved."""
        self._way = dict.fromkeys(units, 0.0)
        self._poses: dict[str, SE2] = {}
        self._stamp_ns = 0
        self._moving_s = [0.0, 0.0]  # time in which one unit or more, two or more moved
        self._last_lock_s: float | None = None
        self.min_clearance, self._nearest_pair = math.inf, ""

    def note(self, now_ns: int, poses: Mapping[str, SE2], nearest: Clearance | None) -> None:
        """Take note of an instant: true poses of all bodies, and the smallest clearance."""
        dt = seconds(now_ns - self._stamp_ns)
        moving = 0
        for unit in self._way:
            before, X = self._poses.get(unit), poses[unit]
            self._poses[unit] = X
            if before is None or before is X or dt <= 0.0:  # a unit that is parked keeps its pose
                continue
            way, turn = math.hypot(X.x - before.x, X.y - before.y), abs(wrap_angle(X.yaw - before.yaw))
            if way > _MOVES_MPS * dt or turn > _MOVES_RADPS * dt:
                moving += 1
                self._way[unit] += way
        self._stamp_ns = now_ns
        for k in range(2):
            self._moving_s[k] += dt * (moving > k)
        if nearest is not None and nearest.distance < self.min_clearance:
            self.min_clearance = nearest.distance
            self._nearest_pair = "-".join(sorted((nearest.body_a, nearest.body_b)))

    def ended(self, now_ns: int, step: DockingStep) -> None:
        """Take note of a step that has ended."""
        if step.outcome is Outcome.DOCKED:
            self._last_lock_s = seconds(now_ns)

    def figures(self, status: MissionStatus, sent: int, lost: int) -> MissionFigures:
        """Return the figures of a mission that has ended; messages sent and lost are those of the radio."""
        return MissionFigures(
            makespan_s=self._last_lock_s,
            way_m=self._way,
            parallel_share=self._moving_s[1] / self._moving_s[0] if self._moving_s[0] > 0.0 else 0.0,
            messages_sent=sent,
            messages_lost=lost,
            replans=status.replans,
            done=status.done,
            given_up=status.given_up,
            min_clearance_m=self.min_clearance if math.isfinite(self.min_clearance) else None,
            nearest_pair=self._nearest_pair,
        )
