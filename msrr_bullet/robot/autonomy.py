"""The robot: the software that runs on the computer of the docking unit.

It joins perception and control and gets images, wheel odometry, seat switches, lock reports and the time. It
imports nothing of the simulator, and a replay runs it again from a log.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from msrr_bullet.profiler import NullProfiler, Profiler
from msrr_bullet.robot.collision_monitor import CollisionMonitor
from msrr_bullet.robot.drive_feed_forward import DriveFeedForward
from msrr_bullet.robot.drive_watch import DriveWatch
from msrr_bullet.robot.interface import Estimates
from msrr_bullet.robot.overhead_localizer import OverheadLocalizer, OverheadReader
from msrr_bullet.robot.wheel_speed import WheelSpeed
from msrr_control.docking.controller import build_controller
from msrr_control.docking.law import DockSetup
from msrr_control.sequence.observation import Assembler, Observation
from msrr_control.sequence.state_machine import PhaseMachine
from msrr_control.staging.guided_assembler import GuidedAssembler
from msrr_control.staging.registry import build_assembler
from msrr_control.staging.setup import AssemblySetup
from msrr_perception.detection.detector import scene_detector
from msrr_perception.detection.onboard_vision import FULL_FRAME_PERIOD, OnboardVision
from msrr_perception.estimation.calibration_memory import CalibrationMemory
from msrr_perception.estimation.corner_filter import CornerEkf
from msrr_perception.estimation.estimator import ESTIMATORS, Estimator
from msrr_perception.estimation.los import LosEstimator
from msrr_perception.pose.target import TargetModel
from msrr_perception.tracking.overhead_correction import OverheadCorrection
from msrr_scenes.messages import (
    NS_PER_S,
    Action,
    ArenaEstimate,
    CollisionMonitorState,
    Conviction,
    Detections,
    Exposure,
    Fetch,
    LockFeedback,
    Phase,
    PoseEstimate,
    PoseMeasurement,
    SeatSwitches,
    SensorMessage,
    Twist,
    WheelOdometry,
)
from msrr_scenes.registry import build
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.scene import Scene

#: Phases in which the unit is localised by the overhead camera.
_FAR_PHASES = (Phase.ASSEMBLE, Phase.HAND_OVER)

#: Time for which the target may still be pushed after a unit that moves was seen near it [ns].
_PUSH_NS = NS_PER_S // 5

#: Phases that drive backwards, to where the onboard camera does not look.
_BACKWARDS_PHASES = (Phase.TUG_TEST, Phase.RETREAT)

#: Phases that use every frame of the overhead camera.
_OVERHEAD_PHASES = (*_FAR_PHASES, *_BACKWARDS_PHASES)

#: Phases in which the overhead camera only checks the surroundings, now and then.
_CHECKED_PHASES = (Phase.CALIBRATE, Phase.DOCK)

#: Phases in which the overhead camera corrects the pose by the onboard camera.
_CORRECTED_PHASES = (Phase.DOCK, Phase.RETREAT)


class Autonomy:
    """One docking unit during one step of the plan.

    From the scene it takes geometry, calibration, data sheets and the plan, never the poses of bodies. On its
    own it reads the pictures of the overhead camera itself; led by a base station it is given what the base
    station reads, and the docks that others have made. Without an overhead camera it has no collision
    monitor, its ``guard``.
    """

    def __init__(
        self,
        scene: Scene,
        step: DockStep,
        profiler: Profiler | None = None,
        *,
        guided: GuidedAssembler[Any] | None = None,
        overhead: OverheadLocalizer | None = None,
        docked: bool = False,
        memory: CalibrationMemory | None = None,
    ) -> None:
        """Set up the robot for one step.

        A unit that a base station leads has a long-distance phase, ``guided``, and ``overhead``, which knows
        where all bodies are and is fed by others. A unit on its own has neither, and reads the pictures of
        the overhead camera itself. One that is ``docked`` already is to undock. ``memory`` is what it has
        learned at earlier docks of the trial; None for one that docks once.

        Raises:
            UnknownNameError: The scene names an unknown detector, estimator or controller.
            SceneError: Parameters are wrong, or the target port shows no tags.
        """
        target = TargetModel.from_scene(scene, step)
        detector = scene_detector(scene)
        self._target_tags = target.corners_D.keys()
        self._tags_read_ns: int | None = None
        self._estimator: Estimator = build(
            "control.estimator",
            scene.control.estimator,
            ESTIMATORS,
            target,
            scene.odometry,
            delay_compensation=scene.control.delay_compensation,
        )
        self._memory, self._port = memory, step.to
        self._recall_seats()
        frames_only = scene.cameras.onboard.readout == "frames"  # then windows save nothing
        self._vision = OnboardVision(target, detector, full_every=1 if frames_only else FULL_FRAME_PERIOD)
        self._los_estimator = LosEstimator(target)
        self._correction, self._corrects = OverheadCorrection(target), scene.control.overhead_correction
        setup = DockSetup.of(scene, step)
        self._overhead: OverheadLocalizer | None = None
        self._reader: OverheadReader | None = None
        self._assembler: Assembler | None = guided
        self.guard: CollisionMonitor | None = None
        if guided is not None:
            self._overhead = overhead
            self.guard = CollisionMonitor(scene, step.unit, step)
        elif scene.cameras.overhead is not None:
            self._overhead = self._reader = OverheadReader(scene, step, target, detector)
            assembly = AssemblySetup.of(scene, step)
            assembly = replace(assembly, place_sigma=self._reader.place_sigma(assembly.box))
            self._assembler = build_assembler(scene.control.assembly, assembly)
            self.guard = CollisionMonitor(scene, step.unit, step, scene.docks_before(step))
        controller = build_controller(scene.control.docking, setup)
        # One that a base station leads is watched from one route to the next.
        self._drive_watch = DriveWatch(scene.geometry(step.unit)) if guided is None else None
        self._phases = PhaseMachine(
            scene.docking, setup, controller, self._assembler, docked=docked, calibrate=step.calibrate
        )
        self._profiler = profiler or NullProfiler()
        self._unit = step.unit
        self._onboard = target.camera_name
        self._speed = WheelSpeed(target.wheel_radius, target.track)
        self._feed_forward = DriveFeedForward(self._estimator, target.track, scene.control.drive_feed_forward)
        self._switches: SeatSwitches | None = None
        self._lock: LockFeedback | None = None
        self._now_ns = 0
        self.estimates = Estimates()
        self._passed: Twist | None = None

    @property
    def phase(self) -> Phase:
        """Phase in which the last decision ended."""
        return self._phases.phase

    @property
    def clear_gap(self) -> float | None:
        """Distance from the port [m]; None if it is unknown, or the unit may press against the port."""
        return self._phases.clear_gap

    def undock(self, retreat_m: float) -> None:
        """Open the lock and back out of the port, from the next decision on.

        It stops at the distance ``retreat_m`` between the faces.

        Raises:
            MsrrError: The unit has not docked, or it has undocked already.
        """
        self._phases.undock(retreat_m)
        self._recall_seats()
        for part in (self._estimator, self._los_estimator, self._vision, self._correction):
            part.reset()  # much time may have passed since the unit docked

    def uses_camera(self, camera: str) -> bool:
        """Return whether the robot uses the frames of ``camera`` now; other cameras need not expose."""
        if camera == self._onboard:
            return self._phases.phase is not Phase.ASSEMBLE
        if self._reader is not None and self._phases.phase in _CHECKED_PHASES:
            return self.estimates.arena is not None and self._reader.check_is_due(self._now_ns)
        return self._phases.phase in _OVERHEAD_PHASES

    def expose(self, exposure: Exposure, fetch: Fetch) -> Detections | None:
        """Read windows of an exposure and return the detections, which are used only when received."""
        if exposure.camera == self._onboard:
            return self._vision.detect(exposure, self._estimator.predict(exposure.stamp_ns), fetch)
        if self._reader is None:
            return None
        arena = self.estimates.arena
        if self._phases.phase in _CHECKED_PHASES and arena is not None:
            return self._reader.check(exposure, arena.own.X_WB, fetch)
        return self._reader.detect(exposure, fetch)

    def receive(self, message: SensorMessage) -> None:
        """Process a message that arrives now."""
        # In the long-distance phase a frame of the onboard camera may still come that was exposed before it.
        sees_port = self._phases.phase is not Phase.ASSEMBLE
        match message:
            case WheelOdometry():
                self._estimator.add_odometry(message)
                self._speed.add(message)
                if self._drive_watch is not None:
                    self._drive_watch.read(message)
            case Detections() if sees_port and message.exposure.camera == self._onboard:
                self._estimator.add_detections(message)
                self._los_estimator.add_detections(message)
                if any(tag.tag_id in self._target_tags for tag in message.tags):
                    self._tags_read_ns = message.exposure.stamp_ns
            case PoseMeasurement() if sees_port:
                self._estimator.add_pose(message)
                self._los_estimator.add_pose(message)
            case SeatSwitches():
                self._switches = message
            case LockFeedback():
                self._lock = message
        if self._reader is not None:
            self._reader.receive(message)

    def step(self, now_ns: int) -> Action:
        """Return the action of one control instant."""
        self._now_ns = now_ns
        if self._overhead is not None and self._phases.phase is not Phase.ASSEMBLE:
            estimator = self._estimator
            if isinstance(estimator, CornerEkf) and self._overhead.target_may_be_pushed():
                estimator.expect_push(now_ns, now_ns + _PUSH_NS)
        pose = self._estimator.estimate(now_ns)
        los = self._los_estimator.observe(now_ns, self._estimator)
        arena: ArenaEstimate | None = None
        if self._overhead is not None:
            by_onboard_camera = self._phases.phase not in _FAR_PHASES
            if pose is not None:
                pose = self._corrected(pose, self._overhead)
            arena = self._overhead.estimate(now_ns, pose if by_onboard_camera else None)
        before = self._phases.phase
        action = self._phases.step(
            Observation(
                now_ns=now_ns,
                pose=pose,
                los=los,
                switches=self._switches,
                lock=self._lock,
                twist=self._speed.twist,
                arena=arena,
                overhead_exposed_ns=self._overhead.newest_ns if self._overhead else None,
                monitor=self.estimates.monitor,
                passed=self._passed,
                tags_read_ns=self._tags_read_ns,
            )
        )
        if action.phase is Phase.DONE and before is not Phase.DONE:
            self._learn_seat()
        if action.phase is Phase.ASSEMBLE and before is not Phase.ASSEMBLE:
            # Estimates by the onboard camera from another place are of no use for the next docking phase.
            for part in (self._estimator, self._los_estimator, self._vision):
                part.reset()
        if action.phase in _FAR_PHASES:
            self._correction.reset()
        if self._reader is not None and action.phase in _BACKWARDS_PHASES and before is not action.phase:
            self._reader.restart_search()  # an obstacle may have appeared behind the unit
        action, monitor = self._limit_by_clearance(action, arena, pose)
        action, belief = self._feed_forward.apply(action), self._phases.belief
        if self._drive_watch is not None:
            action = self._drive_watch.judge(action, self.clear_gap)
            belief = self._drive_watch.belief or belief
        assembly = path = None
        if self._assembler is not None:
            assembly = self._assembler.progress if self._phases.phase is Phase.ASSEMBLE else None
            path = self._assembler.path
        self.estimates = Estimates(pose, los, arena, monitor, assembly, path, belief)
        return action

    def _corrected(self, by_sight: PoseEstimate, overhead: OverheadLocalizer) -> PoseEstimate:
        """Return the pose by the onboard camera, corrected by what the overhead camera shows on the way."""
        if self._corrects and self._phases.phase in _CORRECTED_PHASES and self._correction.is_due(by_sight):
            from_above = overhead.in_dock_frame(by_sight.stamp_ns)
            if from_above is not None:
                self._correction.update(by_sight, from_above)
        return self._correction.apply(by_sight)

    def _recall_seats(self) -> None:
        """Let the filter begin anew with what was learned at earlier docks."""
        if self._memory is not None and isinstance(self._estimator, CornerEkf):
            self._estimator.recall(self._memory.recall(self._port, self._estimator.prior))

    def _learn_seat(self) -> None:
        """Keep what the unit has learned, if it has docked; estimators of a user's own keep nothing."""
        docked = self._phases.belief.conviction is Conviction.DOCKED
        if docked and self._memory is not None and isinstance(self._estimator, CornerEkf):
            learned = self._estimator.learned(seated=True)
            if learned is not None:
                self._memory.keep(self._port, learned)

    def _limit_by_clearance(
        self, action: Action, arena: ArenaEstimate | None, pose: PoseEstimate | None
    ) -> tuple[Action, CollisionMonitorState | None]:
        """Limit the command so that the unit can stop before it reaches any known body."""
        if self.guard is None:
            return action, None
        docking = action.phase not in _FAR_PHASES
        with self._profiler("collision monitor"):
            decision = self.guard.limit(action.twist, arena, action.stamp_ns, docking, pose)
        self._passed = decision.twist
        limited = action if decision.twist is action.twist else action.with_twist(decision.twist)
        return limited, decision.message(self._unit, action.stamp_ns)
