"""The robot: what runs on the docking unit's computer.

It is made of the perception and the control room and sees images, wheel odometry, its own switches and the
clock. It imports nothing of the simulator, and a replay runs it again from a log.
"""

from __future__ import annotations

from dataclasses import replace

from msrr_bullet.profiler import NullProfiler, Profiler
from msrr_bullet.robot.collision_monitor import CollisionMonitor
from msrr_bullet.robot.overhead_localizer import OverheadLocalizer
from msrr_control.docking.controller import build_controller
from msrr_control.docking.law import DockSetup
from msrr_control.sequence.observation import Assembler, Observation
from msrr_control.sequence.state_machine import PhaseMachine
from msrr_control.staging.registry import build_assembler
from msrr_control.staging.setup import AssemblySetup
from msrr_perception.detection.detector import DETECTORS, Detector
from msrr_perception.detection.onboard_vision import OnboardVision
from msrr_perception.estimation.estimator import ESTIMATORS, Estimator
from msrr_perception.estimation.los import LosEstimator
from msrr_perception.pose.target import TargetModel
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import (
    NS_PER_S,
    Action,
    ArenaEstimate,
    AssemblyPath,
    AssemblyProgress,
    Belief,
    Detections,
    Exposure,
    Fetch,
    LockFeedback,
    LosObservation,
    Phase,
    PoseEstimate,
    PoseMeasurement,
    SeatSwitches,
    SensorMessage,
    Twist,
    WheelOdometry,
    seconds,
)
from msrr_scenes.registry import build
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.scene import Scene

#: Period of the onboard camera's routine look at its full frame [frames].
FULL_LOOK_EVERY = 50

#: Phases that go by the overhead camera.
_GLOBAL = frozenset({Phase.ASSEMBLE, Phase.HAND_OVER})

#: Phases in which the overhead camera exposes: also where the unit drives where its own does not look.
_OVERLOOKED = _GLOBAL | {Phase.RETREAT}

#: Period of the glances from above at what stands around a unit that drives to the port [ns].
_GLANCE_NS = NS_PER_S

#: Middle of a glance in the unit's frame: a post of 8 cm is wholly seen before a unit at 0.25 m/s, twice what
#: the laws drive in front of a port, comes as near as it could still stop.
_GLANCED = SE2(0.2, 0.0, 0.0)


class Autonomy:
    """One docking unit during one step of the plan.

    The scene tells it what its makers would: geometry, calibration, sensor data sheets, the plan. It never
    looks at where the scene puts anybody.
    """

    def __init__(self, scene: Scene, step: DockStep, profiler: Profiler | None = None) -> None:
        """Set up the robot for one step.

        Args:
            scene: What its makers know.
            step: What it is to do.
            profiler: Measures the time of the collision monitor.

        Raises:
            UnknownNameError: Detector, estimator or controller that nobody answers to.
            SceneError: Their parameters are wrong, or the target cannot be docked to by sight.
        """
        target = TargetModel.from_scene(scene, step)
        detector: Detector = build("detector", scene.control.detector, DETECTORS)
        self._estimator: Estimator = build(
            "estimator",
            scene.control.estimator,
            ESTIMATORS,
            target,
            scene.odometry,
            delay_compensation=scene.control.delay_compensation,
        )
        whole = scene.cameras.onboard.readout == "frames"  # then a window saves nothing
        self._vision = OnboardVision(target, detector, full_every=1 if whole else FULL_LOOK_EVERY)
        self._los_estimator = LosEstimator(target)
        self._above = OverheadLocalizer.of(scene, step, detector)
        setup = DockSetup.of(scene, step)
        self._assembler: Assembler | None = None
        if self._above is not None:
            self._assembler = build_assembler(scene.control.assembly, AssemblySetup.of(scene, step))
        controller = build_controller(scene.control.docking, setup)
        self._phases = PhaseMachine(scene.docking, setup, controller, self._assembler)
        self._guard = CollisionMonitor(scene, step) if self._above else None
        self._profiler = profiler or NullProfiler()
        self._onboard = target.camera_name
        self._wheel_radius, self._track = target.wheel_radius, target.track
        self._readings: tuple[WheelOdometry, WheelOdometry] | None = None
        self._newest: WheelOdometry | None = None
        self._switches: SeatSwitches | None = None
        self._lock: LockFeedback | None = None
        self._now_ns = 0
        self._glanced_ns = 0
        self.estimate: PoseEstimate | None = None
        self.los: LosObservation | None = None
        self.situation: ArenaEstimate | None = None

    @property
    def belief(self) -> Belief:
        """What the robot says about this step."""
        return self._phases.belief

    @property
    def assembly(self) -> AssemblyProgress | None:
        """What the long-distance phase did at the last instant; None when it is not at work."""
        if self._phases.phase is not Phase.ASSEMBLE:
            return None
        return getattr(self._assembler, "progress", None)

    @property
    def path(self) -> AssemblyPath | None:
        """The path that the long-distance phase follows or followed last."""
        return getattr(self._assembler, "path", None)

    def wants(self, camera: str) -> bool:
        """Say whether the frames of a camera are of any use in this phase; the others need not expose."""
        if camera == self._onboard:
            return self._phases.phase is not Phase.ASSEMBLE
        return self._phases.phase in _OVERLOOKED or self._glances()

    def expose(self, exposure: Exposure, fetch: Fetch) -> Detections | None:
        """Look at a frame at the instant of its exposure; the result is known only when it is received."""
        if exposure.camera == self._onboard:
            return self._vision.detect(exposure, self._estimator.predict(exposure.stamp_ns), fetch)
        if self._above is None:
            return None
        if self._phases.phase is Phase.DOCK and self.situation is not None:
            self._glanced_ns = exposure.stamp_ns
            return self._above.glance(exposure, self.situation.own.X_WB @ _GLANCED, fetch)
        return self._above.look(exposure, fetch)

    def _glances(self) -> bool:
        """Say whether it is time for a glance: the unit's own camera shows the port, and no obstacle."""
        if self._phases.phase is not Phase.DOCK or self._above is None or self.situation is None:
            return False
        newest_ns = max(self._glanced_ns, self._above.newest_ns or 0)
        return self._now_ns - newest_ns >= _GLANCE_NS

    def receive(self, message: SensorMessage) -> None:
        """Take in a message that has arrived."""
        match message:
            case WheelOdometry():
                self._estimator.add_odometry(message)
                if self._newest is not None:
                    self._readings = (self._newest, message)
                self._newest = message
            case Detections() if message.exposure.camera == self._onboard:
                self._estimator.add_detections(message)
                self._los_estimator.add_detections(message)
            case PoseMeasurement():
                self._estimator.add_pose(message)
                self._los_estimator.add_pose(message)
            case SeatSwitches():
                self._switches = message
            case LockFeedback():
                self._lock = message
        if self._above is not None:
            self._above.receive(message)

    def step(self, now_ns: int) -> Action:
        """Decide at one control instant."""
        self._now_ns = now_ns
        self.estimate = self._estimator.estimate(now_ns)
        self.los = self._los_estimator.observe(now_ns, self._estimator)
        if self._above is not None:
            near = self._phases.phase not in _GLOBAL
            self.situation = self._above.situation(now_ns, self.estimate if near else None)
        before = self._phases.phase
        action = self._phases.step(
            Observation(
                now_ns=now_ns,
                pose=self.estimate,
                los=self.los,
                switches=self._switches,
                lock=self._lock,
                twist=self._twist(),
                situation=self.situation,
                looked_around_ns=self._above.newest_ns if self._above else None,
            )
        )
        if action.phase is Phase.ASSEMBLE and before is not Phase.ASSEMBLE:
            # What the camera on board saw from somewhere else is of no use for the next look.
            for part in (self._estimator, self._los_estimator, self._vision):
                part.reset()
        if self._above is not None and action.phase is Phase.RETREAT and before is not Phase.RETREAT:
            self._above.search_next()  # something may have come up behind the unit since the last look
        return self._limit_by_clearance(action)

    def _limit_by_clearance(self, action: Action) -> Action:
        """Let the clearance guard have the last word on the command."""
        if self._guard is None:
            return action
        docking = action.phase not in _GLOBAL
        with self._profiler("guard"):
            decision = self._guard.limit(action.twist, self.situation, action.stamp_ns, docking)
        return action if decision.twist is action.twist else replace(action, twist=decision.twist)

    def _twist(self) -> Twist:
        """Return the velocity that the last two encoder readings tell."""
        if self._readings is None:
            return Twist()
        before, after = self._readings
        dt = seconds(after.stamp_ns - before.stamp_ns)
        left = self._wheel_radius * (after.left - before.left) / dt
        right = self._wheel_radius * (after.right - before.right) / dt
        return Twist(0.5 * (left + right), (right - left) / self._track)
