"""The newer AprilTag 3 library of the optional package pyapriltags."""

from __future__ import annotations

from typing import Any

import numpy as np

from msrr_perception.detection.native_apriltag import EDGE_TO_CENTRE_PX
from msrr_perception.detection.per_thread import kept_per_thread
from msrr_perception.detection.refining_detector import RefiningDetector, check_ranges
from msrr_scenes.errors import MissingPackageError
from msrr_scenes.messages import Pixels, TagDetection


class PyAprilTagsDetector(RefiningDetector):
    """An AprilTag 3 detector by way of pyapriltags, whose corners are its own unless they are refined.

    All instances in a thread share one native detector of a family.
    """

    raw_sigma_px = 0.1

    def __init__(
        self,
        family: str = "tag36h11",
        quad_decimate: float = 1.0,
        quad_sigma: float = 0.0,
        decode_sharpening: float = 1.0,
        max_hamming: int | None = None,
        min_decision_margin: float = 10.0,
        refine: bool = False,
    ) -> None:
        """Create a detector; parameters are those of :class:`NativeSettings`.

        Raises:
            ParameterError: A parameter is out of its range.
            MissingPackageError: pyapriltags is not installed.
        """
        check_ranges(locals(), "max_hamming")
        super().__init__(family, max_hamming, min_decision_margin, refine)
        self._settings = {
            "quad_decimate": quad_decimate,
            "quad_sigma": quad_sigma,
            "decode_sharpening": decode_sharpening,
        }
        _native(family)

    def find(self, pixels: Pixels) -> list[TagDetection]:
        """Return the tags as the library finds them; see :meth:`RefiningDetector.find`."""
        native = _native(self.family)
        for name, value in self._settings.items():
            setattr(native.tag_detector_ptr.contents, name, value)
        return [
            TagDetection(t.tag_id, np.array(t.corners) - EDGE_TO_CENTRE_PX, t.decision_margin, t.hamming)
            for t in native.detect(np.ascontiguousarray(pixels))
        ]


@kept_per_thread
def _native(family: str) -> Any:
    try:
        import pyapriltags
    except ModuleNotFoundError:
        raise MissingPackageError(
            "detector 'pyapriltags' needs the package pyapriltags: pip install 'msrr-bullet[pyapriltags]'"
        ) from None
    return pyapriltags.Detector(families=family, nthreads=1)
