"""The judge of a docking step, which reads the true state of the simulation and tells no robot."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

from msrr_bullet.collision.clearance import Pair
from msrr_bullet.collision.clearance_model import ClearanceModel
from msrr_bullet.collision.locked_group import neighbour_limits
from msrr_bullet.plant.lock_actuator import TILT_M
from msrr_bullet.simulation.simulation import Simulation
from msrr_bullet.trial.environment import LockedPairs
from msrr_bullet.trial.port_pose import DockingZone, PortPose
from msrr_bullet.trial.step_result import Contact, PlanarPose, Seating
from msrr_bullet.trial.verdict import Verdict
from msrr_scenes.geometry.pin_and_hole import PinAndHole
from msrr_scenes.geometry.se2 import SE2, wrap_angle
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.messages import Action, FailureReason, Phase, PoseEstimate, seconds
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.plan import DockStep

#: Phases in which the docking pair may come close. After them, for example when the robot gives up, the pair
#: may stay close until it has parted.
_DOCKING = frozenset(
    {Phase.CALIBRATE, Phase.DOCK, Phase.LOCK, Phase.VERIFY, Phase.TUG_TEST, Phase.RETREAT, Phase.DONE}
)

#: Smallest clearance of a pair that has parted after docking [m]; the minimum clearance applies as well.
PARTED_M = 0.005

#: Smallest clearance of a pair that does not touch: any that is not 0 [m].
_APART_M = math.ulp(0.0)

#: Distance that a unit may move between two control instants beside what its drive allows [m].
_PUSH_M = 0.01

#: Largest lateral error of a seated unit in plays of its pins, and its largest yaw error.
SEATED_PLAYS, SEATED_YAW_RAD = 2.0, math.radians(2.0)

#: The same of a port in line with the axis, whose pins are in the throats of the holes but not at the bottom.
IN_LINE_PLAYS, IN_LINE_YAW_RAD = 8.0 / 3.0, math.radians(4.0)

#: Share of the pins' length outside of the holes below which what plugs a port has stopped them, not its rim.
_ENTERED = 0.75

#: Time in the seat after which giving up is a false abort [s].
FALSE_ABORT_TIME_S = 0.3


class Judge:
    """Judges one step of the plan by the truth.

    Attributes:
        X_TD: Dock frame of the target port in the frame of the target unit.
        docking: Whether the pair may be close, as of the last decision of the robot.
        port: Pose of the docking port at the last decision of the robot; None before the first.
    """

    def __init__(
        self, simulation: Simulation, clearance: ClearanceModel, locked: LockedPairs, step: DockStep
    ) -> None:
        """Begin to judge a step of the plan."""
        scene = simulation.scene
        self._clearance = clearance
        self._locked = locked
        self._scene = scene
        self.step = step
        self._plant = simulation.plant
        geometry = scene.geometry(step.unit)
        self._X_UP_plane = geometry.port(step.port)
        self._X_UP = SE3.from_se2(self._X_UP_plane, geometry.pin_height)
        mechanism = PinAndHole.of(geometry, step.port, scene.geometry(step.target_unit), step.target_port)
        self.zone, self._play = DockingZone.of(mechanism), mechanism.play
        self._plug_gap = _ENTERED * mechanism.pin_length
        self.X_TD = scene.dock_frame(step)
        self._X_TD = SE3.from_se2(self.X_TD)
        self._unit, self._target = step.unit, step.target_unit
        self._X_WT, self._X_WD = SE2(), self.X_TD  # of the target when it was looked at last
        self.pair: Pair = frozenset({step.unit, step.target_unit})
        self._neighbour_limits: Mapping[Pair, float] = {}
        self._known_locks: list[DockStep] = []
        self._looked = SE2(), SE2(), PortPose(math.inf, 0.0, 0.0)  # at unit, dock frame and port
        self._travel = _PUSH_M + scene.limits.v_max_mps / scene.control.rate_hz
        self._attempt = 0
        self._close = False
        self.docking = False
        self.port: PortPose | None = None
        self._deepest = math.inf
        self._deepest_pose: PortPose | None = None
        self._seated_since: int | None = None
        self._was_seated = False
        self._commands_lock = self._held = False  # as of the last decision of the robot
        self._gave_way_in: int | None = None  # number of the last attempt in which the lock gave way
        self._contacts: dict[int, Contact] = {}  # first pin contact by the number of the attempt

    def X_WD(self) -> SE2:
        """Return the true pose of the dock frame in W."""
        X_WT = self._plant.pose(self._target)
        if X_WT is not self._X_WT:  # a target mostly stands, and its pose is the same object until it moves
            self._X_WT, self._X_WD = X_WT, X_WT @ self.X_TD
        return self._X_WD

    def X_DU(self) -> SE2:
        """Return the true pose of the docking unit in the dock frame."""
        return self.X_WD().inverse() @ self._plant.pose(self._unit)

    def port_pose(self) -> PortPose:
        """Return the true pose of the docking port in the dock frame.

        Near the target it is that at the height of the pins, by pitch and roll; elsewhere that in the plane.
        """
        X_WU, X_WD = self._plant.pose(self._unit), self.X_WD()
        known_U, known_D, port = self._looked
        if X_WU is not known_U or X_WD is not known_D:  # it is asked for several times an instant
            port = self._port_pose(X_WU, X_WD)
            self._looked = X_WU, X_WD, port
        return port

    def _port_pose(self, X_WU: SE2, X_WD: SE2) -> PortPose:
        # In floats, because poses would take three times as long.
        X_UP = self._X_UP_plane
        c, s = math.cos(X_WU.yaw), math.sin(X_WU.yaw)
        dx, dy = X_WU.x + c * X_UP.x - s * X_UP.y - X_WD.x, X_WU.y + s * X_UP.x + c * X_UP.y - X_WD.y
        c, s = math.cos(X_WD.yaw), math.sin(X_WD.yaw)
        gap, lateral = -(c * dx + s * dy), c * dy - s * dx
        if self.zone.is_near(gap, lateral, self._travel + TILT_M):
            return self._port_at_pins()
        return PortPose(gap, lateral, wrap_angle(X_WU.yaw + X_UP.yaw - X_WD.yaw))

    def _port_at_pins(self) -> PortPose:
        # Of X_DP only a point and a direction are needed, at every tick near a port.
        (px, py, pz), (ax, ay, az), _ = self._plant.frame(self._unit, self._X_UP)
        (ox, oy, oz), (ux, uy, uz), (vx, vy, vz) = self._plant.frame(self._target, self._X_TD)
        px, py, pz = px - ox, py - oy, pz - oz
        return PortPose(
            gap=-(ux * px + uy * py + uz * pz),
            lateral=vx * px + vy * py + vz * pz,
            yaw=math.atan2(vx * ax + vy * ay + vz * az, ux * ax + uy * ay + uz * az),
        )

    def seating(self) -> Seating | None:
        """Return the true relative pose of the pair; None when the port is not in the zone of the target."""
        port = self.port_pose()
        if port not in self.zone:
            return None
        return Seating(
            axial_gap_m=port.gap,
            lateral_m=abs(port.lateral),
            yaw_rad=abs(port.yaw),
            seated=self._is_seated(port),
        )

    def _is_seated(self, port: PortPose) -> bool:
        return (
            port.gap <= self._scene.judge.seated_depth_m
            and abs(port.lateral) <= SEATED_PLAYS * self._play
            and abs(port.yaw) <= SEATED_YAW_RAD
        )

    def watches(self, attempt: int) -> bool:
        """Return whether a new attempt begins, or the unit may reach the zone before the next decision."""
        port = self.port
        if port is None or attempt != self._attempt:
            return True
        return self.zone.is_near(port.gap, port.lateral, self._travel)

    def tick(self, now_ns: int, attempt: int, estimate: Callable[[], PoseEstimate | None]) -> None:
        """Observe pins and seat at one physics tick; not needed at ticks that the judge does not watch.

        A new attempt of the robot resets the seat. ``estimate`` returns the estimate of the robot, to be
        compared with the truth at the first contact.
        """
        if attempt != self._attempt:
            self._attempt = attempt
            self._deepest, self._deepest_pose = math.inf, None
            self._seated_since, self._was_seated = None, False
        port = self.port_pose()
        if port not in self.zone:
            return
        if attempt not in self._contacts and self._plant.pins_touch(self.step.unit):
            self._contacts[attempt] = Contact(
                time_s=seconds(now_ns),
                lateral_m=abs(port.lateral),
                yaw_rad=abs(port.yaw),
                port=PlanarPose(x_m=-port.gap, y_m=port.lateral, yaw_rad=port.yaw),
                estimate_error=self._error(estimate()),
            )
        if port.gap < self._deepest:
            self._deepest, self._deepest_pose = port.gap, port
        if self._was_seated:  # until the next attempt
            return
        # A gap that counts as seated may leave the pins out of reach of the lock: to give up is right then.
        if not (self._is_seated(port) and self._plant.lock_in_reach(self.step.unit)):
            self._seated_since = None
        elif self._seated_since is None:
            self._seated_since = now_ns
        elif seconds(now_ns - self._seated_since) >= FALSE_ABORT_TIME_S:
            self._was_seated = True

    def contact_in(self, attempt: int) -> Contact | None:
        """Return the first pin contact in an attempt, by its number; None without contact."""
        return self._contacts.get(attempt)

    def _error(self, estimate: PoseEstimate | None) -> PlanarPose | None:
        if estimate is None:
            return None
        believed, true = estimate.X_DU, self.X_DU()
        return PlanarPose.of(SE2(believed.x - true.x, believed.y - true.y, believed.yaw - true.yaw))

    def decide(self, action: Action) -> None:
        """Take note of the action of the robot at one control instant.

        The docking pair may be close from the beginning of docking until it has parted again.
        """
        close = action.phase in _DOCKING
        self.docking = close or self._close
        self.port = self.port_pose()
        self._close = close or (self._close and not self.parted())
        held = self._plant.lock_engaged(self.step.unit)
        if self._held and not held and self._commands_lock:
            self._gave_way_in = self._attempt
        self._held, self._commands_lock = held, action.lock

    def neighbour_limits(self) -> Mapping[Pair, float]:
        """Return how near the unit may come to the units that are locked to its target while it docks [m]."""
        if self._locked.steps != self._known_locks:
            self._known_locks = list(self._locked.steps)
            limits = neighbour_limits(self._scene, self._clearance, self._locked.steps, self.step)
            self._neighbour_limits = {frozenset({self.step.unit, n}): limit for n, limit in limits.items()}
        return self._neighbour_limits

    def parted(self) -> bool:
        """Return whether the pair is clear of each other."""
        return not self._within(max(self._scene.judge.min_clearance_m, PARTED_M))

    def may_be_near(self) -> bool:
        """Return whether the pair docks, or has still to part, and touches nowhere but at its port."""
        # Not `port`, which is of the last decision: a step that has ended decides nothing any more.
        return self.docking and (self.port_pose() in self.zone or not self._within(_APART_M))

    def _within(self, distance: float) -> bool:
        """Return whether the clearance of the pair is less than ``distance`` [m]."""
        X_WU, X_WT = self._plant.pose(self._unit), self._plant.pose(self._target)
        return self._clearance.within(self._unit, X_WU, self._target, X_WT, distance)

    def verdict_docked(self, engaged: bool) -> Verdict:
        """Return the verdict on a robot that believes it is docked, before the pull test.

        ``engaged`` is whether the lock holds the other unit.
        """
        seating = self.seating()
        if seating is None:
            return Verdict(Outcome.FALSE_DOCK, "the unit is not at the port")
        if not seating.seated:
            gap, side, yaw = 1e3 * seating.axial_gap_m, 1e3 * seating.lateral_m, math.degrees(seating.yaw_rad)
            off = f"{gap:z.1f} mm before the end, {side:z.1f} mm and {yaw:z.1f} deg off"
            return Verdict(Outcome.FALSE_DOCK, f"the pins are not seated: {off}")
        return Verdict(Outcome.DOCKED) if engaged else Verdict(Outcome.FALSE_DOCK, "the lock holds nothing")

    def verdict_gave_up(self, reason: FailureReason | None, ever_detected: bool) -> Verdict:
        """Return the verdict on a robot that gave up.

        ``ever_detected`` is whether the target was detected at least once in this step.
        """
        if self._gave_way_in == self._attempt:  # a tug test may have shown it, and then to give up is right
            return Verdict(Outcome.LOCK_FAILED)
        if self._was_seated:
            return Verdict(Outcome.FALSE_ABORT)
        contact, deepest = self.contact_in(self._attempt), self._deepest_pose
        if reason is FailureReason.BLOCKED and contact is None:
            return Verdict(Outcome.BLOCKED)
        if reason is FailureReason.SEIZED:
            return Verdict(Outcome.GAVE_UP)
        if not ever_detected:
            return Verdict(Outcome.NEVER_DETECTED)
        if contact is None or deepest is None:
            lost = reason is FailureReason.TARGET_LOST
            return Verdict(Outcome.TARGET_LOST if lost else Outcome.GAVE_UP)
        if deepest.gap < self._plug_gap and self._plant.is_plugged(self._target, self.step.target_port):
            return Verdict(Outcome.NOT_SEATED)
        straight = abs(deepest.yaw) <= IN_LINE_YAW_RAD
        in_line = straight and abs(deepest.lateral) <= IN_LINE_PLAYS * self._play
        return Verdict(Outcome.NOT_SEATED if in_line else Outcome.JAMMED)
