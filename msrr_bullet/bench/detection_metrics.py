"""Counts what readers of camera frames find, against what is there, exposure by exposure."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Generic, Protocol, TypeVar

import numpy as np
from pydantic import BaseModel, ConfigDict

from msrr_bullet.statistics import Quantiles, Rate, quantiles, wilson
from msrr_perception.detection.detector import Detector, for_large_tags
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.messages import Detections, Exposure, Fetch, Pixels, TagDetection

#: A detection with a corner farther than this from the tag's own is none of that tag [px].
LARGEST_ERROR_PX = 3.0

#: A tag whose shortest edge is longer counts as large: 2 px for each of its 8 modules [px].
LARGE_EDGE_PX = 16.0

#: Edge of a tag with its white border over that of its black square: 10 modules over 8.
_WITH_BORDER = 1.25

P = TypeVar("P")
P_contra = TypeVar("P_contra", contravariant=True)


class Reader(Protocol[P_contra]):
    """Chooses windows of an exposure and reads the tags in them, as the robot's vision does."""

    def reset(self) -> None:
        """Forget what earlier exposures showed."""
        ...

    def look(self, exposure: Exposure, prediction: P_contra, fetch: Fetch, /) -> Detections:
        """Read one exposure."""
        ...


class WatchedDetector:
    """A detector, and the windows that it was given.

    Attributes:
        windows: Since they were cleared last.
    """

    def __init__(self, detector: Detector, windows: list[Window] | None = None) -> None:
        """Watch ``detector``; its windows are added to ``windows`` if they are given."""
        self.windows: list[Window] = [] if windows is None else windows
        self._detector = detector

    def for_large_tags(self) -> WatchedDetector:
        """Return what reads large tags in the detector's place, watched together with it."""
        return WatchedDetector(for_large_tags(self._detector), self.windows)

    def detect(self, pixels: Pixels, window: Window) -> tuple[TagDetection, ...]:
        """Return the tags of one window; see :meth:`Detector.detect`."""
        self.windows.append(window)
        return self._detector.detect(pixels, window)


@dataclass(frozen=True, eq=False)
class Contestant(Generic[P_contra]):
    """A reader, and the detector whose finds it delivers; what it only searches with is another one."""

    reader: Reader[P_contra]
    detector: WatchedDetector


class WholeFrame:
    """Reads every exposure's full frame, whatever is expected of it."""

    def __init__(self, detector: Detector, frame: Window) -> None:
        """Read ``frame`` with ``detector``."""
        self._detector = detector
        self._frame = frame

    def reset(self) -> None:
        """Forget nothing: there is no memory."""

    def look(self, exposure: Exposure, prediction: object, fetch: Fetch, /) -> Detections:
        """Read one exposure."""
        return Detections(exposure, self._detector.detect(fetch(self._frame), self._frame), (self._frame,))


@dataclass(frozen=True, eq=False)
class View(Generic[P]):
    """One exposure whose truth is known.

    Attributes:
        exposure: Camera, number and time.
        fetch: Gives the pixels of a window.
        prediction: What the robot's estimator would predict for this instant, with its errors.
        corners: Tag -> exact corners, shape (4, 2) [px], of every tag that may be seen.
        in_view: Those wholly in the frame and large enough to be read.
        pose_errors: Gives the errors (distance [m], angle [rad]) of the poses that detections lead to.
        first: Nothing was seen before; readers are reset.
    """

    exposure: Exposure
    fetch: Fetch
    prediction: P
    corners: Mapping[int, Array]
    in_view: frozenset[int]
    pose_errors: Callable[[Detections], list[tuple[float, float]]]
    first: bool


class DetectionRow(BaseModel):
    """What one reader made of all views.

    Attributes:
        settings: Which settings it had.
        exposures: Frames looked at.
        recall: Share of the tags looked for that were found, with its Wilson interval. A tag in view counts
            as looked for when a window that was read holds it with its white border.
        tags: Tags found per exposure.
        rms_px: Root mean square error of a corner coordinate [px]; None when nothing was found.
        rms_large_px: The same of tags of :data:`LARGE_EDGE_PX` and more.
        bias_px: Its mean, in x and in y [px].
        bias_large_px: The same of the large ones.
        false: Detections of tags that are not there or not where they were found.
        distance_mm: Error of the poses' positions [mm].
        yaw_deg: Error of their headings [deg].
        poseless: Exposures without a pose.
        pixels: Read per exposure.
        ms: Processor time per exposure, pixels not counted [ms].
    """

    model_config = ConfigDict(frozen=True)

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
class _Tally:
    """Sums over the exposures of one reader."""

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

    def add(self, view: View[P], found: Detections, read: Sequence[Window]) -> None:
        """Compare what was found in the windows ``read`` with truth."""
        self.exposures += 1
        self.pixels += sum(w.area for w in found.windows)
        right = set()
        for tag in found.tags:
            exact = view.corners.get(tag.tag_id)
            if exact is None or np.linalg.norm(tag.corners - exact, axis=1).max() > LARGEST_ERROR_PX:
                self.false += 1
                continue
            right.add(tag.tag_id)
            self.corners.append(tag.corners - exact)
            if shortest_edge(exact) >= LARGE_EDGE_PX:
                self.large.append(tag.corners - exact)
        looked_for = {t for t in view.in_view if _holds(read, view.corners[t])}
        self.looked_for += len(looked_for)
        self.found += len(looked_for & right)
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


def compare(
    contestants: Mapping[str, Contestant[P]], views: Iterable[View[P]], rng: np.random.Generator
) -> tuple[DetectionRow, ...]:
    """Let all contestants read the same exposures and return a row for each.

    Pixels are the same for all: a window equals the crop of the full frame, so that they are taken from the
    latter. Time is processor time of the thread, without that for pixels; each contestant sees the first
    exposure once before it counts, to load what is loaded once.

    Args:
        contestants: By label.
        views: Exposures with their truth.
        rng: Shuffles the contestants anew for each exposure, so that none finds the caches warmer.
    """
    tallies = {label: _Tally() for label in contestants}
    labels = list(contestants)
    for number, view in enumerate(views):
        if number == 0:
            for contestant in contestants.values():
                contestant.reader.look(view.exposure, view.prediction, view.fetch)
        for i in rng.permutation(len(labels)):
            contestant, tally = contestants[labels[i]], tallies[labels[i]]
            if view.first:
                contestant.reader.reset()
            contestant.detector.windows.clear()
            found, spent_ns = _timed_look(contestant.reader, view)
            tally.spent_ns += spent_ns
            tally.add(view, found, contestant.detector.windows)
    return tuple(tally.row(label) for label, tally in tallies.items())


def _timed_look(reader: Reader[P], view: View[P]) -> tuple[Detections, int]:
    for_pixels = 0

    def fetch(window: Window) -> Pixels:
        nonlocal for_pixels
        start = time.thread_time_ns()
        pixels = np.ascontiguousarray(view.fetch(window))
        for_pixels += time.thread_time_ns() - start
        return pixels

    start = time.thread_time_ns()
    found = reader.look(view.exposure, view.prediction, fetch)
    return found, time.thread_time_ns() - start - for_pixels


def shortest_edge(corners: Array) -> float:
    """Return the length of the shortest edge of a tag, corners (4, 2) [px]."""
    return float(np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1).min())


def _rms(errors: Sequence[Array]) -> float | None:
    return float(np.sqrt(np.mean(np.square(errors)))) if errors else None


def _mean(errors: Sequence[Array]) -> tuple[float, float] | None:
    if not errors:
        return None
    x, y = np.mean(errors, axis=(0, 1)).tolist()
    return x, y


def _holds(windows: Iterable[Window], corners: Array) -> bool:
    """Say whether one of the windows holds a tag and the white module around it."""
    middle = corners.mean(axis=0)
    low, high = (f(middle + (corners - middle) * _WITH_BORDER, axis=0) for f in (np.min, np.max))
    return any(
        w.x - 0.5 <= low[0] and w.y - 0.5 <= low[1] and high[0] <= w.x_end - 0.5 and high[1] <= w.y_end - 0.5
        for w in windows
    )
