"""The one native AprilTag detector of a process, with the settings that its Python wrapper hides.

Creating and destroying native detectors in turn crashes (measured: use after free in the library's tag
family), so a process makes one, keeps it until it ends, and writes the wanted settings into it before each
call. It must not be shared between threads, and a forked child gets its own.
"""

from __future__ import annotations

import ctypes
import os
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Protocol

from pupil_apriltags import bindings

from msrr_scenes.errors import MsrrError
from msrr_scenes.messages import Array, Pixels


class DetectorError(MsrrError):
    """The native detector cannot do what was asked of it."""


@dataclass(frozen=True, slots=True)
class NativeSettings:
    """Settings of the AprilTag library, under the library's own names.

    Attributes:
        quad_decimate: Factor by which the image is shrunk before quads are searched; corners and bits are
            read at full resolution all the same.
        quad_sigma: Gaussian blur before the search [px].
        decode_sharpening: Sharpening of the sampled bits before they are thresholded.
        min_white_black_diff: Contrast below which a tile of 4 x 4 px takes no part in the search
            [grey levels].
    """

    quad_decimate: float
    quad_sigma: float
    decode_sharpening: float
    min_white_black_diff: int


class RawDetection(Protocol):
    """What the wrapper returns, corners counted from pixel edges."""

    tag_id: int
    hamming: int
    decision_margin: float
    corners: Array


class _Detector(ctypes.Structure):
    """The head of the library's ``apriltag_detector_t`` with the threshold parameters that follow it."""

    _fields_ = (
        ("nthreads", ctypes.c_int),
        ("quad_decimate", ctypes.c_float),
        ("quad_sigma", ctypes.c_float),
        ("refine_edges", ctypes.c_int),
        ("decode_sharpening", ctypes.c_double),
        ("debug", ctypes.c_int),
        ("min_cluster_pixels", ctypes.c_int),
        ("max_nmaxima", ctypes.c_int),
        ("critical_rad", ctypes.c_float),
        ("cos_critical_rad", ctypes.c_float),
        ("max_line_fit_mse", ctypes.c_float),
        ("min_white_black_diff", ctypes.c_int),
    )


#: Values that the library sets itself; found at their places they prove that the layout above is right.
_LIBRARY_DEFAULTS = {
    "min_cluster_pixels": 5,
    "max_nmaxima": 10,
    "max_line_fit_mse": 10.0,
    "min_white_black_diff": 5,
}


class _Immortal(bindings.Detector):  # type: ignore[misc]  # untyped, so a base class of type Any
    """A wrapper that leaves the native memory to the end of the process."""

    def __del__(self) -> None:
        """Destroy nothing."""


@lru_cache(maxsize=8)
def _native(process: int, family: str) -> tuple[Any, Any]:
    wrapper = _Immortal(families=family, nthreads=1)
    fields = ctypes.cast(wrapper.tag_detector_ptr, ctypes.POINTER(_Detector)).contents
    found = {name: getattr(fields, name) for name in _LIBRARY_DEFAULTS}
    if found != _LIBRARY_DEFAULTS:
        raise DetectorError(
            f"this build of pupil-apriltags lays its detector out differently: {found}; "
            "install the version range that the package asks for"
        )
    return wrapper, fields


def detect(pixels: Pixels, family: str, settings: NativeSettings) -> list[RawDetection]:
    """Run the native detector on mono8 ``pixels``, shape (height, width); corners count from pixel edges."""
    wrapper, fields = _native(os.getpid(), family)
    fields.quad_decimate = settings.quad_decimate
    fields.quad_sigma = settings.quad_sigma
    # Written here because the wrapper cuts this one down to a whole number.
    fields.decode_sharpening = settings.decode_sharpening
    fields.min_white_black_diff = settings.min_white_black_diff
    found: list[RawDetection] = wrapper.detect(pixels)
    return found
