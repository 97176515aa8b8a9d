"""The robot: what runs on the docking unit's computer.

It is made of the perception and the control room and sees images, wheel odometry, its own switches and the
clock. It imports nothing of the simulator, and a replay runs it again from a log.
"""

from __future__ import annotations

from msrr_control.controller import build_controller
from msrr_control.law import DockSetup
from msrr_control.phases import PhaseMachine
from msrr_control.senses import Senses
from msrr_perception.detector import DETECTORS, Detector
from msrr_perception.estimator import ESTIMATORS, Estimator
from msrr_perception.los import LosEstimator
from msrr_perception.target import TargetModel
from msrr_perception.vision import OnboardVision
from msrr_scenes.messages import (
    Action,
    Belief,
    Detections,
    Exposure,
    Fetch,
    LockFeedback,
    LosObservation,
    PoseEstimate,
    PoseMeasurement,
    SeatSwitches,
    SensorMessage,
    Twist,
    WheelOdometry,
    seconds,
)
from msrr_scenes.plan import DockStep
from msrr_scenes.registry import build
from msrr_scenes.scene import Scene


class Autonomy:
    """One docking unit during one step of the plan.

    The scene tells it what its makers would: geometry, calibration, sensor data sheets, the plan. It never
    looks at where the scene puts anybody.
    """

    def __init__(self, scene: Scene, step: DockStep) -> None:
        """Set up the robot for one step.

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
        setup = DockSetup.of(scene, step)
        self._vision = OnboardVision(target, detector)
        if scene.cameras.onboard.readout == "frames":  # a window saves nothing then: look at all of it
            self._vision = OnboardVision(target, detector, full_every=1)
        self._los_estimator = LosEstimator(target)
        self._phases = PhaseMachine(scene.docking, setup, build_controller(scene.control.docking, setup))
        self._wheel_radius, self._track = target.wheel_radius, target.track
        self._readings: tuple[WheelOdometry, WheelOdometry] | None = None
        self._newest: WheelOdometry | None = None
        self._switches: SeatSwitches | None = None
        self._lock: LockFeedback | None = None
        self.estimate: PoseEstimate | None = None
        self.los: LosObservation | None = None

    @property
    def belief(self) -> Belief:
        """What the robot says about this step."""
        return self._phases.belief

    def expose(self, exposure: Exposure, fetch: Fetch) -> Detections:
        """Look at a frame at the instant of its exposure; the result is known only when it is received."""
        return self._vision.look(exposure, self._estimator.predict(exposure.stamp_ns), fetch)

    def receive(self, message: SensorMessage) -> None:
        """Take in a message that has arrived."""
        match message:
            case WheelOdometry():
                self._estimator.add_odometry(message)
                if self._newest is not None:
                    self._readings = (self._newest, message)
                self._newest = message
            case Detections():
                self._estimator.add_detections(message)
                self._los_estimator.add_detections(message)
            case PoseMeasurement():
                self._estimator.add_pose(message)
                self._los_estimator.add_pose(message)
            case SeatSwitches():
                self._switches = message
            case LockFeedback():
                self._lock = message

    def step(self, now_ns: int) -> Action:
        """Decide at one control instant."""
        self.estimate = self._estimator.estimate(now_ns)
        self.los = self._los_estimator.observe(now_ns, self._estimator)
        return self._phases.step(
            Senses(
                now_ns=now_ns,
                pose=self.estimate,
                los=self.los,
                switches=self._switches,
                lock=self._lock,
                twist=self._twist(),
            )
        )

    def _twist(self) -> Twist:
        """Return the velocity that the last two encoder readings tell."""
        if self._readings is None:
            return Twist()
        before, after = self._readings
        dt = seconds(after.stamp_ns - before.stamp_ns)
        left = self._wheel_radius * (after.left - before.left) / dt
        right = self._wheel_radius * (after.right - before.right) / dt
        return Twist(0.5 * (left + right), (right - left) / self._track)
