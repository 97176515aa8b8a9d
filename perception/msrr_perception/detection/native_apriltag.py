"""The native AprilTag detectors of a thread, with the settings that their Python wrapper hides.

A native detector takes time and memory to create, and two threads must not use it at the same time. So each
thread creates one per tag family and number of corrected bits, writes the wanted settings into it before
each call, and keeps it until the thread ends. A forked child creates its own.

The wrapper frees a tag family before the detector that still uses it, which crashes; here it is freed after.

The library also knows what the tags of its families look like.
"""

from __future__ import annotations

import ctypes
import weakref
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from pupil_apriltags import bindings

from msrr_perception.detection.per_thread import kept_per_thread
from msrr_scenes.errors import MsrrError
from msrr_scenes.messages import Pixels, TagDetection
from msrr_scenes.specs.tag_families import FAMILIES

#: The AprilTag library counts pixels from their edges, this project from their centres.
EDGE_TO_CENTRE_PX = 0.5


#: Bits that are corrected at most: as many as the library's wrapper corrects. The library lists all codes
#: with so many wrong bits. For 587 tags this takes 37 MB of memory with two bits and 1 MB with one.
LIBRARY_BITS = 2

#: Families with more tags are read with one corrected bit at most: for 42,211 tags two take 4.5 GB of memory
#: and 13 s; one takes 0.1 GB and 0.2 s.
_MOST_TAGS = 3000


class DetectorError(MsrrError):
    """A detector cannot do what was asked of it."""


@dataclass(frozen=True, slots=True)
class NativeSettings:
    """The settings of the AprilTag library, under the library's own names.

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


#: What the library's wrapper searches with when nothing else is asked for.
LIBRARY_SETTINGS = NativeSettings(
    quad_decimate=2.0, quad_sigma=0.0, decode_sharpening=0.25, min_white_black_diff=5
)


class _Image(ctypes.Structure):
    """The library's ``image_u8_t``."""

    _fields_ = (
        ("width", ctypes.c_int32),
        ("height", ctypes.c_int32),
        ("stride", ctypes.c_int32),
        ("pixels", ctypes.c_void_p),
    )


class _Detection(ctypes.Structure):
    """The library's ``apriltag_detection_t``."""

    _fields_ = (
        ("family", ctypes.c_void_p),
        ("id", ctypes.c_int),
        ("hamming", ctypes.c_int),
        ("decision_margin", ctypes.c_float),
        ("homography", ctypes.c_void_p),
        ("middle", ctypes.c_double * 2),
        ("corners", ctypes.c_double * 8),
    )


class _Family(ctypes.Structure):
    """The library's ``apriltag_family_t``; places of bits count from the square that is detected."""

    _fields_ = (
        ("tags", ctypes.c_uint32),
        ("codes", ctypes.POINTER(ctypes.c_uint64)),
        ("edge_modules", ctypes.c_int),
        ("plate_modules", ctypes.c_int),
        ("white_inside", ctypes.c_bool),
        ("bits", ctypes.c_uint32),
        ("bit_x", ctypes.POINTER(ctypes.c_int32)),
        ("bit_y", ctypes.POINTER(ctypes.c_int32)),
        ("distance", ctypes.c_uint32),
        ("name", ctypes.c_char_p),
    )


class _List(ctypes.Structure):
    """The library's ``zarray_t``, here a list of pointers to :class:`_Detection`."""

    _fields_ = (
        ("element_bytes", ctypes.c_size_t),
        ("size", ctypes.c_int),
        ("room", ctypes.c_int),
        ("elements", ctypes.POINTER(ctypes.POINTER(_Detection))),
    )


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


#: Values that the library sets itself; found in these fields they prove that the layout above is right.
_LIBRARY_DEFAULTS = {
    "min_cluster_pixels": 5,
    "max_nmaxima": 10,
    "max_line_fit_mse": 10.0,
    "min_white_black_diff": 5,
}


def _created_detector() -> tuple[ctypes.CDLL, ctypes.c_void_p]:
    """Return the library and a detector of no family in it, which lives until :func:`_free`."""
    wrapper = bindings.Detector(families="tag16h5", nthreads=1)
    pointer = wrapper.tag_detector_ptr
    # The wrapper's destructor frees the detector that it holds; it shall outlive the wrapper.
    wrapper.tag_detector_ptr = None
    wrapper.libc["apriltag_detector_clear_families"](pointer)
    wrapper.libc["tag16h5_destroy"](wrapper.tag_families["tag16h5"])
    return wrapper.libc, ctypes.cast(pointer, ctypes.c_void_p)


def _free(library: ctypes.CDLL, detector: ctypes.c_void_p, family: str, description: ctypes.c_void_p) -> None:
    library["apriltag_detector_destroy"](detector)
    library[f"{family}_destroy"](description)  # not before the detector, which still uses it


class _NativeDetector:
    """A native detector, called without the wrapper, which copies every image and every homography."""

    def __init__(self, family: str, corrected_bits: int) -> None:
        library, self._detector = _created_detector()
        description = _create_family(library, family)
        freed = weakref.finalize(self, _free, library, self._detector, family, description)
        freed.atexit = False  # the memory of a process that ends is nobody's concern
        self.fields = ctypes.cast(self._detector, ctypes.POINTER(_Detector)).contents
        found = {name: getattr(self.fields, name) for name in _LIBRARY_DEFAULTS}
        if found != _LIBRARY_DEFAULTS:
            raise DetectorError(
                f"this build of pupil-apriltags lays its detector out differently: {found}; "
                "install the version range that the package asks for"
            )
        add = library["apriltag_detector_add_family_bits"]
        add.restype = None
        add(self._detector, description, ctypes.c_int(corrected_bits))
        # Access by index gives a new function object, so that the wrapper's own stays as it is.
        self._detect = library["apriltag_detector_detect"]
        self._detect.argtypes = (ctypes.c_void_p, ctypes.POINTER(_Image))
        self._detect.restype = ctypes.POINTER(_List)
        self._destroy = library["apriltag_detections_destroy"]
        self._destroy.argtypes = (ctypes.POINTER(_List),)
        self._destroy.restype = None

    def detect(self, pixels: Pixels) -> list[TagDetection]:
        """Return the tags in ``pixels``, which lie row after row without gaps."""
        height, width = pixels.shape
        image = _Image(width, height, width, pixels.ctypes.data)
        found = self._detect(self._detector, ctypes.byref(image))
        try:
            entries = found.contents
            return [_copied(entries.elements[i].contents) for i in range(entries.size)]
        finally:
            self._destroy(found)


def _copied(found: _Detection) -> TagDetection:
    corners = np.frombuffer(found.corners, dtype=np.float64).reshape(4, 2) - EDGE_TO_CENTRE_PX
    return TagDetection(found.id, corners, found.decision_margin, found.hamming)


_native_detector = kept_per_thread(_NativeDetector)


def detect(pixels: Pixels, family: str, settings: NativeSettings, corrected_bits: int) -> list[TagDetection]:
    """Return the tags in mono8 ``pixels``, shape (height, width), with corners in pixels of this image.

    Tags are read with up to ``corrected_bits`` wrong bits; no more than :data:`LIBRARY_BITS` are corrected,
    and one in the largest families. Memory and time of a thread's first call grow with it.
    """
    most = 1 if FAMILIES[family].ids > _MOST_TAGS else LIBRARY_BITS
    native = _native_detector(family, min(corrected_bits, most))
    fields = native.fields
    fields.quad_decimate = settings.quad_decimate
    fields.quad_sigma = settings.quad_sigma
    # The wrapper would truncate this one to a whole number.
    fields.decode_sharpening = settings.decode_sharpening
    fields.min_white_black_diff = settings.min_white_black_diff
    # The library blurs an image that it does not shrink in place.
    contiguous = pixels.copy() if settings.quad_sigma else np.ascontiguousarray(pixels)
    return native.detect(contiguous)


def tag_bitmap(family: str, tag_id: int) -> NDArray[np.bool_]:
    """Return the modules of a tag as AprilRobotics print it, white true, upright.

    Returns:
        Shape (N, N) with the family's ``plate_modules`` N.

    Raises:
        DetectorError: The family has no such tag.
    """
    known = FAMILIES[family]
    if not 0 <= tag_id < known.ids:
        raise DetectorError(f"tag id {tag_id} is not in {family}, which has ids 0 .. {known.ids - 1}")
    drawn, start = _printed_family(family), (known.plate_modules - known.edge_modules) // 2
    end = start + known.edge_modules
    bits = np.zeros((known.plate_modules, known.plate_modules), dtype=np.bool_)
    if known.white_inside:  # a white frame, which surrounds black or bits, in a black one
        bits[start:end, start:end] = True
        bits[start + 1 : end - 1, start + 1 : end - 1] = False
    else:
        bits[:], bits[start:end, start:end] = True, False
    code = drawn.codes[tag_id]
    for i in range(drawn.bits):
        bits[drawn.bit_y[i] + start, drawn.bit_x[i] + start] = code >> (drawn.bits - 1 - i) & 1
    return bits


@lru_cache(maxsize=len(FAMILIES))
def _printed_family(family: str) -> _Family:
    # The library draws tags itself, but this version of it puts the white frame of some families elsewhere.
    library, _ = _created_detector()
    return ctypes.cast(_create_family(library, family), ctypes.POINTER(_Family)).contents


def _create_family(library: ctypes.CDLL, family: str) -> ctypes.c_void_p:
    """Return the library's own description of a family, which its function ``destroy`` would free."""
    create = library[f"{family}_create"]
    create.restype = ctypes.c_void_p
    return ctypes.c_void_p(create())
