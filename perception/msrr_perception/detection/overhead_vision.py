"""The overhead vision front end: small windows where bodies are expected, and a search for all the others."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence

import numpy as np

from msrr_perception.detection.detector import (
    Detector,
    default_search_detector,
    detector_for,
    detectors_by_size,
    for_camera,
)
from msrr_perception.detection.frame_reader import FrameReader
from msrr_perception.detection.windows import (
    RETRY_WIDEN,
    ExpectedTag,
    WindowPolicy,
    fitting_window,
    plan_windows,
    tags_in_frame,
)
from msrr_perception.kernels.lens import optic_of
from msrr_perception.pose.global_pose import FlatTag, pose_jacobian
from msrr_perception.pose.overhead_model import OverheadModel
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.messages import NS_PER_S, Detections, Exposure, Fetch, GlobalPose

#: The window policy for the overhead camera of the design.
OVERHEAD_POLICY = WindowPolicy(quiet_zone=0.15)

#: Time within which the whole frame is searched once, and shortest time between two searches while a unit
#: that matters is missing [ns].
_SEARCH_NS, _MISSING_NS = NS_PER_S, 300_000_000

#: Number of sightings in a row after which a body counts as standing still.
_SETTLE_AFTER = 6

#: Largest edge of a window [px]; a body known less well is left to the search.
_WIDEST_PX = 320

#: Largest motion of an unexpected tag from one exposure to the next [px].
_STRAY_PX = 24.0

#: Largest distance of a tag from where it was expected that the next window still follows [px].
_LARGEST_OFFSET_PX = 40.0

#: Largest motion of the corners of a tag whose body stands [px].
_STILL_PX = 0.5

#: Standard deviations of corners that a search has found in this exposure [px].
_EXACT = np.zeros((4, 2))


class OverheadVision:
    """Reads the top tags of units and obstacles from the overhead camera, from as few pixels as possible.

    It reads of an exposure:

    1. Windows around the tags that the predictions expect in view: those of units that may drive in every
       exposure, those of bodies that had not moved from where they were expected six times in a row only in
       every ``standing_every``-th, and half as often where no unit comes near meanwhile. A tag that is not
       found is read for once more in a wider window.
    2. The full frame, searched for unknown bodies once in a second. Nothing is searched for while all tags of
       the catalogue are read where they are expected.
    3. The full frame as well, at most every 0.3 s, when one of the units that matter is unknown or missing.

    The search only says where to read: a tag that it finds is read again by the detector in a window of its
    own, so that every corner delivered comes from the same kind of image.

    A window follows the tag's own offset from where it was expected last time. That keeps a tag in its
    window whose *reported* pose is biased, as an outdoor localisation's is. A tag that was seen where it was
    not expected is read for there again, until the predictions agree.
    """

    def __init__(
        self,
        model: OverheadModel,
        units: Sequence[str],
        detector: Detector,
        search_detector: Detector | None = None,
        policy: WindowPolicy = OVERHEAD_POLICY,
        standing_every: int = 4,
    ) -> None:
        """Create a front end that has seen nothing yet.

        At least one unit matters: a docking unit and its target, or all. ``search_detector`` finds tags in
        large parts of the frame; None takes
        :func:`~msrr_perception.detection.detector.default_search_detector`. Bodies that stand still are read
        in one of ``standing_every`` frames, at least 1.
        """
        self.model = model
        self._optic = optic_of(model.lens)
        self._localizer = model.localizer()
        errors = model.corner_errors
        self._detector = for_camera(detector, model.lens, errors.blur_px, errors.noise_grey)
        self._detectors = detectors_by_size(self._detector)
        smallest_px = min(tag.edge_px(model.camera, model.X_WC) for tag in model.tags.values())
        self._search_detector = search_detector or default_search_detector(
            model.tag_family.name, smallest_px, errors.blur_px, errors.noise_grey
        )
        self._policy = policy.for_family(model.tag_family)
        self._standing_every = standing_every
        self._units = tuple(units)
        self._essential = [model.tag_of[unit] for unit in self._units]
        self.reset()

    def reset(self) -> None:
        """Forget what earlier exposures showed."""
        self._last_search_ns: int | None = None
        self._last_missing_ns: int | None = None  # of a search while a unit that matters was missing
        self._offsets: dict[int, Array] = {}  # tag -> mean offset of its corners from the prediction [px]
        self._strays: dict[int, Array] = {}  # tag -> corners of a tag that was not expected there [px]
        self._settled: dict[int, int] = {}  # tag -> number of sightings in a row where it was expected
        self._places: dict[int, Array] = {}  # tag -> corners since when it has not moved [px]

    def restart_search(self) -> None:
        """Search again from the next exposure on, whenever the last search was."""
        self._last_search_ns = self._last_missing_ns = None

    def detect(
        self,
        exposure: Exposure,
        predictions: Mapping[str, GlobalPose],
        fetch: Fetch,
        driving: Collection[str] | None = None,
        remote: Collection[str] = (),
    ) -> Detections:
        """Read the tags of one exposure.

        Bodies without a predicted pose are unknown. The driving units are read in every exposure; None means
        the first unit that matters. No driving unit comes near to the ``remote`` bodies for twice
        ``standing_every`` exposures.

        Returns:
            Every tag read, by ascending id, and all windows in the order in which they were fetched.
        """
        reader = FrameReader(fetch, self._optic, self.model.to_light)
        driving = self._units[:1] if driving is None else driving
        wanted = [i for i in self.model.tags if self._is_due(i, exposure.frame, driving, remote)]
        due = self._expected(predictions, wanted)
        sigma = np.full((4, 2), _STRAY_PX / self._policy.sigmas)
        lens = self.model.lens
        strays = [ExpectedTag(i, np.array(lens.distorted(at)), sigma) for i, at in self._strays.items()]
        tags = [*due.values(), *strays]
        upright_px = min((e.upright_edge for e in tags), default=0.0)
        self._read(reader, detector_for(self._detectors, upright_px), tags)
        missed = [e for i, e in due.items() if i not in reader.found]
        self._read(reader, self._detector, missed, RETRY_WIDEN)
        if len(due) < len(wanted) or not self._knows_all():
            self._search(reader, exposure.stamp_ns, predictions)
        self._remember(reader, due, predictions)
        return reader.detections(exposure)

    def detect_near(
        self,
        exposure: Exposure,
        middle_W: Array,
        half_m: float,
        fetch: Fetch,
        predictions: Mapping[str, GlobalPose],
    ) -> Detections:
        """Read only the tags of bodies near one place, and of some others, without a search for units.

        It costs the pixels of that place and leaves the state of other reads as it was. That place is a
        square on the floor, with its middle at ``middle_W``, shape (2,), and half an edge ``half_m`` [m].
        ``predictions`` are the poses of the others at the time of the exposure, by name.

        Returns:
            The tags found, also of the units that matter where they show in the same windows.
        """
        reader = FrameReader(fetch, self._optic, self.model.to_light)
        others = [i for i, tag in self.model.tags.items() if tag.name in predictions]
        self._read(reader, self._detector, self._expected(predictions, others).values())
        square = self.model.square(middle_W, half_m, self._units[0])
        window = fitting_window(square, self.model.camera.frame)
        if window is not None:
            wanted = self.model.tags.keys() - set(self._essential)
            hints = reader.search(window, self._search_detector)
            near = [ExpectedTag(i, px, _EXACT) for i, px in hints.items() if i in wanted]
            self._read(reader, self._detector, near)
        return reader.detections(exposure, self.model.tags)

    def _is_due(self, tag_id: int, frame: int, driving: Collection[str], remote: Collection[str]) -> bool:
        name = self.model.tags[tag_id].name
        if name in driving or self._settled.get(tag_id, 0) < _SETTLE_AFTER:
            return True
        return (frame + tag_id) % ((2 if name in remote else 1) * self._standing_every) == 0

    def _expected(self, predictions: Mapping[str, GlobalPose], tags: Iterable[int]) -> dict[int, ExpectedTag]:
        """Return those of ``tags`` that should be wholly in the image at a place known well enough."""
        ideal = []
        for tag_id in tags:
            tag = self.model.tags[tag_id]
            prediction = predictions.get(tag.name)
            if prediction is None:
                continue
            pixels = self._localizer.pixels(tag, prediction.X_WB)
            pixels = pixels + self._offsets.get(tag_id, np.zeros(2))
            ideal.append(ExpectedTag(tag_id, pixels, self._sigma(tag, prediction)))
        found = {}
        for expected in tags_in_frame(ideal, self.model.lens):
            window = expected.window(self._policy)
            if max(window.width, window.height) <= _WIDEST_PX:
                found[expected.tag_id] = expected
        return found

    def _sigma(self, tag: FlatTag, prediction: GlobalPose) -> Array:
        """Return the standard deviation of each corner coordinate, shape (4, 2) [px]."""
        A = pose_jacobian(prediction.X_WB, tag.corners_B[:, :2])
        scale = self.model.camera.focal / (float(self.model.X_WC.p[2]) - tag.height)
        variance = np.einsum("ij,jk,ik->i", A, prediction.relative, A)
        sigma: Array = scale * np.sqrt(np.maximum(variance, 0.0)).reshape(4, 2)
        return sigma

    def _read(
        self, reader: FrameReader, detector: Detector, tags: Iterable[ExpectedTag], widen: float = 1.0
    ) -> None:
        reader.read(plan_windows(self.model.camera.frame, tags, self._policy, widen), detector)

    def _search(self, reader: FrameReader, stamp_ns: int, predictions: Mapping[str, GlobalPose]) -> None:
        """Search for unknown and missing tags, and read those that turn up."""
        expected = self._expected(predictions, self.model.tags)
        missing = any(
            i not in reader.found and (i not in expected or self._settled.get(i, 0) == 0)
            for i in self._essential
        )
        if missing and _is_past(stamp_ns, self._last_missing_ns, _MISSING_NS):
            self._last_missing_ns = stamp_ns
        elif not _is_past(stamp_ns, self._last_search_ns, _SEARCH_NS):
            return
        self._last_search_ns = stamp_ns
        unread = []
        for tag_id, pixels in reader.search(self.model.camera.frame, self._search_detector).items():
            if tag_id in reader.found or tag_id not in self.model.tags:
                continue
            e = expected.get(tag_id)
            if e is None or not e.window(self._policy).contains(Window.around(pixels, 0.0)):
                unread.append(ExpectedTag(tag_id, pixels, _EXACT))
        self._read(reader, self._detector, unread)

    def _knows_all(self) -> bool:
        """Return whether every tag of the catalogue was found where it was expected when last read."""
        return self._offsets.keys() >= self.model.tags.keys()

    def _remember(
        self, reader: FrameReader, due: Mapping[int, ExpectedTag], predictions: Mapping[str, GlobalPose]
    ) -> None:
        self._strays = {}
        for tag_id in due.keys() - reader.found.keys():
            self._settled[tag_id] = 0
            self._offsets.pop(tag_id, None)
        for tag_id in reader.found.keys() & self.model.tags.keys():
            corners = reader.found[tag_id].corners
            tag = self.model.tags[tag_id]
            moved = float(np.abs(corners - self._places.get(tag_id, corners)).max()) > _STILL_PX
            self._places[tag_id] = corners if moved else self._places.get(tag_id, corners)
            sightings = 0 if moved else self._settled.get(tag_id, 0)
            self._settled[tag_id] = sightings + 1 if tag_id in due else max(sightings, 1)
            prediction = predictions.get(tag.name)
            offset = None
            if prediction is not None:
                offset = (corners - self._localizer.pixels(tag, prediction.X_WB)).mean(axis=0)
            if offset is not None and float(np.linalg.norm(offset)) <= _LARGEST_OFFSET_PX:
                self._offsets[tag_id] = offset
            else:
                self._offsets.pop(tag_id, None)
                self._strays[tag_id] = corners


def _is_past(stamp_ns: int, last_ns: int | None, period_ns: int) -> bool:
    return last_ns is None or stamp_ns >= last_ns + period_ns
