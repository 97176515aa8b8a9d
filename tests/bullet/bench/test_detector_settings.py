"""The library's settings are its own defaults."""

from __future__ import annotations

import inspect

from pupil_apriltags import Detector as LibraryDetector

from msrr_bullet.bench.detector_settings import library_detector
from msrr_perception.detection.detector import PupilDetector


def test_the_librarys_settings_are_the_librarys() -> None:
    given = inspect.signature(LibraryDetector.__init__).parameters
    plain = library_detector()
    assert isinstance(plain, PupilDetector)
    for name in ("quad_decimate", "quad_sigma", "decode_sharpening"):
        assert getattr(plain.settings, name) == given[name].default
