"""The clearance guard: slows and stops what would bring the docking unit too close to anything it knows of.

It works on estimates alone and stands between the law and the drive. What it does not know of it cannot keep
away from, and it takes off every clearance what the estimates may be wrong by.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from msrr_bullet.collision.clearance import Clearance
from msrr_bullet.collision.clearance_model import ClearanceModel
from msrr_bullet.robot.stopping_trajectory import StoppingTrajectory, Surroundings
from msrr_scenes.messages import ArenaEstimate, Twist
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.scene import Scene

#: A way that loses no more clearance than this [m] counts as one that keeps it: rounding, and no more, for a
#: small loss allowed with every command adds up.
_LOSS_M = 1e-6
#: Halvings with which the largest harmless share of a command is found.
_HALVINGS = 4
#: Share of a command that is left where the clearance ahead has fallen to ``stop_m``.
_CREEP = 0.25


class MonitorState(Enum):
    """What the guard does with a command."""

    FREE = "free"
    SLOW = "slow"
    STOP = "stop"


@dataclass(frozen=True, slots=True)
class MonitorDecision:
    """The guard's answer to one command.

    Attributes:
        twist: What may be commanded.
        clearance: The smallest clearance of the unit at present, by the estimates; None when the guard is
            off and where nothing known is so near that it could matter.
        state: Whether the command passed as it was, slower (or in part), or not at all.
        ahead: Smallest clearance along the way that the whole command would lead [m], with what the
            estimates may be wrong by taken off; where ``clearance`` is None, what it is at least.
    """

    twist: Twist
    clearance: Clearance | None
    state: MonitorState
    ahead: float


class CollisionMonitor:
    """Limits commands of one docking unit during one step of the plan.

    It looks ahead to where the unit would stand if it braked as soon as the next command could make it
    (:class:`~msrr_bullet.robot.stopping_trajectory.StoppingTrajectory`) and takes the smallest clearance on
    that way:

    - at least ``slow_m``, or no less than at present: the command passes;
    - between ``stop_m`` and ``slow_m``: it passes slower, down to a creep;
    - less than ``stop_m``: the largest share of a creep passes that keeps ``stop_m``; if there is none, the
      turn alone when that keeps it; else nothing.

    A command that leads away always passes, however near the unit is.
    """

    def __init__(self, scene: Scene, step: DockStep) -> None:
        """Take shapes, limits and latencies from the scene; where bodies stand is not read."""
        self._spec = scene.control.guard
        self._own = step.unit
        self._target = step.target_unit
        self._model = ClearanceModel(scene)
        self._reaches = {unit: scene.geometry(unit).circumradius for unit in scene.units}
        self._reaches |= {name: spec.radius_m for name, spec in scene.obstacles.items()}
        self._way = StoppingTrajectory(scene)

    def reset(self) -> None:
        """Forget how fast the unit is: it stands."""
        self._way.reset()

    def limit(
        self, twist: Twist, situation: ArenaEstimate | None, now_ns: int, docking: bool = False
    ) -> MonitorDecision:
        """Return what of a command may pass; to be asked for every command, in the order of time.

        Args:
            twist: What the law commands.
            situation: What is known of the arena; None while nothing is, and everything passes.
            now_ns: Time of the command.
            docking: Whether contact with the target unit is wanted or just over: that pair is left out.
        """
        self._way.advance(now_ns)
        decision = self._decide(twist, situation, now_ns, docking)
        self._way.passed(decision.twist)
        return decision

    def _decide(
        self, twist: Twist, situation: ArenaEstimate | None, now_ns: int, docking: bool
    ) -> MonitorDecision:
        free = MonitorDecision(twist, None, MonitorState.FREE, math.inf)
        if situation is None or not self._spec.enabled:
            return free
        around = Surroundings(self._model, situation, self._reaches, self._target if docking else None)
        X_WU = self._way.present_pose(situation.own, now_ns)
        unsure = self._spec.sigmas * around.sigma
        slow, stop = self._spec.slow_m + unsure, self._spec.stop_m + unsure
        at_least = around.at_least(X_WU) - self._way.longest(twist, around.reach)
        present = around.clearance(X_WU) if at_least < slow else None
        if present is None:
            return MonitorDecision(twist, None, MonitorState.FREE, at_least - unsure)

        def ahead(wish: Twist) -> float:
            return self._way.closest(wish, X_WU, present.distance, around, slow)

        nearest = ahead(twist)
        keeps = present.distance - _LOSS_M
        if nearest >= min(slow, keeps):
            return MonitorDecision(twist, present, MonitorState.FREE, nearest - unsure)
        if nearest >= stop:
            share = _CREEP + (1.0 - _CREEP) * (nearest - stop) / (slow - stop)
            return MonitorDecision(_scaled(twist, share), present, MonitorState.SLOW, nearest - unsure)
        low, high = 0.0, _CREEP
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if ahead(_scaled(twist, middle)) >= stop else (low, middle)
        passed = _scaled(twist, low)
        if low == 0.0 and twist.v and twist.w and ahead(Twist(0.0, twist.w)) >= min(stop, keeps):
            passed = Twist(0.0, twist.w)
        state = MonitorState.STOP if passed == Twist() else MonitorState.SLOW
        return MonitorDecision(passed, present, state, nearest - unsure)


def _scaled(twist: Twist, share: float) -> Twist:
    return Twist(share * twist.v, share * twist.w)
