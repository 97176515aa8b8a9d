"""The detector protocol, and the AprilTag detector that ships."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from typing import Protocol

import numpy as np

from msrr_perception.detection import native_apriltag
from msrr_perception.detection.checked_tags import checked_tags
from msrr_perception.detection.native_apriltag import DetectorError, NativeSettings
from msrr_perception.kernels.edges import refine_corners
from msrr_perception.kernels.lens import NO_LENS, optic_of
from msrr_scenes.geometry.lens import Lens
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.guarded import of_the_same_kind
from msrr_scenes.messages import Pixels, TagDetection
from msrr_scenes.registry import ExtensionPoint, build, is_import_path, out_of_range
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.tag_families import FAMILIES

__all__ = [
    "DETECTORS",
    "LARGE_TAG_PX",
    "Detector",
    "DetectorError",
    "PupilDetector",
    "default_search_detector",
    "for_large_tags",
    "for_lens",
    "scene_detector",
]

#: Shortest edge in the image from which a tag is found at half the resolution as well [px]. Of 3500 tags of
#: 18 px and more with the noise of the design, none was missed there; of 300 smaller ones, 52.
LARGE_TAG_PX = 26.0

#: Contrast of a 4 px tile below which the search skips it [grey levels]. Tags have about 200; a limit near
#: the noise lets every tile through, and the search takes 50 times longer.
_SEARCH_CONTRAST = 90

#: Smaller images hold no tag and make the library's tiles degenerate [px].
_SMALLEST_EDGE_PX = 8


#: Ranges of the parameters: at a sixteenth of the resolution, or blurred by 20 px, a tag of the port is
#: gone, ten times the library's sharpening saturates, codes are eleven bits apart, and greys are bytes.
_RANGES = {
    "quad_decimate": (1.0, 16.0),
    "quad_sigma": (0.0, 20.0),
    "decode_sharpening": (0.0, 10.0),
    "min_white_black_diff": (1, 255),
    "max_hamming": (0, 5),
    "min_decision_margin": (0.0, 255.0),
}


class Detector(Protocol):
    """An object that finds tags in one window of one frame."""

    def detect(self, pixels: Pixels, window: Window) -> tuple[TagDetection, ...]:
        """Return the tags in ``pixels``, mono8 of shape (window.height, window.width).

        Corners are pixels of the FULL frame, counted from pixel centres, in the order of
        :func:`msrr_scenes.geometry.unit_geometry.tag_corners`; tags are sorted by id.
        """
        ...


def for_large_tags(detector: Detector) -> Detector:
    """Return the detector to use where all tags appear larger than :data:`LARGE_TAG_PX`.

    A detector offers a cheaper one for that case by a method ``for_large_tags()``, which returns it.
    """
    make = getattr(detector, "for_large_tags", None)
    return detector if make is None else make()


def for_lens(detector: Detector, lens: Lens) -> Detector:
    """Return the detector to use behind a lens; its corners are pixels of the frame, too.

    A detector that measures straight edges, which a lens may bend, offers one by a method ``for_lens(lens)``.
    """
    make = getattr(detector, "for_lens", None) if lens.distorts else None
    return detector if make is None else make(lens)


class PupilDetector:
    """An AprilTag 3 detector by way of pupil-apriltags.

    All instances of a process share one native detector (see
    :mod:`msrr_perception.detection.native_apriltag`).

    Attributes:
        family: Tag family.
        max_hamming: Number of corrected bits above which a detection is dropped.
        min_decision_margin: Decision margin below which a detection is dropped [grey levels].
        refine: Whether corners are refined by :func:`msrr_perception.kernels.edges.refine_corners`. If so, a
            tag whose edges cannot be measured is dropped: at the edge of a window its corners are up to 1 px
            off, for the border that the library follows is cut.
        settings: Settings of the native detector.
    """

    def __init__(
        self,
        family: str = "tag36h11",
        quad_decimate: float = 1.0,
        quad_sigma: float = 0.0,
        decode_sharpening: float = 1.0,
        min_white_black_diff: int = 30,
        max_hamming: int | None = None,
        min_decision_margin: float = 10.0,
        refine: bool = True,
    ) -> None:
        """Create a detector; see :class:`NativeSettings` for the native parameters.

        Without ``max_hamming`` as many bits are corrected as the family allows.

        Raises:
            DetectorError: A parameter is out of its range.
        """
        if max_hamming is None:
            max_hamming = FAMILIES[family].corrected_bits if family in FAMILIES else 0
        wrong = out_of_range(_RANGES, locals())
        if wrong is None and family not in FAMILIES:
            wrong = f"family has to be one of {', '.join(FAMILIES)}, found {family!r:.40}"
        if wrong is not None:
            raise DetectorError(wrong)
        self.family = family
        self.max_hamming = max_hamming
        self.min_decision_margin = min_decision_margin
        self.refine = refine
        self._optic = NO_LENS
        self.settings = NativeSettings(
            quad_decimate, quad_sigma, decode_sharpening, int(min_white_black_diff)
        )

    def for_large_tags(self) -> PupilDetector:
        """Return a detector that searches at half the resolution.

        Its corners are as good because they are refined in the full image; without refinement the detector
        itself is returned.
        """
        if not self.refine or self.settings.quad_decimate >= 2.0:
            return self
        quick = copy(self)
        quick.settings = replace(self.settings, quad_decimate=2.0)
        return quick

    def for_lens(self, lens: Lens) -> PupilDetector:
        """Return a detector that refines corners along edges which are straight without the lens."""
        behind = copy(self)
        behind._optic = optic_of(lens)
        return behind

    def detect(self, pixels: Pixels, window: Window) -> tuple[TagDetection, ...]:
        """Return the tags of one window; see :meth:`Detector.detect`."""
        if pixels.shape != (window.height, window.width):
            raise DetectorError(f"{pixels.shape} pixels do not fill a window of {window}")
        if min(pixels.shape) < _SMALLEST_EDGE_PX:
            return ()
        found = [
            t
            for t in native_apriltag.detect(pixels, self.family, self.settings)
            if t.hamming <= self.max_hamming and t.decision_margin >= self.min_decision_margin
        ]
        if not found:
            return ()
        found.sort(key=lambda t: (t.tag_id, -t.decision_margin))
        corners = np.stack([t.corners for t in found])
        measured = np.ones(len(found), dtype=np.bool_)
        if self.refine:
            own = self._optic._replace(cx=self._optic.cx - window.x, cy=self._optic.cy - window.y)
            shown = np.invert(pixels) if FAMILIES[self.family].white_inside else pixels
            corners, measured = refine_corners(shown, corners, own)
        corners += [window.x, window.y]
        return tuple(replace(t, corners=c) for t, c, ok in zip(found, corners, measured, strict=True) if ok)


def default_search_detector(family: str = "tag36h11") -> Detector:
    """Return a detector that quickly finds black and white tags of 30 px and more in a full frame."""
    return PupilDetector(family, quad_decimate=2.0, min_white_black_diff=_SEARCH_CONTRAST)


DETECTORS: ExtensionPoint[Detector] = ExtensionPoint(
    {"pupil": PupilDetector},
    methods={"detect": checked_tags},
    optional={"for_large_tags": of_the_same_kind, "for_lens": of_the_same_kind},
)


def scene_detector(scene: Scene) -> Detector:
    """Return the detector that a scene names; a registered one reads the family of the scene's tags.

    Raises:
        UnknownNameError: There is no such detector.
        SceneError: It does not take the parameters of the scene.
    """
    choice = scene.control.detector
    if not is_import_path(choice):
        choice = choice.model_copy(update={"params": {"family": scene.tags.family, **choice.params}})
    return build("detector", choice, DETECTORS)
