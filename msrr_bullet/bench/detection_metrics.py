"""Metrics of tag detection: what different settings find in the same exposures, compared with truth."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Generic, Protocol, TypeVar

import numpy as np
from pydantic import BaseModel

from msrr_bullet.statistics import Quantiles, Rate, quantiles, wilson
from msrr_perception.detection.detector import Detector, adapted
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.messages import Detections, Exposure, Fetch, Pixels, TagDetection

#: Largest distance between a detected corner and the exact one; beyond it the detection counts as false [px].
LARGEST_ERROR_PX = 3.0

#: Shortest edge of a tag that counts as large: 2 px for each of its 8 modules [px].
LARGE_EDGE_PX = 16.0

#: Edge of a tag with its white border over the edge of its black square: 10 modules over 8.
_WITH_BORDER = 1.25

P = TypeVar("P")
P_contra = TypeVar("P_contra", contravariant=True)


class Reader(Protocol[P_contra]):
    """Vision that chooses windows of an exposure and detects the tags in them, as the robot's does."""

    def reset(self) -> None:
        """Forget what earlier exposures showed."""
        ...

    def detect(self, exposure: Exposure, prediction: P_contra, fetch: Fetch, /) -> Detections:
        """Return the tags found in one exposure."""
        ...


class RecordingDetector:
    """A detector that records the windows that it is given."""

    def __init__(self, detector: Detector, windows: list[Window] | None = None) -> None:
        """Record the windows of ``detector`` in ``windows``, or in a new list."""
        self.windows: list[Window] = [] if windows is None else windows
        self._detector = detector

    def for_blur(self, blur_px: float) -> RecordingDetector:
        """Return the detector for blurred images, which records in the same list."""
        return RecordingDetector(adapted(self._detector, "for_blur", blur_px), self.windows)

    def for_large_tags(self) -> RecordingDetector:
        """Return the detector for large tags, which records in the same list."""
        return RecordingDetector(adapted(self._detector, "for_large_tags"), self.windows)

    def for_noise(self, noise_grey: float) -> RecordingDetector:
        """Return the detector for noisy images, which records in the same list."""
        return RecordingDetector(adapted(self._detector, "for_noise", noise_grey), self.windows)

    def detect(self, pixels: Pixels, window: Window) -> tuple[TagDetection, ...]:
        """Return the tags of one window; see :meth:`Detector.detect`."""
        self.windows.append(window)
        return self._detector.detect(pixels, window)


@dataclass(frozen=True, eq=False)
class Candidate(Generic[P_contra]):
    """A reader with certain settings, and the detector whose windows count (the search may have another)."""

    reader: Reader[P_contra]
    detector: RecordingDetector


class FullFrameReader:
    """Reads the full frame of every exposure, whatever the prediction."""

    def __init__(self, detector: Detector, frame: Window) -> None:
        """Read ``frame`` with ``detector``."""
        self._detector = detector
        self._frame = frame

    def reset(self) -> None:
        """Do nothing, because nothing is remembered."""

    def detect(self, exposure: Exposure, prediction: object, fetch: Fetch, /) -> Detections:
        """Return the tags found in the full frame."""
        return Detections(exposure, self._detector.detect(fetch(self._frame), self._frame), (self._frame,))


@dataclass(frozen=True, eq=False)
class LabelledExposure(Generic[P]):
    """One exposure whose truth is known.

    Attributes:
        exposure: Camera, number and time.
        fetch: Function that returns the pixels of a window.
        prediction: Prediction of the robot's estimator for this instant, with errors.
        corners: Tag -> exact corners, shape (4, 2) [px], of every tag that may be seen.
        in_view: Tags that lie wholly in the frame and are large enough to be read.
        pose_errors: Function that returns the errors (distance [m], angle [rad]) of the poses computed from
            detections.
        first: Whether readers are reset before this exposure.
    """

    exposure: Exposure
    fetch: Fetch
    prediction: P
    corners: Mapping[int, Array]
    in_view: frozenset[int]
    pose_errors: Callable[[Detections], list[tuple[float, float]]]
    first: bool


class DetectionRow(BaseModel, frozen=True):
    """Results of one candidate over all exposures.

    Attributes:
        settings: Label of the settings.
        exposures: Number of exposures.
        recall: Share of the tags looked for that were found, with its Wilson interval. A tag in view counts
            as looked for when a window that was read holds it with its white border.
        tags: Tags found per exposure.
        rms_px: Root mean square error of a corner coordinate [px]; None when nothing was found.
        rms_large_px: Root mean square error for tags of :data:`LARGE_EDGE_PX` and more.
        bias_px: Mean corner error in x and in y [px].
        bias_large_px: Mean corner error for tags of :data:`LARGE_EDGE_PX` and more.
        false: Detections of tags that do not exist or lie elsewhere.
        distance_mm: Position errors of the poses [mm].
        yaw_deg: Heading errors of the poses [deg].
        poseless: Exposures without a pose.
        pixels: Pixels read per exposure.
        ms: Processor time per exposure without that for the pixels [ms].
    """

    settings: str
    exposures: int
    recall: Rate
    tags: float
    rms_px: float | None
    rms_large_px: float | None
    bias_px: tuple[float, float] | None
    bias_large_px: tuple[float, float] | None
    false: int
    distance_mm: Quantiles
    yaw_deg: Quantiles
    poseless: int
    pixels: float
    ms: float


@dataclass
class _Totals:
    """Sums over the exposures of one candidate."""

    exposures: int = 0
    looked_for: int = 0
    found: int = 0
    false: int = 0
    poseless: int = 0
    pixels: int = 0
    spent_ns: int = 0
    corners: list[Array] = field(default_factory=list)
    large: list[Array] = field(default_factory=list)
    poses: list[tuple[float, float]] = field(default_factory=list)

    def add(self, view: LabelledExposure[P], found: Detections, windows: Sequence[Window]) -> None:
        """Compare what was found in ``windows`` with truth."""
        self.exposures += 1
        self.pixels += sum(w.area for w in found.windows)
        correct = set()
        for tag in found.tags:
            exact = view.corners.get(tag.tag_id)
            if exact is None or np.linalg.norm(tag.corners - exact, axis=1).max() > LARGEST_ERROR_PX:
                self.false += 1
                continue
            correct.add(tag.tag_id)
            self.corners.append(tag.corners - exact)
            if shortest_edge(exact) >= LARGE_EDGE_PX:
                self.large.append(tag.corners - exact)
        looked_for = {t for t in view.in_view if _read_with_border(windows, view.corners[t])}
        self.looked_for += len(looked_for)
        self.found += len(looked_for & correct)
        errors = view.pose_errors(found)
        self.poses += errors
        self.poseless += not errors

    def row(self, settings: str) -> DetectionRow:
        """Return the sums as rates."""
        n = max(self.exposures, 1)
        return DetectionRow(
            settings=settings,
            exposures=self.exposures,
            recall=wilson(self.found, self.looked_for),
            tags=len(self.corners) / n,
            rms_px=_rms(self.corners),
            rms_large_px=_rms(self.large),
            bias_px=_mean(self.corners),
            bias_large_px=_mean(self.large),
            false=self.false,
            distance_mm=quantiles(1e3 * d for d, _ in self.poses),
            yaw_deg=quantiles(math.degrees(a) for _, a in self.poses),
            poseless=self.poseless,
            pixels=self.pixels / n,
            ms=1e-6 * self.spent_ns / n,
        )


def evaluate(
    candidates: Mapping[str, Candidate[P]], views: Iterable[LabelledExposure[P]], rng: np.random.Generator
) -> tuple[DetectionRow, ...]:
    """Let all candidates, by their labels, read the same exposures and return a row for each.

    All candidates get the same pixels: a window equals the crop of the full frame. Time is processor time of
    the thread without that for the pixels; each candidate reads the first exposure once before it is timed,
    to load what is loaded once. They are shuffled for each exposure, so that none finds the caches warmer.
    """
    totals = {label: _Totals() for label in candidates}
    labels = list(candidates)
    for number, view in enumerate(views):
        if number == 0:
            for candidate in candidates.values():
                candidate.reader.detect(view.exposure, view.prediction, view.fetch)
        for i in rng.permutation(len(labels)):
            candidate, total = candidates[labels[i]], totals[labels[i]]
            if view.first:
                candidate.reader.reset()
            candidate.detector.windows.clear()
            found, spent_ns = _read_timed(candidate.reader, view)
            total.spent_ns += spent_ns
            total.add(view, found, candidate.detector.windows)
    return tuple(total.row(label) for label, total in totals.items())


def _read_timed(reader: Reader[P], view: LabelledExposure[P]) -> tuple[Detections, int]:
    """Return the tags found in an exposure and the processor time without that for the pixels [ns]."""
    for_pixels = 0

    def fetch(window: Window) -> Pixels:
        nonlocal for_pixels
        start = time.thread_time_ns()
        pixels = np.ascontiguousarray(view.fetch(window))
        for_pixels += time.thread_time_ns() - start
        return pixels

    start = time.thread_time_ns()
    found = reader.detect(view.exposure, view.prediction, fetch)
    return found, time.thread_time_ns() - start - for_pixels


def shortest_edge(corners: Array) -> float:
    """Return the shortest edge of a tag [px] from its corners, shape (4, 2) [px]."""
    return float(np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1).min())


def _rms(errors: Sequence[Array]) -> float | None:
    return float(np.sqrt(np.mean(np.square(errors)))) if errors else None


def _mean(errors: Sequence[Array]) -> tuple[float, float] | None:
    if not errors:
        return None
    x, y = np.mean(errors, axis=(0, 1)).tolist()
    return x, y


def encloses(window: Window, points: Array) -> bool:
    """Say whether all points, shape (N, 2) [px], lie in a window."""
    low, high = [window.x - 0.5, window.y - 0.5], [window.x_end - 0.5, window.y_end - 0.5]
    return bool((points >= low).all() and (points <= high).all())


def _read_with_border(windows: Iterable[Window], corners: Array) -> bool:
    """Say whether one of the windows encloses a tag and the white module around it."""
    middle = corners.mean(axis=0)
    border = middle + (corners - middle) * _WITH_BORDER
    return any(encloses(window, border) for window in windows)
