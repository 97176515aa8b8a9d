"""The onboard vision front end: chooses the windows of an exposure, reads the tags in them, looks again."""

from __future__ import annotations

import math
from collections.abc import Sequence

from msrr_perception.detection.detector import LARGE_TAG_PX, Detector, for_large_tags
from msrr_perception.detection.windows import (
    DEFAULT_POLICY,
    ExpectedTag,
    WindowPolicy,
    choose_tags,
    expected_tags,
    plan_windows,
    pose_is_known,
)
from msrr_perception.pose.target import TargetModel
from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.messages import Detections, Exposure, Fetch, Pixels, PoseEstimate, TagDetection

#: One miss may be a wrong prediction or bad luck with the noise.
_MISSES_BEFORE_REST = 2


class OnboardVision:
    """Reads the target's tags from the docking unit's camera, from as few pixels as it can.

    What it does with an exposure:

    1. Nothing is known, the prediction is poor, or the last look found nothing: the full frame.
    2. Every ``full_every`` frames: the full frame, whatever is believed.
    3. The prediction says that no tag is in view: the full frame every ``search_every`` frames, else nothing.
    4. Otherwise windows around the tags that :func:`msrr_perception.detection.windows.choose_tags` picks. A
    tag that
       is missing twice while others are found (hidden, say) is not asked for during the next ``rest`` frames.
       Large tags are searched at half the resolution, and at the whole if one of them is not found there.
       When none is found, larger windows of all expected tags follow, then the full frame of the same
       exposure.
    """

    def __init__(
        self,
        target: TargetModel,
        detector: Detector,
        policy: WindowPolicy = DEFAULT_POLICY,
        full_every: int = 100,
        search_every: int = 5,
        rest: int = 5,
        retry_widen: float = 2.5,
        known_m: float = 0.15,
        known_yaw: float = math.radians(15.0),
    ) -> None:
        """Set up a front end that has seen nothing yet.

        Args:
            target: Camera and map of the tags.
            detector: Reads tags from pixels.
            policy: How windows are cut.
            full_every: Period of the routine look at the full frame [frames].
            search_every: Period of full looks while no tag is expected in view [frames].
            rest: For how long a missing tag is not asked for [frames].
            retry_widen: Factor on a window's margins at the second look.
            known_m: Standard deviation of the position above which a prediction is not used [m].
            known_yaw: The same of the yaw [rad].

        Raises:
            SceneError: A parameter out of its range.
        """
        if min(full_every, search_every, rest) < 1 or retry_widen <= 1.0:
            raise SceneError("vision: full_every, search_every, rest must be at least 1, retry_widen above 1")
        self.target = target
        self.detector = detector
        self._quick = for_large_tags(detector)
        self.policy = policy
        self._full_every = full_every
        self._search_every = search_every
        self._rest = rest
        self._retry_widen = retry_widen
        self._known_m = known_m
        self._known_yaw = known_yaw
        self.reset()

    def reset(self) -> None:
        """Forget what earlier exposures showed."""
        self._blank = False  # the last look found nothing
        self._misses: dict[int, int] = {}  # tag -> how often in a row it was asked for and not found
        self._resting: dict[int, int] = {}  # tag -> number of the first frame that may ask for it again

    def look(self, exposure: Exposure, prediction: PoseEstimate | None, fetch: Fetch) -> Detections:
        """Read the target's tags from one exposure.

        Args:
            exposure: The frame at hand.
            prediction: The pose at the time of the exposure, or None.
            fetch: Gives the pixels of a window of this exposure.

        Returns:
            Every tag found in the windows asked for, by ascending id, and those windows in the order asked.
        """
        look = _Look(self.target.camera.frame, self.detector, fetch)
        known = prediction is not None and pose_is_known(prediction, self._known_m, self._known_yaw)
        if prediction is None or not known or exposure.frame % self._full_every == 0:
            look.at_frame()
        else:
            expected = expected_tags(self.target, prediction, self.policy)
            if expected and self._blank:
                look.at_frame()
            elif expected:
                self._look_closely(look, expected, exposure.frame)
            elif exposure.frame % self._search_every == 0:
                look.at_frame()
        found = self._target_tags(look)
        self._blank = bool(look.windows) and not found
        for tag in found:
            self._resting.pop(tag, None)
            self._misses.pop(tag, None)
        return Detections(exposure, look.tags, tuple(look.windows))

    def _look_closely(self, look: _Look, expected: Sequence[ExpectedTag], frame: int) -> None:
        awake = [e for e in expected if self._resting.get(e.tag_id, frame) <= frame]
        asked = choose_tags(self.target, awake, frame, self.policy)
        windows = plan_windows(self.target, asked, self.policy)
        large = all(e.shortest_edge >= LARGE_TAG_PX for e in asked)
        look.at(windows, self._quick if large else None)
        if large and self._quick is not self.detector and not {e.tag_id for e in asked} <= look.ids:
            look.again()
        if asked and not self._target_tags(look):
            look.at(plan_windows(self.target, expected, self.policy, self._retry_widen))
        if not self._target_tags(look):
            look.at_frame()
        for tag in {e.tag_id for e in asked} - self._target_tags(look):
            self._misses[tag] = self._misses.get(tag, 0) + 1
            if self._misses[tag] >= _MISSES_BEFORE_REST:
                self._resting[tag] = frame + 1 + self._rest

    def _target_tags(self, look: _Look) -> frozenset[int]:
        return look.ids & self.target.corners_D.keys()


class _Look:
    """The windows looked at in one exposure, and the tags found in them."""

    def __init__(self, frame: Window, detector: Detector, fetch: Fetch) -> None:
        self.windows: list[Window] = []
        self._frame = frame
        self._detector = detector
        self._fetch = fetch
        self._found: dict[int, TagDetection] = {}
        self._read: list[tuple[Pixels, Window]] = []

    @property
    def tags(self) -> tuple[TagDetection, ...]:
        """What was found, by ascending id; of a tag found twice the clearer one."""
        return tuple(self._found[i] for i in sorted(self._found))

    @property
    def ids(self) -> frozenset[int]:
        """Ids of what was found."""
        return frozenset(self._found)

    def at(self, windows: Sequence[Window], detector: Detector | None = None) -> None:
        """Read some windows, by ``detector`` if another one than usual is to look."""
        for window in windows:
            self.windows.append(window)
            pixels = self._fetch(window)
            self._read.append((pixels, window))
            self._search(detector or self._detector, pixels, window)

    def again(self) -> None:
        """Look once more, with the usual detector, at all that has been read."""
        for pixels, window in self._read:
            self._search(self._detector, pixels, window)

    def at_frame(self) -> None:
        self.at((self._frame,))

    def _search(self, detector: Detector, pixels: Pixels, window: Window) -> None:
        for tag in detector.detect(pixels, window):
            known = self._found.get(tag.tag_id)
            if known is None or tag.decision_margin > known.decision_margin:
                self._found[tag.tag_id] = tag
