"""Detectors on photographs: what each finds, where it puts the corners, and how long it takes."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from pydantic import BaseModel

from msrr_bullet.bench.detector_settings import LIBRARY, library_detector
from msrr_bullet.bench.pattern_alignment import align_pattern
from msrr_perception.detection.aruco_detector import ArucoDetector
from msrr_perception.detection.detector import Detector, PupilDetector
from msrr_perception.detection.native_apriltag import tag_bitmap
from msrr_perception.detection.pyapriltags_detector import PyAprilTagsDetector
from msrr_perception.photographs.picture_files import PictureError, read_picture
from msrr_perception.photographs.tag_finder import TagFinder
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.messages import Pixels, TagDetection
from msrr_scenes.specs.tag_families import TAG36H11

#: File beside the photographs with their tags: on each line the name of a file and the ids in it.
TRUTH = "tags.txt"

#: Labels of the two rows that say what refinement is worth.
UNREFINED, REFINED = "unrefined", "refined"

_Find = Callable[[Pixels], Sequence[TagDetection]]


class PhotographRow(BaseModel, frozen=True):
    """Results of one detector on all photographs.

    Attributes:
        detector: Its label.
        found: Tags found that are in the pictures.
        tags: Tags in the pictures.
        false: Detections of tags that are not in the picture, or a second time.
        aligned: Tags found whose corners could be compared with the alignment of the whole pattern.
        rms_px: Root mean square difference of a corner's coordinate from it [px]; None without such a tag.
        median_px: Median distance of a corner from it [px].
        ms: Processor time of a picture [ms].
    """

    detector: str
    found: int
    tags: int
    false: int
    aligned: int
    rms_px: float | None
    median_px: float | None
    ms: float


def _finders() -> Mapping[str, _Find]:
    def whole(detector: Detector) -> _Find:
        return lambda pixels: detector.detect(pixels, Window(0, 0, pixels.shape[1], pixels.shape[0]))

    finder = TagFinder()
    finders: dict[str, _Find] = {
        LIBRARY: whole(library_detector()),
        UNREFINED: whole(PupilDetector(refine=False)),
        REFINED: whole(PupilDetector()),
        "msrr detect": lambda pixels: [found.tag for found in finder.find(pixels)],
        "OpenCV's ArUco": whole(ArucoDetector()),
        "... apriltag corners": whole(ArucoDetector(corner_refinement="apriltag")),
        "... refined": whole(ArucoDetector(refine=True)),
    }
    if find_spec("pyapriltags") is not None:
        finders["pyapriltags"] = whole(PyAprilTagsDetector())
        # Labels are unique; the blank is not shown.
        finders["... refined "] = whole(PyAprilTagsDetector(refine=True))
    return finders


@dataclass
class _Totals:
    """Sums over the photographs of one detector."""

    found: int = 0
    false: int = 0
    spent_ns: int = 0
    errors: list[Array] = field(default_factory=list)

    def row(self, label: str, tags: int, pictures: int) -> PhotographRow:
        errors = np.array(self.errors)
        known = len(errors) > 0
        return PhotographRow(
            detector=label.strip(),
            found=self.found,
            tags=tags,
            false=self.false,
            aligned=len(errors),
            rms_px=float(np.sqrt(np.mean(errors**2))) if known else None,
            median_px=float(np.median(np.linalg.norm(errors, axis=2))) if known else None,
            ms=1e-6 * self.spent_ns / pictures,
        )


def read_truth(folder: Path) -> dict[str, frozenset[int]]:
    """Return the ids of the tags in the photographs of a folder by the name of the file.

    Raises:
        PictureError: There is no such list, or a line of it is something else.
    """
    file = folder / TRUTH
    truth: dict[str, frozenset[int]] = {}
    try:
        for number, line in enumerate(file.read_text(encoding="utf-8-sig").splitlines(), 1):
            name, *ids = line.split() or [""]
            if "\0" in name:
                raise PictureError(f"{file}, line {number}: a byte 0 in the name of a photograph")
            if name:
                truth[name] = frozenset(_ids(ids, f"{file}, line {number}"))
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise PictureError(
            f"{file}: cannot be read ({reason}); a line is the name of a photograph and the ids of its tags"
        ) from error
    return truth


def _ids(texts: Sequence[str], place: str) -> list[int]:
    for text in texts:
        if not text.isdecimal() or len(text) > len(str(TAG36H11.ids)) or int(text) >= TAG36H11.ids:
            expected = f"a name without spaces, and ids from 0 to {TAG36H11.ids - 1}"
            raise PictureError(f"{place}: expected {expected}, found {text!r:.40}")
    return [int(text) for text in texts]


def benchmark_photographs(
    folder: Path, observer: Callable[[str], None] = lambda _: None
) -> tuple[PhotographRow, ...]:
    """Compare detectors on the photographs of tag36h11 tags in a folder.

    The folder has their :data:`TRUTH` as well. ``observer`` is called with the name of what is read next.

    Raises:
        PictureError: A file cannot be read, or no photograph is listed.
    """
    truth, finders = read_truth(folder), _finders()
    totals = {label: _Totals() for label in finders}
    if not truth:
        raise PictureError(f"{folder / TRUTH}: no photograph is listed")
    for number, (name, ids) in enumerate(truth.items()):
        observer(f"photograph {name}")
        pixels = read_picture(folder / name)
        if number == 0:  # loads and compiles what is loaded and compiled once
            for find in finders.values():
                find(pixels)
        _compare(pixels, ids, finders, totals)
    tags = sum(len(ids) for ids in truth.values())
    return tuple(total.row(label, tags, len(truth)) for label, total in totals.items())


def _compare(
    pixels: Pixels, ids: frozenset[int], finders: Mapping[str, _Find], totals: Mapping[str, _Totals]
) -> None:
    """Let all detectors read one photograph and add what they find to their totals."""
    aligned: dict[int, Array | None] = {}
    for label, find in finders.items():
        total = totals[label]
        start = time.thread_time_ns()
        tags = find(pixels)
        total.spent_ns += time.thread_time_ns() - start
        seen = set()
        for tag in tags:
            if tag.tag_id not in ids or tag.tag_id in seen:
                total.false += 1
                continue
            seen.add(tag.tag_id)
            if tag.tag_id not in aligned:
                bits = tag_bitmap(TAG36H11.name, tag.tag_id)
                aligned[tag.tag_id] = align_pattern(pixels, bits, TAG36H11.edge_modules, tag.corners)
            reference = aligned[tag.tag_id]
            if reference is not None:
                total.errors.append(tag.corners - reference)
        total.found += len(seen)
