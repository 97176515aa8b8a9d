"""The judge of a trial, which reads the truth of the simulation. Nothing that it knows reaches a robot."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from msrr_bullet.collision.clearance import Clearance, Pair
from msrr_bullet.collision.clearance_model import ClearanceModel
from msrr_bullet.simulation.simulation import Simulation
from msrr_bullet.trial.environment import LockedPairs
from msrr_bullet.trial.result import Contact, PlanarPose, Seating
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import Action, FailureReason, Phase, PoseEstimate, seconds
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.plan import DockStep

#: Phases in which the docking pair may come as close as it likes. Whatever comes after them, giving up
#: included, finds the pair close, so it may stay so until it has parted.
_DOCKING = frozenset({Phase.DOCK, Phase.LOCK, Phase.VERIFY, Phase.RETREAT, Phase.DONE})

#: The zone before a port in which touching it is part of docking: outside it, touching is a collision.
#: Its half-width is half the port's face, its depth the pins' length and as much again.
ZONE_DEPTH_M = 0.036
#: How far the faces may overlap and still meet: more is beyond the port, inside the target or behind it.
ZONE_OVERLAP_M = 0.005
ZONE_HALF_WIDTH_M = 0.05
ZONE_YAW_RAD = math.radians(20.0)

#: A pair that tried to dock has parted once it is this far apart [m], and by the clearance asked for.
PARTED_M = 0.005

#: More than a unit can drive between two control instants.
_APPROACH_M = 0.05

#: A unit this far off its seat, sideways or in heading, is not seated however deep it is.
SEATED_LATERAL_M = 0.003
SEATED_YAW_RAD = math.radians(2.0)

#: How far off the axis a pin can stop and still be called in line with its hole: the throat's play.
IN_LINE_M = 0.004
IN_LINE_YAW_RAD = math.radians(4.0)

#: How long a unit has to sit in its seat for giving up to be a mistake.
SEATED_LONG_ENOUGH_S = 0.3


@dataclass(frozen=True, slots=True)
class PortPose:
    """Where the docking port really is, in the dock frame D of the target.

    Attributes:
        gap: Distance of the two faces along the axis of D [m], negative when they overlap.
        lateral: Offset from that axis, to the left positive [m].
        yaw: Heading off that axis [rad].
    """

    gap: float
    lateral: float
    yaw: float

    @property
    def in_zone(self) -> bool:
        """The port is where touching the target is part of docking."""
        return (
            -ZONE_OVERLAP_M <= self.gap <= ZONE_DEPTH_M
            and abs(self.lateral) <= ZONE_HALF_WIDTH_M
            and abs(self.yaw) <= ZONE_YAW_RAD
        )


class Judge:
    """Watches the truth of one step of the plan and gives the verdict.

    Attributes:
        X_TD: Dock frame of the target port in the frame of the target unit.
        contact: First pin contact of the present attempt; None before it.
        min_clearance: Smallest distance so far between bodies that were not docking [m].
    """

    def __init__(
        self, simulation: Simulation, clearance: ClearanceModel, locked: LockedPairs, step: DockStep
    ) -> None:
        """Begin to judge a step.

        Args:
            simulation: The truth.
            clearance: Clearance model with the shapes of all bodies.
            locked: Pairs that earlier steps locked together: they may touch, and their locks have to hold.
            step: The step of the plan.
        """
        scene = simulation.scene
        self._simulation = simulation
        self._clearance = clearance
        self._locked = locked
        self._scene = scene
        self._step = step
        self._plant = simulation.plant
        self._X_UP = scene.geometry(step.unit).port(step.port)
        self.X_TD = scene.geometry(step.target_unit).dock_frame(step.target_port)
        self._pair: Pair = frozenset({step.unit, step.target_unit})
        self._attempt = 0
        self._together = False
        self._gap = -math.inf  # as of the last control instant; not known yet
        self._deepest = math.inf
        self._deepest_pose: PortPose | None = None
        self._seated_since: int | None = None
        self._was_seated = False
        self.contact: Contact | None = None
        self.min_clearance: float | None = None

    def X_WD(self) -> SE2:
        """Return the true pose of the dock frame."""
        return self._plant.pose(self._step.target_unit) @ self.X_TD

    def X_DU(self) -> SE2:
        """Return the true pose of the docking unit in the dock frame."""
        return self.X_WD().inverse() @ self._plant.pose(self._step.unit)

    def port_pose(self) -> PortPose:
        """Return where the docking port is."""
        return self._port_pose(self.X_DU())

    def _port_pose(self, X_DU: SE2) -> PortPose:
        X_DP = X_DU @ self._X_UP
        return PortPose(-X_DP.x, X_DP.y, X_DP.yaw)

    def seating(self) -> Seating | None:
        """Return how the pair stands to each other; None when the port is not in the target's zone."""
        at = self.port_pose()
        if not at.in_zone:
            return None
        return Seating(
            axial_gap_m=at.gap,
            lateral_m=abs(at.lateral),
            yaw_rad=abs(at.yaw),
            seated=self._is_seated(at),
        )

    def _is_seated(self, at: PortPose) -> bool:
        return (
            at.gap <= self._scene.judge.seated_depth_m
            and abs(at.lateral) <= SEATED_LATERAL_M
            and abs(at.yaw) <= SEATED_YAW_RAD
        )

    def tick(self, now_ns: int, attempt: int, estimate: PoseEstimate | None) -> None:
        """Watch the pins at one physics tick.

        Args:
            now_ns: Simulated time.
            attempt: The robot's count; a new one starts a new record of contact.
            estimate: What the robot believes, recorded beside the truth at first contact.
        """
        if attempt != self._attempt:
            self._attempt = attempt
            self._deepest, self._deepest_pose = math.inf, None
            self._seated_since, self._was_seated = None, False
            self.contact = None
        if self._gap > ZONE_DEPTH_M + _APPROACH_M:
            return  # the next control instant comes before the unit can be there
        at = self.port_pose()
        if not at.in_zone:
            return
        if self.contact is None and self._plant.pins_touch(self._step.unit):
            self.contact = Contact(
                time_s=seconds(now_ns),
                lateral_m=abs(at.lateral),
                yaw_rad=abs(at.yaw),
                estimate_error=self._error(estimate),
            )
        if at.gap < self._deepest:
            self._deepest, self._deepest_pose = at.gap, at
        if not self._is_seated(at):
            self._seated_since = None
        elif self._seated_since is None:
            self._seated_since = now_ns
        elif seconds(now_ns - self._seated_since) >= SEATED_LONG_ENOUGH_S:
            self._was_seated = True

    def _error(self, estimate: PoseEstimate | None) -> PlanarPose | None:
        if estimate is None:
            return None
        believed, true = estimate.X_DU, self.X_DU()
        return PlanarPose.of(SE2(believed.x - true.x, believed.y - true.y, believed.yaw - true.yaw))

    def safety(self, action: Action) -> tuple[Outcome | None, Clearance | None]:
        """Measure clearance at one control instant.

        Args:
            action: What the robot is doing; from when it begins to dock until it has parted from its target
                again, its pair may come close, and in the zone before the port it may touch.

        Returns:
            The verdict that ends the trial, if any, and the smallest clearance of any pair.
        """
        if not self._locked.hold(self._plant):
            return Outcome.LOCK_FAILED, None
        docking = action.phase in _DOCKING or self._together
        poses = self._simulation.poses()
        X_WD = poses[self._step.target_unit] @ self.X_TD
        at = self._port_pose(X_WD.inverse() @ poses[self._step.unit])
        self._gap = at.gap
        model, locked_pairs = self._clearance, self._locked.pairs
        # Units that were locked together by an earlier step are one body.
        first = nearest = model.minimum(poses, locked_pairs)
        self._together = action.phase in _DOCKING or (self._together and not self._parted(poses))
        if nearest is not None and docking and nearest.pair == self._pair:
            if nearest.distance <= 0.0 and not at.in_zone:
                return Outcome.COLLISION, nearest
            nearest = model.minimum(poses, {*locked_pairs, self._pair})
        # All other pairs are at least as far apart: what holds of this one holds of them.
        if nearest is not None:
            if nearest.distance <= 0.0:
                return Outcome.COLLISION, nearest
            if self.min_clearance is None or nearest.distance < self.min_clearance:
                self.min_clearance = nearest.distance
            if nearest.distance < self._scene.judge.min_clearance_m:
                return Outcome.CLEARANCE_VIOLATED, nearest
        arena = self._scene.arena
        for unit in self._scene.units:
            X_WU = poses[unit]
            if not (arena.x_m[0] <= X_WU.x <= arena.x_m[1] and arena.y_m[0] <= X_WU.y <= arena.y_m[1]):
                return Outcome.LEFT_ARENA, first
        return None, first

    def _parted(self, poses: Mapping[str, SE2]) -> bool:
        unit, target = self._step.unit, self._step.target_unit
        between = self._clearance.nearest(unit, poses[unit], {target: poses[target]})
        return between is None or between.distance >= max(self._scene.judge.min_clearance_m, PARTED_M)

    def verdict_docked(self, seating: Seating | None, engaged: bool, pull_passed: bool) -> Outcome:
        """Return the verdict on a robot that says it is docked."""
        if seating is None or not seating.seated or not engaged:
            return Outcome.FALSE_DOCK
        return Outcome.DOCKED if pull_passed else Outcome.LOCK_FAILED

    def verdict_gave_up(self, setback: FailureReason | None, ever_detected: bool) -> Outcome:
        """Return the verdict on a robot that gave up.

        Args:
            setback: Why it did, in its own words.
            ever_detected: Any measurement of the target was ever made in this step.
        """
        if self._was_seated:
            return Outcome.FALSE_ABORT
        if setback is FailureReason.BLOCKED and self.contact is None:
            return Outcome.BLOCKED
        if not ever_detected:
            return Outcome.NEVER_DETECTED
        deepest = self._deepest_pose
        if self.contact is None or deepest is None:
            return Outcome.TARGET_LOST if setback is FailureReason.TARGET_LOST else Outcome.GAVE_UP
        in_line = abs(deepest.lateral) <= IN_LINE_M and abs(deepest.yaw) <= IN_LINE_YAW_RAD
        return Outcome.NOT_SEATED if in_line else Outcome.JAMMED
