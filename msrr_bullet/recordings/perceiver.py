"""The perception of a robot on a recording: detector, windows, corner filter and line of sight."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field

import numpy as np

from msrr_bullet.log import topics
from msrr_bullet.log.recorder import Recorder
from msrr_bullet.recordings.recording import Item as RecordedItem
from msrr_bullet.recordings.recording import RecordedFrame, RecordingError, WheelReading, moments
from msrr_perception.detection.detector import DETECTORS, Detector
from msrr_perception.detection.onboard_vision import FULL_FRAME_PERIOD, OnboardVision
from msrr_perception.estimation.calibration_errors import EstimatedCalibrationError
from msrr_perception.estimation.corner_filter import CornerEkf
from msrr_perception.estimation.estimator import ESTIMATORS, Estimator
from msrr_perception.estimation.los import LosEstimator
from msrr_perception.motion.motion_noise import DEFAULT_NOISE, MotionNoise
from msrr_perception.photographs.picture_files import PictureError
from msrr_perception.pose.target import TargetModel
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.messages import (
    NS_PER_S,
    Detections,
    Exposure,
    LosObservation,
    Pixels,
    PoseEstimate,
    WheelOdometry,
)
from msrr_scenes.registry import build, resolve
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.target import ROBOT, RobotSpec

#: Time without wheel readings after which a frame is exposed without any [ns]: the slowest encoders are read
#: once a second.
_SILENT_NS = 3 * NS_PER_S // 2


@dataclass(frozen=True, slots=True, eq=False)
class PerceivedInstant:
    """What is known at one instant of a recording.

    Attributes:
        stamp_ns: Time.
        estimate: Pose of the robot in the dock frame D; None while nothing is known.
        los: Line of sight to the target.
        arrived: Tags of the frame that arrived at this instant; None at other instants.
        agrees: Whether its tags agreed with the estimate that goes by earlier frames and the wheels, or were
            the first. Where the filter begins anew, they did not.
    """

    stamp_ns: int
    estimate: PoseEstimate | None
    los: LosObservation
    arrived: Detections | None
    agrees: bool


def random_walk(robot: RobotSpec, frame_period_s: float) -> MotionNoise:
    """Return the motion that is assumed without odometry: a random walk of a robot that stands.

    Its standard deviation over the time between two frames is the way at the largest speed, in every
    direction; so a robot that keeps to that speed stays within one.
    """
    root = math.sqrt(frame_period_s)
    return MotionNoise(
        drift=robot.speed_mps * root,
        turn_drift=robot.turn_rate_radps * root,
        tilt_sigma=DEFAULT_NOISE.tilt_sigma,
    )


@dataclass
class Perceiver:
    """Runs perception over a recording and records what it reads and estimates, as a trial does.

    ``report`` is called with the message about every picture that cannot be used. ``motion`` is assumed in
    the place of wheel readings; None if there are any.

    Attributes:
        without_wheels: Spans of time [ns] in which frames were exposed that no wheel readings are near to, so
            that the robot was taken to stand. There are none if ``motion`` is assumed.
    """

    scene: Scene
    recorder: Recorder
    report: Callable[[str], None]
    motion: MotionNoise | None = None
    without_wheels: list[tuple[int, int]] = field(default_factory=list, init=False)
    _wheels_ns: int | None = field(default=None, init=False)  # newest reading, or the first frame before it
    _exposed_ns: int | None = field(default=None, init=False)
    _arriving: dict[int, Detections] = field(default_factory=dict, init=False)

    def __post_init__(self) -> None:
        scene = self.scene
        self.target = TargetModel.from_scene(scene, scene.docks[0])
        detector: Detector = build("control.detector", scene.control.detector, DETECTORS)
        whole = scene.cameras.onboard.readout == "frames"
        self._vision = OnboardVision(self.target, detector, full_every=1 if whole else FULL_FRAME_PERIOD)
        self._estimator = self._build_estimator()
        self._used = 0  # exposures that agreed with the estimate
        self._los = LosEstimator(self.target)

    def _build_estimator(self) -> Estimator:
        choice, fixed = self.scene.control.estimator, {}
        if self.motion is not None and resolve("control.estimator", choice.name, ESTIMATORS) is CornerEkf:
            fixed["motion"] = self.motion
        estimator: Estimator = build(
            "control.estimator",
            choice,
            ESTIMATORS,
            self.target,
            self.scene.odometry,
            delay_compensation=self.scene.control.delay_compensation,
            **fixed,
        )
        return estimator

    def calibration_errors(self) -> tuple[EstimatedCalibrationError, ...]:
        """Return what the estimator has learned of the errors of calibration; none of one of a user's own."""
        return self._estimator.calibration_errors() if isinstance(self._estimator, CornerEkf) else ()

    def run(self, items: Iterable[RecordedItem]) -> Iterator[PerceivedInstant]:
        """Yield what is known at the arrival of every frame, and at the decisions of the recording.

        Raises:
            RecordingError: The recording is damaged from some message on; what came before was yielded.
        """
        pending: tuple[int, Detections | None] | None = None
        damage: RecordingError | None = None
        try:
            for moment in moments(items):
                if pending is not None and pending[0] < moment.at_ns:
                    yield self._instant(*pending)
                    pending = None
                item = moment.item
                if isinstance(item, WheelReading):
                    reading = WheelOdometry(ROBOT, item.stamp_ns, item.left, item.right)
                    self.recorder.write(topics.sensor(ROBOT, reading), moment.at_ns, reading)
                    self._estimator.add_odometry(reading)
                    self._wheels_ns = max(item.stamp_ns, self._wheels_ns or 0)
                elif isinstance(item, RecordedFrame) and moment.exposes:
                    self._expose(item)
                elif isinstance(item, RecordedFrame):
                    if pending is not None and pending[1] is not None:  # two frames arrive at the same time
                        yield self._instant(*pending)
                    pending = (moment.at_ns, self._deliver(item, moment.at_ns))
                else:
                    pending = (moment.at_ns, pending[1] if pending else None)
        except RecordingError as error:
            damage = error
        if pending is not None:
            yield self._instant(*pending)
        if damage is not None:
            raise damage

    def _expose(self, frame: RecordedFrame) -> None:
        """Read the tags of a frame, with what is known when it is exposed."""
        try:
            self._check_stamp(frame)
            pixels = self.read(frame)
        except PictureError as error:
            self.report(str(error))
            return
        self._exposed_ns = frame.stamp_ns
        self._look_for_wheels(frame.stamp_ns)
        exposure = Exposure(self.target.camera_name, frame.number, frame.stamp_ns)
        self.recorder.write(topics.exposure(exposure.camera), frame.stamp_ns, exposure)

        def fetch(window: Window) -> Pixels:
            part = np.ascontiguousarray(pixels[window.y : window.y_end, window.x : window.x_end])
            self.recorder.window(exposure, window, part)
            return part

        prediction = self._estimator.predict(frame.stamp_ns)
        self._arriving[frame.number] = self._vision.detect(exposure, prediction, fetch)

    def _look_for_wheels(self, stamp_ns: int) -> None:
        """Take a note of a frame that is exposed long after the last wheel reading, or the first frame."""
        since_ns = self._wheels_ns = stamp_ns if self._wheels_ns is None else self._wheels_ns
        if self.motion is not None or stamp_ns - since_ns <= _SILENT_NS:
            return
        spans = self.without_wheels
        if spans and spans[-1][0] == since_ns:
            spans[-1] = spans[-1][0], stamp_ns
        else:
            spans.append((since_ns, stamp_ns))

    def _check_stamp(self, frame: RecordedFrame) -> None:
        """Refuse a frame that was exposed with the one before: it may be the same, with the same noise."""
        if frame.stamp_ns == self._exposed_ns:
            raise PictureError(f"{frame.name}: it has the time stamp of another frame, which is used instead")

    def read(self, frame: RecordedFrame) -> Pixels:
        """Return the pixels of a frame.

        Raises:
            PictureError: It cannot be read, or is of another size than the calibration.
        """
        pixels, camera = frame.decode(), self.target.camera
        if pixels.shape != (camera.height, camera.width):
            height, width = pixels.shape
            raise PictureError(
                f"{frame.name}: {width} x {height} px, and the calibration is of pictures of "
                f"{camera.width} x {camera.height} px"
            )
        return pixels

    def _deliver(self, frame: RecordedFrame, now_ns: int) -> Detections | None:
        found = self._arriving.pop(frame.number, None)
        if found is not None:
            self.recorder.write(topics.sensor(ROBOT, found), now_ns, found)
            self._estimator.add_detections(found)
            self._los.add_detections(found)
        return found

    def _instant(self, now_ns: int, arrived: Detections | None) -> PerceivedInstant:
        estimate = self._estimator.estimate(now_ns)
        los = self._los.observe(now_ns, self._estimator)
        if estimate is not None:
            self.recorder.write(topics.estimate(ROBOT), now_ns, estimate)
        self.recorder.write(topics.los(ROBOT), now_ns, los)
        return PerceivedInstant(now_ns, estimate, los, arrived, self._agrees(estimate, arrived))

    def _agrees(self, estimate: PoseEstimate | None, arrived: Detections | None) -> bool:
        if estimate is None or arrived is None:
            return False
        if estimate.exposures is None:  # an estimator of a user's own
            return estimate.last_seen_ns == arrived.exposure.stamp_ns
        before, self._used = self._used, estimate.exposures.used
        return self._used > before
