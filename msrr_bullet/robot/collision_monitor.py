"""The collision monitor: slows and stops commands that bring the docking unit too close to a known body.

It works on estimates alone, between the control law and the drive. It cannot avoid bodies that it does not
know. From clearances it subtracts the uncertainty of the estimates of bodies that a command could lead to.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass

from msrr_bullet.collision.clearance import Clearance
from msrr_bullet.collision.clearance_model import ClearanceModel
from msrr_bullet.collision.locked_group import NEIGHBOUR_MARGIN_M
from msrr_bullet.robot.close_neighbours import CloseNeighbours
from msrr_bullet.robot.local_map import LocalMap
from msrr_bullet.robot.port_map import PortMap
from msrr_bullet.robot.stopping_trajectory import StoppingTrajectory
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import (
    ArenaEstimate,
    CollisionMonitorState,
    MonitorState,
    PoseEstimate,
    Twist,
    seconds,
)
from msrr_scenes.messages.coordination import Authority, Intent
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.scene import Scene

#: Loss of clearance along a trajectory that still counts as none [m]: no more than rounding, because a small
#: loss with every command would add up.
_LOSS_M = 1e-6
#: Steps of the bisection for the largest share of a command that is allowed.
_BISECTIONS = 4
#: Age from which on an intent tells nothing: the unit has stopped or gone on since [s].
_INTENT_AGE_S = 1.0
#: Share of a command that passes where the clearance ahead has fallen to ``stop_m``.
_CREEP = 0.25


@dataclass(frozen=True, slots=True)
class MonitorDecision:
    """The decision of the collision monitor on one command.

    Attributes:
        twist: Command that may be sent to the drive.
        clearance: Smallest present clearance of the unit, by the estimates, from the bodies that the command
            could lead to; None when there are none or the monitor is disabled.
        state: Whether the command passes unchanged, slower (or in part), or not at all.
        ahead: Smallest clearance along the trajectory of the whole command [m], less the uncertainty of the
            estimates; a lower bound where ``clearance`` is None.
    """

    twist: Twist
    clearance: Clearance | None
    state: MonitorState
    ahead: float

    def message(self, unit: str, stamp_ns: int) -> CollisionMonitorState:
        """Return the decision as a message of ``unit`` about its command at ``stamp_ns``."""
        if self.clearance is None:
            return CollisionMonitorState(stamp_ns, self.state, None, None, self.ahead)
        (body,) = self.clearance.pair - {unit}
        return CollisionMonitorState(stamp_ns, self.state, body, self.clearance.distance, self.ahead)


class CollisionMonitor:
    """Limits the commands of one unit.

    It predicts the trajectory of a unit that brakes as soon as the next command could arrive
    (:class:`~msrr_bullet.robot.stopping_trajectory.StoppingTrajectory`). The smallest clearance along the
    trajectory decides:

    - at least ``slow_m``, or no less than the present clearance: the command passes;
    - between ``stop_m`` and ``slow_m``: a share of it passes, which falls to a quarter at ``stop_m``;
    - less than ``stop_m``: the largest share below a quarter passes that keeps ``stop_m``; if there is none,
      the turn alone, or a quarter of the speed straight on, if one of them keeps ``stop_m``; else nothing.

    A command that leads away from a body always passes, however near the unit is. A body that drives counts
    where it is; if it goes first, also where it would still come if it stopped, as it has told. While a unit
    docks, the target is ignored, and a neighbour that is locked to the target may be as near as the seat of
    the unit is, less a margin. Of the poses that the unit may have beside such a neighbour, those with the
    pins in the holes do not count (:class:`~msrr_bullet.robot.port_map.PortMap`).
    """

    def __init__(
        self, scene: Scene, unit: str, step: DockStep | None = None, joints: Iterable[DockStep] = ()
    ) -> None:
        """Take shapes, limits and latencies from the scene; the poses of bodies are not used.

        In the step the unit docks or leaves its port; there is none without a target. ``joints`` are the
        other docks that are closed or may close meanwhile.
        """
        self._scene, self._step = scene, step
        self._spec = scene.control.guard
        self._own = unit
        self._model = ClearanceModel.from_scene(scene)
        self._reaches = {unit: scene.geometry(unit).circumradius for unit in scene.units}
        self._reaches |= {name: spec.radius_m for name, spec in scene.obstacles.items()}
        self._trajectory = StoppingTrajectory(scene)
        self._intents: tuple[Intent, ...] = ()
        self._neighbours: CloseNeighbours | None = None
        self._told: tuple[tuple[str, str], ...] | None = None  # docks, by a base station
        self._expect(joints)

    def _expect(self, joints: Iterable[DockStep]) -> None:
        """Expect the units of these docks beside the target; those of earlier calls no more."""
        if self._step is None:
            return
        self._neighbours = CloseNeighbours(
            self._scene, self._model, self._step, joints, self._spec.stop_m, self._spec.sigmas
        )

    def brief(self, authority: Authority) -> None:
        """Take in what a base station tells of others: docks, and the intents of those that go first."""
        self._intents = authority.intents
        if authority.joints != self._told:
            self._told = authority.joints
            ends = ((*active.partition(".")[::2], passive) for active, passive in authority.joints)
            self._expect([DockStep(unit=unit, port=port, to=to) for unit, port, to in ends])

    def stopping(self, arena: ArenaEstimate | None, now_ns: int) -> tuple[tuple[float, float, float], ...]:
        """Return the poses in W that the unit would still pass if it stopped now; none at rest or unseen."""
        if arena is None:
            return ()
        X_WU = self._trajectory.present_pose(arena.own, now_ns)
        poses = self._trajectory.stopping_poses(X_WU, self._reaches[self._own])
        return tuple((X.x, X.y, X.yaw) for X in poses)

    def limit(
        self,
        twist: Twist,
        arena: ArenaEstimate | None,
        now_ns: int,
        docking: bool = False,
        by_sight: PoseEstimate | None = None,
    ) -> MonitorDecision:
        """Decide on one command; to be called for every command, in order of time.

        While no body in the arena has an estimate, every command passes. The target unit may be touched, and
        is ignored, by a unit that is ``docking``; ``by_sight`` is its pose in the dock frame, by its own
        camera; None if it is not known.
        """
        self._trajectory.advance(now_ns)
        decision = self._decide(twist, arena, now_ns, docking, by_sight)
        self._trajectory.send(decision.twist)
        return decision

    def _decide(
        self,
        twist: Twist,
        arena: ArenaEstimate | None,
        now_ns: int,
        docking: bool,
        by_sight: PoseEstimate | None,
    ) -> MonitorDecision:
        if arena is None or not self._spec.enabled:
            return MonitorDecision(twist, None, MonitorState.FREE, math.inf)
        X_WU = self._trajectory.present_pose(arena.own, now_ns)
        close = self._neighbours.limits if docking and self._neighbours is not None else {}
        target = (self._step.target_unit,) if docking and self._step is not None else ()
        ignored = {self._own, *close, *target}
        intents = [i for i in self._intents if seconds(now_ns - i.stamp_ns) < _INTENT_AGE_S]
        free = self._map(arena, self._reaches.keys() - ignored, intents)
        decision = self._decide_on(twist, free, X_WU, self._spec.slow_m, self._spec.stop_m)
        if not close or self._neighbours is None:
            return decision
        if by_sight is not None:
            arena = self._neighbours.in_dock_frame(arena, by_sight)
            X_WU = self._trajectory.present_pose(arena.own, now_ns)
            neighbours: LocalMap = PortMap(
                self._model,
                arena,
                self._reaches,
                self._spec.sigmas,
                self._neighbours.offset,
                {body.name: self._neighbours.least_gap(body) for body in arena.others},
            )
        else:
            neighbours = self._map(arena, close)
        stop_m = min(close.values())
        slow_m = stop_m + 0.5 * NEIGHBOUR_MARGIN_M
        second = self._decide_on(decision.twist, neighbours, X_WU, slow_m, stop_m)
        return decision if second.state is MonitorState.FREE else second

    def _map(self, arena: ArenaEstimate, names: Collection[str], intents: Sequence[Intent] = ()) -> LocalMap:
        return LocalMap(self._model, arena, self._reaches, names, intents)

    def _decide_on(
        self, twist: Twist, local_map: LocalMap, X_WU: SE2, slow_m: float, stop_m: float
    ) -> MonitorDecision:
        """Decide on one command by the bodies of one map, with the limits that hold for them."""
        travel = self._trajectory.max_travel(twist, local_map.reach)
        bounds = {name: c - travel for name, c in local_map.bounds(X_WU, self._spec.sigmas).items()}
        least = min(bounds.values(), default=math.inf)
        if least >= slow_m:
            return MonitorDecision(twist, None, MonitorState.FREE, least)
        # How badly a body is known counts only for those that the command could lead to.
        near = local_map.only([name for name, bound in bounds.items() if bound < slow_m])
        present = near.clearance(X_WU)
        assert present is not None, "a map with bodies has a smallest clearance"
        least_now, uncertainty = near.least(X_WU, present), near.uncertainty(self._spec.sigmas)
        slow, stop = slow_m + uncertainty, stop_m + uncertainty

        def min_clearance(command: Twist) -> float:
            return self._trajectory.min_clearance(command, X_WU, least_now, near, slow)

        ahead = min_clearance(twist)
        no_loss = least_now - _LOSS_M
        if ahead >= min(slow, no_loss) or twist == Twist():  # nothing is better than to stop
            return MonitorDecision(twist, present, MonitorState.FREE, ahead - uncertainty)
        if ahead >= stop:
            share = _CREEP + (1.0 - _CREEP) * (ahead - stop) / (slow - stop)
            # A share of a command turns the unit less, which can lead nearer to a body than the whole of it.
            shares = (share, 0.5 * (share + 1.0))
            slower = (part for s in shares if min_clearance(part := _scaled(twist, s)) >= stop)
            return MonitorDecision(next(slower, twist), present, MonitorState.SLOW, ahead - uncertainty)
        low, high = 0.0, _CREEP
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if min_clearance(_scaled(twist, middle)) >= stop else (low, middle)
        allowed = _scaled(twist, low)
        if low == 0.0 and twist.v and twist.w:
            parts = (Twist(0.0, twist.w), Twist(_CREEP * twist.v, 0.0))
            allowed = next((part for part in parts if min_clearance(part) >= min(stop, no_loss)), allowed)
        state = MonitorState.STOP if allowed == Twist() else MonitorState.SLOW
        return MonitorDecision(allowed, present, state, ahead - uncertainty)


def _scaled(twist: Twist, share: float) -> Twist:
    return Twist(share * twist.v, share * twist.w)
