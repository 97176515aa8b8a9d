"""The overhead vision front end: small windows where bodies are expected, and a search for all the others."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from msrr_perception.detection.detector import Detector, PupilDetector
from msrr_perception.detection.windows import ExpectedTag, WindowPolicy, fitting_window, merged_windows
from msrr_perception.pose.global_pose import FlatTag, pose_jacobian
from msrr_perception.pose.overhead_model import OverheadModel
from msrr_scenes.arrays import Array
from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.messages import NS_PER_S, Detections, Exposure, Fetch, GlobalPose, TagDetection

#: What suits the overhead camera of the design.
OVERHEAD_POLICY = WindowPolicy(quiet_zone=0.15)

#: Contrast of a 4 px tile below which the search passes it over [grey levels]. Tags have about 200; a limit
#: near the noise lets every tile through, and the search takes 50 times longer.
_SEARCH_CONTRAST = 90

#: How far an expected tag may have been off last time and the next window still follow it [px].
_LARGEST_OFFSET_PX = 40.0


def default_search_detector() -> Detector:
    """Return a detector that finds black and white tags of 30 px and more in a whole frame, quickly."""
    return PupilDetector(quad_decimate=2.0, min_white_black_diff=_SEARCH_CONTRAST)


class OverheadVision:
    """Reads the top tags of units and obstacles from the overhead camera, from as few pixels as it can.

    What it does with an exposure:

    1. Windows around the tags that the predictions expect in view: the docking unit's in every exposure,
       those of bodies that were where they were expected ``settle_after`` times in a row only in every
       ``standing_every``-th. A tag that is not found is looked for once more in a wider window.
    2. The search for what is new: within ``search_period_s`` every part of the frame is looked at once, by
       the search detector.
    3. When the docking unit or its target is unknown or missing, the whole frame, at most every
       ``missing_period_s``.

    The search only says where to look: what it finds is read again by the detector in a window of its own,
    so that every corner delivered comes from the same kind of picture.

    A window follows the tag's own offset from where it was expected last time. That keeps a tag in its
    window whose *reported* pose is biased, as an outdoor localisation's is. A tag that was seen where nobody
    expected it is looked for there again, until the predictions have come round to it.
    """

    def __init__(
        self,
        model: OverheadModel,
        detector: Detector,
        search_detector: Detector | None = None,
        policy: WindowPolicy = OVERHEAD_POLICY,
        search_period_s: float = 1.0,
        search_parts: int = 1,
        missing_period_s: float = 0.3,
        standing_every: int = 4,
        settle_after: int = 5,
        retry_widen: float = 2.5,
        widest_px: int = 320,
        stray_px: float = 24.0,
    ) -> None:
        """Set up a front end that has seen nothing yet.

        Args:
            model: The overhead camera and the catalogue of tags.
            detector: Reads tags from windows.
            search_detector: Finds tags in large parts of the frame; None takes
                :func:`default_search_detector`.
            policy: How windows are cut.
            search_period_s: Time within which the whole frame is searched once.
            search_parts: Number of parts, searched in turn, that the frame is cut into. They overlap, so
                one part costs the fewest pixels, and many spread them most evenly.
            missing_period_s: Shortest time between two whole frames while a unit of the step is missing.
            standing_every: Period of looks at bodies that stand still [frames].
            settle_after: Sights in a row after which a body counts as standing still.
            retry_widen: Factor on a window's margins at the second look.
            widest_px: Largest edge of a window; a body less well known is left to the search.
            stray_px: How far a tag that nobody expected may move from one exposure to the next [px].

        Raises:
            SceneError: A parameter out of its range.
        """
        if min(search_parts, standing_every, settle_after) < 1 or retry_widen <= 1.0:
            raise SceneError(
                "overhead vision: search_parts, standing_every, settle_after must be at least 1, "
                "retry_widen above 1"
            )
        if min(search_period_s, missing_period_s) <= 0.0:
            raise SceneError("overhead vision: search_period_s and missing_period_s must be positive")
        self.model = model
        self._locator = model.localizer(corner_sigma_px=1.0)
        self._detector = detector
        self._searcher = search_detector or default_search_detector()
        self._policy = policy
        self._parts = search_windows(model, search_parts)
        self._part_period_ns = round(search_period_s * NS_PER_S / search_parts)
        self._missing_period_ns = round(missing_period_s * NS_PER_S)
        self._standing_every = standing_every
        self._settle_after = settle_after
        self._retry_widen = retry_widen
        self._widest = widest_px
        self._stray_px = stray_px
        self.reset()

    def reset(self) -> None:
        """Forget what earlier exposures showed."""
        self._turn = 0
        self._last_part_ns: int | None = None
        self._last_frame_ns: int | None = None
        self._offsets: dict[int, Array] = {}
        self._strays: dict[int, Array] = {}  # tag -> corners where it was seen unexpectedly last time
        self._settled: dict[int, int] = {}

    def search_next(self) -> None:
        """Begin a round of the search with the next exposure, whenever the last one was."""
        self._last_part_ns = self._last_frame_ns = None

    def look(self, exposure: Exposure, predictions: Mapping[str, GlobalPose], fetch: Fetch) -> Detections:
        """Read the tags of one exposure.

        Args:
            exposure: The frame at hand.
            predictions: Poses at the time of the exposure, by body; bodies that are not named are unknown.
            fetch: Gives the pixels of a window of this exposure.

        Returns:
            Every tag found in the windows read closely, by ascending id, and all windows in the order asked.
        """
        look = _Look(self._detector, self._searcher, fetch)
        expected = self._expected(predictions)
        asked = {i: e for i, e in expected.items() if self._is_due(i, exposure.frame)}
        room = np.full((4, 2), self._stray_px / self._policy.sigmas)
        strays = [ExpectedTag(i, pixels, room) for i, pixels in self._strays.items()]
        self._read(look, [*asked.values(), *strays], 1.0)
        missed = [e for i, e in asked.items() if i not in look.found]
        self._read(look, missed, self._retry_widen)
        self._search(look, exposure.stamp_ns, expected)
        self._remember(look, asked, predictions)
        return Detections(exposure, look.tags, tuple(look.windows))

    def glance(self, exposure: Exposure, middle_W: Array, half_m: float, fetch: Fetch) -> Detections:
        """Look only for what stands around one place; the units of the step are not looked for.

        Costs the pixels of that place and nothing else: what other looks go by stays as it was.

        Args:
            exposure: The frame at hand.
            middle_W: Middle of the place on the floor, shape (2,) [m].
            half_m: Half the edge of the square that is looked at [m].
            fetch: Gives the pixels of a window of this exposure.

        Returns:
            The tags found in the windows read: those of what stands there, and of the units of the step where
            they show beside it.
        """
        look = _Look(self._detector, self._searcher, fetch)
        window = fitting_window(self.model.square(middle_W, half_m), self.model.camera.frame)
        if window is not None:
            passed = {self.model.tag_of[unit] for unit in (self.model.own, self.model.target)}
            there = {i: px for i, px in look.roughly(window).items() if i in self.model.tags.keys() - passed}
            self._read(look, [ExpectedTag(i, px, np.zeros((4, 2))) for i, px in there.items()], 1.0)
        tags = tuple(tag for tag in look.tags if tag.tag_id in self.model.tags)
        return Detections(exposure, tags, tuple(look.windows))

    def _is_due(self, tag_id: int, frame: int) -> bool:
        if tag_id == self.model.tag_of[self.model.own] or self._settled.get(tag_id, 0) < self._settle_after:
            return True
        return (frame + tag_id) % self._standing_every == 0

    def _expected(self, predictions: Mapping[str, GlobalPose]) -> dict[int, ExpectedTag]:
        """Return the tags that should be wholly in the image at a place that is known well enough."""
        found = {}
        for tag_id, tag in self.model.tags.items():
            prediction = predictions.get(tag.name)
            if prediction is None:
                continue
            pixels = self._locator.pixels(tag, prediction.X_WB)
            pixels = pixels + self._offsets.get(tag_id, np.zeros(2))
            lo, hi = pixels.min(axis=0), pixels.max(axis=0)
            frame = self.model.camera.frame
            if lo.min() < -0.5 or hi[0] > frame.width - 0.5 or hi[1] > frame.height - 0.5:
                continue
            expected = ExpectedTag(tag_id, pixels, self._sigma(tag, prediction))
            box = expected.box(self._policy)
            if max(box.width, box.height) <= self._widest:
                found[tag_id] = expected
        return found

    def _sigma(self, tag: FlatTag, prediction: GlobalPose) -> Array:
        """Return the standard deviation of each corner coordinate, shape (4, 2) [px]."""
        A = pose_jacobian(prediction.X_WB, tag.corners_B[:, :2])
        scale = self.model.camera.focal / (float(self.model.X_WC.p[2]) - tag.height)
        variance = np.einsum("ij,jk,ik->i", A, prediction.covariance, A)
        sigma: Array = scale * np.sqrt(np.maximum(variance, 0.0)).reshape(4, 2)
        return sigma

    def _read(self, look: _Look, tags: Iterable[ExpectedTag], widen: float) -> None:
        boxes = (e.box(self._policy, widen) for e in tags)
        look.closely(merged_windows(boxes, self.model.camera.frame, self._policy))

    def _search(self, look: _Look, stamp_ns: int, expected: Mapping[int, ExpectedTag]) -> None:
        """Look for what is new and for what is missing; read closely what turns up."""
        hints: dict[int, Array] = {}
        essential = [self.model.tag_of[unit] for unit in (self.model.own, self.model.target)]
        lost = any(
            i not in look.found and (i not in expected or self._settled.get(i, 0) == 0) for i in essential
        )
        if lost and _past(stamp_ns, self._last_frame_ns, self._missing_period_ns):
            self._last_frame_ns = self._last_part_ns = stamp_ns
            hints = look.roughly(self.model.camera.frame)
        elif _past(stamp_ns, self._last_part_ns, self._part_period_ns):
            self._last_part_ns = stamp_ns
            hints = look.roughly(self._parts[self._turn % len(self._parts)])
            self._turn += 1
        unread = []
        for tag_id, pixels in hints.items():
            if tag_id in look.found or tag_id not in self.model.tags:
                continue
            seen = ExpectedTag(tag_id, pixels, np.zeros((4, 2)))
            where = expected.get(tag_id)
            if where is None or not where.box(self._policy).contains(Window.around(pixels, 0.0)):
                unread.append(seen)
        self._read(look, unread, 1.0)

    def _remember(
        self, look: _Look, asked: Mapping[int, ExpectedTag], predictions: Mapping[str, GlobalPose]
    ) -> None:
        self._strays = {}
        for tag_id in asked.keys() - look.found.keys():
            self._settled[tag_id] = 0
            self._offsets.pop(tag_id, None)
        for tag_id in look.found.keys() & self.model.tags.keys():
            corners = look.found[tag_id].corners
            tag = self.model.tags[tag_id]
            sights = self._settled.get(tag_id, 0)
            self._settled[tag_id] = sights + 1 if tag_id in asked else max(sights, 1)
            prediction = predictions.get(tag.name)
            offset = None
            if prediction is not None:
                offset = (corners - self._locator.pixels(tag, prediction.X_WB)).mean(axis=0)
            if offset is not None and float(np.linalg.norm(offset)) <= _LARGEST_OFFSET_PX:
                self._offsets[tag_id] = offset
            else:
                self._offsets.pop(tag_id, None)
                self._strays[tag_id] = corners


class _Look:
    """The windows looked at in one exposure, and the tags found in them."""

    def __init__(self, detector: Detector, searcher: Detector, fetch: Fetch) -> None:
        self.windows: list[Window] = []
        self.found: dict[int, TagDetection] = {}
        self._detector = detector
        self._searcher = searcher
        self._fetch = fetch

    @property
    def tags(self) -> tuple[TagDetection, ...]:
        """What was read closely, by ascending id."""
        return tuple(self.found[i] for i in sorted(self.found))

    def closely(self, windows: Sequence[Window]) -> None:
        """Read windows; of a tag found twice the clearer sight counts."""
        for window in windows:
            self.windows.append(window)
            for tag in self._detector.detect(self._fetch(window), window):
                known = self.found.get(tag.tag_id)
                if known is None or tag.decision_margin > known.decision_margin:
                    self.found[tag.tag_id] = tag

    def roughly(self, window: Window) -> dict[int, Array]:
        """Return where tags seem to be in a large window: tag id -> corners, shape (4, 2) [px]."""
        self.windows.append(window)
        return {t.tag_id: t.corners for t in self._searcher.detect(self._fetch(window), window)}


def _past(stamp_ns: int, last_ns: int | None, period_ns: int) -> bool:
    return last_ns is None or stamp_ns >= last_ns + period_ns


def search_windows(model: OverheadModel, parts: int) -> tuple[Window, ...]:
    """Cut the frame into upright parts that overlap so far that every tag lies wholly in one of them."""
    frame = model.camera.frame
    overlap = math.ceil(1.25 * model.largest_tag_px)  # with the white border
    step = math.ceil((frame.width - overlap) / parts)
    windows = (fitting_window(Window(i * step, 0, step + overlap, frame.height), frame) for i in range(parts))
    return tuple(w for w in windows if w is not None)
