"""The onboard vision front end, which chooses the windows of an exposure and reads the tags in them."""

from __future__ import annotations

import math
from collections.abc import Sequence

from msrr_perception.detection.detector import Detector, detector_for, detectors_by_size, for_camera
from msrr_perception.detection.frame_reader import FrameReader
from msrr_perception.detection.windows import (
    DEFAULT_POLICY,
    RETRY_WIDEN,
    ExpectedTag,
    WindowPolicy,
    choose_tags,
    expected_tags,
    plan_windows,
    pose_is_known,
)
from msrr_perception.kernels.lens import optic_of
from msrr_perception.pose.target import TargetModel
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.messages import Detections, Exposure, Fetch, PoseEstimate

#: Period with which the onboard camera of a robot searches the full frame [frames].
FULL_FRAME_PERIOD = 100

#: Period of full frames while no tag is expected in view [frames].
_SEARCH_PERIOD = 5

#: Misses in a row after which a tag rests; one alone may come from a wrong prediction or from noise. And the
#: number of frames for which it rests.
_MISSES_BEFORE_REST, _REST = 2, 5

#: Standard deviations of position [m] and yaw [rad] above which a prediction is not used.
_KNOWN_M, _KNOWN_YAW = 0.15, math.radians(15.0)


class OnboardVision:
    """Reads the target's tags from the docking unit's camera, from as few pixels as possible.

    It reads of an exposure:

    1. The full frame if nothing is known, the prediction is poor, or the last exposure showed no tag.
    2. The full frame every ``full_every`` frames, whatever the prediction.
    3. If the prediction has no tag in view, the full frame every five frames, else nothing.
    4. Otherwise windows around the tags that :func:`msrr_perception.detection.windows.choose_tags` picks. A
       tag that is missing twice in a row (it may be hidden) is skipped for the next five frames. When none
       is found, larger windows of all expected tags follow, then the full frame.

    Where all tags to be read should be large, the search runs at down to a quarter of the resolution, and
    at full resolution if one of them is not found.
    """

    def __init__(
        self,
        target: TargetModel,
        detector: Detector,
        policy: WindowPolicy = DEFAULT_POLICY,
        full_every: int = FULL_FRAME_PERIOD,
    ) -> None:
        """Create a front end that has seen nothing yet, with the rules by which windows are cut."""
        self.target = target
        self._optic = optic_of(target.lens)
        errors = target.corner_errors
        self.detector = for_camera(detector, target.lens, errors.blur_px, errors.noise_grey)
        self._detectors = detectors_by_size(self.detector)
        self.policy = policy.for_family(target.tag_family)
        self._full_every = full_every
        self.reset()

    def reset(self) -> None:
        """Forget what earlier exposures showed."""
        self._blank = False  # the last exposure was read and showed no tag
        self._misses: dict[int, int] = {}  # tag -> number of times in a row that it was missing
        self._resting: dict[int, int] = {}  # tag -> number of the first frame in which it is read again

    def detect(self, exposure: Exposure, prediction: PoseEstimate | None, fetch: Fetch) -> Detections:
        """Read the target's tags from one exposure.

        The prediction is that of the pose at the time of the exposure; None if nothing is known.

        Returns:
            Every tag found, by ascending id, and the windows in the order in which they were fetched.
        """
        reader = FrameReader(fetch, self._optic, self.target.to_light)
        frame = (self.target.camera.frame,)
        expected: Sequence[ExpectedTag] = ()
        known = prediction is not None and pose_is_known(prediction, _KNOWN_M, _KNOWN_YAW)
        if prediction is not None and known:
            expected = expected_tags(self.target, prediction, self.policy)
        if not known:
            reader.read(frame, self.detector)
        elif exposure.frame % self._full_every == 0:
            self._read(reader, frame, expected, self._chosen(expected, exposure.frame))
        elif expected and not self._blank:
            self._read_windows(reader, expected, exposure.frame)
        elif expected or exposure.frame % _SEARCH_PERIOD == 0:
            reader.read(frame, self.detector)
        found = self._target_tags(reader)
        self._blank = bool(reader.windows) and not found
        for tag in found:
            self._resting.pop(tag, None)
            self._misses.pop(tag, None)
        return reader.detections(exposure)

    def _chosen(self, expected: Sequence[ExpectedTag], frame: int) -> tuple[ExpectedTag, ...]:
        """Return those of the expected tags that do not rest and fit into the budget of pixels."""
        awake = [e for e in expected if self._resting.get(e.tag_id, frame) <= frame]
        return choose_tags(self.target, awake, frame, self.policy)

    def _read_windows(self, reader: FrameReader, expected: Sequence[ExpectedTag], frame: int) -> None:
        chosen = self._chosen(expected, frame)
        wanted = {e.tag_id for e in chosen}
        frame_window = self.target.camera.frame
        self._read(reader, plan_windows(frame_window, chosen, self.policy), chosen, chosen)
        if chosen and not self._target_tags(reader):
            windows = plan_windows(frame_window, expected, self.policy, RETRY_WIDEN)
            reader.read(windows, self.detector)
        if not self._target_tags(reader):
            reader.read((frame_window,), self.detector)
        for tag in wanted - self._target_tags(reader):
            self._misses[tag] = self._misses.get(tag, 0) + 1
            if self._misses[tag] >= _MISSES_BEFORE_REST:
                self._resting[tag] = frame + 1 + _REST

    def _read(
        self,
        reader: FrameReader,
        windows: Sequence[Window],
        shown: Sequence[ExpectedTag],
        wanted: Sequence[ExpectedTag],
    ) -> None:
        """Read windows by the size of the tags shown; again at full resolution if one wanted is missing."""
        upright_px = min((e.upright_edge for e in shown), default=0.0)
        detector = detector_for(self._detectors, upright_px)
        reader.read(windows, detector)
        if detector is not self.detector and not reader.found.keys() >= {e.tag_id for e in wanted}:
            reader.read_again(self.detector)

    def _target_tags(self, reader: FrameReader) -> set[int]:
        return reader.found.keys() & self.target.corners_D.keys()
