"""What AprilTag detectors have in common, by whichever library they find tags."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from copy import copy
from dataclasses import replace
from typing import ClassVar, Self

import numpy as np

from msrr_perception.detection.native_apriltag import DetectorError
from msrr_perception.detection.restoration import restored, restoring_filter
from msrr_perception.kernels.edges import refine_corners
from msrr_perception.kernels.lens import NO_LENS, optic_of
from msrr_scenes.arrays import Array
from msrr_scenes.errors import ParameterError, UnknownNameError
from msrr_scenes.geometry.lens import Lens
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.messages import Pixels, TagDetection
from msrr_scenes.registry import require_in_range
from msrr_scenes.specs.tag_families import FAMILIES

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


def check_ranges(parameters: Mapping[str, object], *optional: str) -> None:
    """Check the parameters of a detector by their names; others are passed over.

    Args:
        parameters: Values by name.
        optional: Names of parameters that may be None.

    Raises:
        ParameterError: A parameter is out of its range.
    """
    ranges = {name: _RANGES[name] for name in parameters if name in _RANGES}
    require_in_range(ranges, parameters, optional)


class RefiningDetector(ABC):
    """A detector of one tag family that refines the corners which a library finds, unless it is told not to.

    Attributes:
        family: Tag family.
        max_hamming: Number of corrected bits above which a detection is dropped.
        min_decision_margin: Decision margin below which a detection is dropped [grey levels].
        refine: Whether corners are refined by :func:`msrr_perception.kernels.edges.refine_corners`. If so, a
            tag whose edges cannot be measured is dropped: at the edge of a window its corners are up to 1 px
            off, for the border that the library follows is cut.
        raw_sigma_px: Standard deviation of a coordinate of a corner that is not refined [px], as ``msrr bench
            detection`` finds it.
    """

    raw_sigma_px: ClassVar[float]

    def __init__(
        self, family: str, max_hamming: int | None, min_decision_margin: float, refine: bool
    ) -> None:
        """Create a detector; without ``max_hamming`` as many bits are corrected as the family allows.

        Raises:
            ParameterError: There is no such family.
        """
        if family not in FAMILIES:
            unknown = UnknownNameError("tag family", f"{family!s:.40}", FAMILIES)
            raise ParameterError({"family": str(unknown)})
        self.family = family
        self.max_hamming = FAMILIES[family].corrected_bits if max_hamming is None else max_hamming
        self.min_decision_margin = min_decision_margin
        self.refine = refine
        self._optic, self._blur_px = NO_LENS, 0.0
        self._restores = True
        self._restoring: Array | None = None

    @abstractmethod
    def find(self, pixels: Pixels) -> list[TagDetection]:
        """Return the tags in mono8 ``pixels`` as the library finds them, corners in pixels of this image."""

    def for_lens(self, lens: Lens) -> Self:
        """Return a detector that refines corners along edges which are straight without the lens."""
        behind = copy(self)
        behind._optic = optic_of(lens)
        return behind

    def for_blur(self, blur_px: float) -> Self:
        """Return a detector that knows how a lens blurs the edges along which it refines corners."""
        blurred = copy(self)
        blurred._blur_px = blur_px
        return blurred

    def for_noise(self, noise_grey: float) -> Self:
        """Return a detector that looks for tags in images restored from blur, as far as noise allows it."""
        by = restoring_filter(self._blur_px, noise_grey) if self._restores else None
        if by is None:
            return self
        restoring = copy(self)
        restoring._restoring = by
        return restoring

    def detect(self, pixels: Pixels, window: Window) -> tuple[TagDetection, ...]:
        """Return the tags of one window; see :meth:`msrr_perception.detection.detector.Detector.detect`.

        Raises:
            DetectorError: The pixels do not fill the window.
        """
        if pixels.shape != (window.height, window.width):
            raise DetectorError(f"{pixels.shape} pixels do not fill a window of {window}")
        if min(pixels.shape) < _SMALLEST_EDGE_PX:
            return ()
        found = [
            t
            for t in self.find(pixels if self._restoring is None else restored(pixels, self._restoring))
            if t.hamming <= self.max_hamming and t.decision_margin >= self.min_decision_margin
        ]
        if not found:
            return ()
        found.sort(key=lambda t: (t.tag_id, -t.decision_margin))
        offset = np.array([window.x, window.y])
        if not self.refine:
            sigma = np.full(4, self.raw_sigma_px)
            return tuple(replace(t, corners=t.corners + offset, corner_sigma_px=sigma) for t in found)
        own = self._optic
        if own.distorts:
            own = own._replace(cx=own.cx - window.x, cy=own.cy - window.y)
        shown = np.invert(pixels) if FAMILIES[self.family].white_inside else pixels
        refined = refine_corners(shown, np.array([t.corners for t in found]), own, self._blur_px)
        moved = zip(found, refined.corners + offset, refined.measured, refined.sigma_px, strict=True)
        return tuple(
            TagDetection(tag.tag_id, corners, tag.decision_margin, tag.hamming, sigma_px)
            for tag, corners, measured, sigma_px in moved
            if measured
        )
