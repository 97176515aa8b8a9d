"""All tags of a photograph, of one family or several, blurred ones included."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import cv2
import numpy as np

from msrr_perception.detection import native_apriltag
from msrr_perception.detection.native_apriltag import NativeSettings
from msrr_perception.kernels.edges import RefinedCorners, refine_corners
from msrr_perception.kernels.lens import NO_LENS, optic_of
from msrr_scenes.arrays import Array
from msrr_scenes.errors import UnknownNameError
from msrr_scenes.geometry.lens import Lens
from msrr_scenes.messages import Pixels, TagDetection
from msrr_scenes.specs.tag_families import FAMILIES

#: Settings of the search: as on board of a unit, but photographs may be dark.
_SETTINGS = NativeSettings(quad_decimate=1.0, quad_sigma=0.0, decode_sharpening=1.0, min_white_black_diff=15)

#: Resolutions at which large pictures are searched as well, as divisors of their own, and the fewest pixels
#: that are left then: edges that are blurred over ten pixels and more are none for the search.
_COARSER, _FEWEST_PX = (2.0, 4.0, 8.0), 200_000

#: Decision margin below which a detection is dropped [grey levels].
_LEAST_MARGIN = 10.0

#: The second search looks at the picture plus this many times what a Gaussian of this deviation takes out of
#: it: blur by motion joins modules of a tag, and its quad is no longer found. The deviation is about a module
#: of the smallest tags that can be read [px].
_SHARPENING, _SHARPENING_PX = 2.0, 4.0


#: Searches, in their order.
Search = Literal["plain", "sharpened", "coarse"]


@dataclass(frozen=True, slots=True, eq=False)
class FoundTag:
    """A tag of a photograph.

    Attributes:
        family: Its family.
        tag: Its id, corners (4, 2) in pixels of the picture, decision margin and corrected bits.
        refined: Whether the corners are intersections of measured edges; if not, they are the library's.
        search: Which search found it first: in the picture as it is, sharpened, or at a coarser resolution.
    """

    family: str
    tag: TagDetection
    refined: bool
    search: Search


class TagFinder:
    """Finder of all tags in photographs.

    It searches each picture as it is and sharpened, large ones also at coarser resolutions, and
    measures all corners in the picture as it is.
    """

    def __init__(self, families: Sequence[str] = ("tag36h11",), lens: Lens | None = None) -> None:
        """Create a finder.

        Without families there is nothing to find; without a lens edges are taken to be straight.

        Raises:
            UnknownNameError: There is no such family.
        """
        for family in families:
            if family not in FAMILIES:
                raise UnknownNameError("tag family", family, FAMILIES)
        self.families = tuple(dict.fromkeys(families))
        self._optic = NO_LENS if lens is None else optic_of(lens)

    def find(self, pixels: Pixels) -> tuple[FoundTag, ...]:
        """Return the tags in ``pixels``, mono8 of shape (height, width), by family and id."""
        searches: list[tuple[Search, Pixels, NativeSettings]] = [
            ("plain", pixels, _SETTINGS),
            ("sharpened", _sharpened(pixels), _SETTINGS),
        ]
        coarser = [d for d in _COARSER if pixels.size >= _FEWEST_PX * d * d]
        searches += [("coarse", pixels, replace(_SETTINGS, quad_decimate=d)) for d in coarser]
        found: list[FoundTag] = []
        for family in self.families:
            tags: list[tuple[TagDetection, Search]] = []
            for search, shown, settings in searches:
                new = _search(shown, family, settings)
                tags += [(tag, search) for tag in new if not any(_overlap(tag, t) for t, _ in tags)]
            if not tags:
                continue
            corners, refined, sigma = self._refined(pixels, family, np.stack([t.corners for t, _ in tags]))
            rows = [
                FoundTag(family, replace(t, corners=c, corner_sigma_px=s if ok else None), bool(ok), search)
                for (t, search), c, ok, s in zip(tags, corners, refined, sigma, strict=True)
            ]
            found.extend(sorted(rows, key=lambda row: (row.tag.tag_id, -row.tag.decision_margin)))
        return tuple(found)

    def _refined(self, pixels: Pixels, family: str, corners: Array) -> RefinedCorners:
        shown = np.invert(pixels) if FAMILIES[family].white_inside else pixels
        return refine_corners(shown, corners, self._optic)


def _search(pixels: Pixels, family: str, settings: NativeSettings) -> list[TagDetection]:
    tags = native_apriltag.detect(pixels, family, settings, FAMILIES[family].corrected_bits)
    return [t for t in tags if t.decision_margin >= _LEAST_MARGIN]


def _sharpened(pixels: Pixels) -> Pixels:
    blurred = cv2.GaussianBlur(pixels, (0, 0), _SHARPENING_PX)
    return np.asarray(cv2.addWeighted(pixels, 1.0 + _SHARPENING, blurred, -_SHARPENING, 0.0), dtype=np.uint8)


def _overlap(tag: TagDetection, other: TagDetection) -> bool:
    """Return whether the middle of a tag lies in another one."""
    x, y = tag.corners.mean(axis=0)
    outline = other.corners.astype(np.float32)
    return cv2.pointPolygonTest(outline, (float(x), float(y)), False) >= 0.0
