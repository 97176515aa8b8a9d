"""The ArUco detector of OpenCV with its dictionaries of AprilTags."""

from __future__ import annotations

from types import MappingProxyType

import cv2
import numpy as np
from numpy.typing import NDArray

from msrr_perception.detection.native_apriltag import EDGE_TO_CENTRE_PX, tag_bitmap
from msrr_perception.detection.refining_detector import RefiningDetector, check_ranges
from msrr_scenes.arrays import Array
from msrr_scenes.errors import ParameterError
from msrr_scenes.messages import Pixels, TagDetection

#: Families that OpenCV has a dictionary of.
_DICTIONARIES = MappingProxyType(
    {
        "tag16h5": cv2.aruco.DICT_APRILTAG_16h5,
        "tag25h9": cv2.aruco.DICT_APRILTAG_25h9,
        "tag36h11": cv2.aruco.DICT_APRILTAG_36h11,
    }
)

#: What OpenCV makes of the corners of the contours that it finds.
_REFINEMENTS = MappingProxyType(
    {
        "none": cv2.aruco.CORNER_REFINE_NONE,
        "subpix": cv2.aruco.CORNER_REFINE_SUBPIX,
        "contour": cv2.aruco.CORNER_REFINE_CONTOUR,
        "apriltag": cv2.aruco.CORNER_REFINE_APRILTAG,
    }
)

#: OpenCV begins at the top left and goes clockwise, and its AprilTags are turned by half a turn.
_ORDER = [1, 0, 3, 2]


class ArucoDetector(RefiningDetector):
    """OpenCV's ArUco detector of AprilTags, whose corners are its own unless they are refined here."""

    raw_sigma_px = 0.34

    def __init__(
        self,
        family: str = "tag36h11",
        corner_refinement: str = "subpix",
        max_hamming: int | None = None,
        min_decision_margin: float = 10.0,
        refine: bool = False,
    ) -> None:
        """Create a detector.

        Args:
            family: Tag family.
            corner_refinement: OpenCV's refinement of the corners: none, subpix, contour or apriltag.
            max_hamming: Number of corrected bits above which a detection is dropped; None goes by the family.
            min_decision_margin: Decision margin below which a detection is dropped [grey levels].
            refine: Whether corners are refined by :func:`msrr_perception.kernels.edges.refine_corners`.

        Raises:
            ParameterError: A parameter is out of its range, or OpenCV does not know the family.
        """
        check_ranges(locals(), "max_hamming")
        super().__init__(family, max_hamming, min_decision_margin, refine)
        for name, value, known in (
            ("family", family, tuple(_DICTIONARIES)),
            ("corner_refinement", corner_refinement, tuple(_REFINEMENTS)),
        ):
            if value not in known:
                raise ParameterError({name: f"has to be one of {', '.join(known)}, found {value!r:.40}"})
        dictionary = cv2.aruco.getPredefinedDictionary(_DICTIONARIES[family])
        parameters = cv2.aruco.DetectorParameters()
        parameters.cornerRefinementMethod = _REFINEMENTS[corner_refinement]
        # A share of the bits that the dictionary could correct; half a bit keeps clear of rounding.
        share = (self.max_hamming + 0.5) / max(dictionary.maxCorrectionBits, 1)
        parameters.errorCorrectionRate = min(share, 1.0)
        # Here OpenCV runs code of the AprilTag library and counts from the edges of pixels as that does.
        self._offset_px = EDGE_TO_CENTRE_PX if corner_refinement == "apriltag" else 0.0
        self._native = cv2.aruco.ArucoDetector(dictionary, parameters)

    def find(self, pixels: Pixels) -> list[TagDetection]:
        """Return the tags as OpenCV finds them; see :meth:`RefiningDetector.find`."""
        corners, ids, _ = self._native.detectMarkers(np.ascontiguousarray(pixels))
        if ids is None:
            return []
        found = []
        for square, number in zip(corners, np.ravel(ids), strict=True):
            tag_id = int(number)
            ordered = np.asarray(square, dtype=np.float64).reshape(4, 2)[_ORDER] - self._offset_px
            bits = tag_bitmap(self.family, tag_id)
            found.append(TagDetection(tag_id, ordered, *_decoded(pixels, ordered, bits)))
        return found


def _decoded(pixels: Pixels, corners: Array, bits: NDArray[np.bool_]) -> tuple[float, int]:
    """Return decision margin and number of wrong bits of a tag, which OpenCV does not tell.

    Args:
        pixels: Mono8 image.
        corners: Corners of the black square, shape (4, 2) [px].
        bits: Modules of the tag with its white border, shape (N, N).
    """
    n = len(bits)
    square = np.array([[1, n - 1], [n - 1, n - 1], [n - 1, 1], [1, 1]], dtype=np.float32)
    H = cv2.getPerspectiveTransform(square, corners.astype(np.float32))
    middles = np.stack(np.meshgrid(np.arange(n) + 0.5, np.arange(n) + 0.5), axis=-1)
    u, v = np.moveaxis(cv2.perspectiveTransform(middles, H), -1, 0).astype(np.float32)
    grey = cv2.remap(pixels.astype(np.float32), u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    outer = np.ones((n, n), dtype=np.bool_)
    outer[1:-1, 1:-1] = False
    inner = np.ones((n, n), dtype=np.bool_)
    inner[2:-2, 2:-2] = False
    threshold = 0.5 * float(grey[outer].mean() + grey[inner & ~outer].mean())
    difference = np.where(bits, grey - threshold, threshold - grey)[2:-2, 2:-2]
    return float(difference.mean()), int((difference < 0.0).sum())
