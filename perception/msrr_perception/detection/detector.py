"""The detector protocol, and the AprilTag detector that ships."""

from __future__ import annotations

import math
from collections.abc import Sequence
from copy import copy
from dataclasses import replace
from typing import Protocol

from msrr_perception.detection import native_apriltag
from msrr_perception.detection.aruco_detector import ArucoDetector
from msrr_perception.detection.checked_tags import checked_tags
from msrr_perception.detection.native_apriltag import NativeSettings
from msrr_perception.detection.pyapriltags_detector import PyAprilTagsDetector
from msrr_perception.detection.refining_detector import RefiningDetector, check_ranges
from msrr_perception.detection.restoration import noise_gain
from msrr_scenes.geometry.lens import Lens
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.guarded import of_the_same_kind
from msrr_scenes.messages import Pixels, TagDetection
from msrr_scenes.registry import ExtensionPoint, build, is_import_path
from msrr_scenes.specs.scene import Scene

#: Shortest edge of an upright tag in the image from which it is found at half the resolution as well [px]; at
#: a third of it from one and a half times this on, and at a quarter from twice this on. Turned tags need more
#: (:attr:`msrr_perception.detection.windows.ExpectedTag.upright_edge`). With the noise of the design and with
#: 8 grey levels and a blur of 1 px, of 1815 rendered tags that are as large none was missed at half the
#: resolution, of 1441 none at a third, of 900 none at a quarter, and the RMS errors of their refined corners
#: were the same to 0.001 px. Of 1800 drawn tags at all angles that just are as large none was missed.
LARGE_TAG_PX = 20.0

#: Largest decimation of the search.
_MOST_DECIMATION = 4

#: Sharpening of the sampled bits: of an image as it is, and of one that is restored from its blur.
_SHARPENING, _RESTORED_SHARPENING = 1.0, 0.25

#: Contrast of a 4 px tile below which the search skips it [grey levels]. Well lit tags have about 200; with a
#: limit near the noise every tile is let through, and the search takes 50 times longer.
_CONTRAST = 30

#: Contrast in standard deviations of the noise that a tile without edges hardly ever has. The library takes
#: that of a tile and its eight neighbours; of 144 pixels the range exceeds this in 6 of 1000 cases.
_NOISE_SIGMAS = 7.0

#: Largest contrast that is asked for on account of noise [grey levels]: tiles of tags have more. With a limit
#: beyond what 8 bits can differ by, no tag at all would be found.
_MOST_CONTRAST = 128


class Detector(Protocol):
    """An object that finds tags in one window of one frame."""

    def detect(self, pixels: Pixels, window: Window) -> tuple[TagDetection, ...]:
        """Return the tags in ``pixels``, mono8 of shape (window.height, window.width).

        Corners are pixels of the FULL frame, counted from pixel centres, in the order of
        :func:`msrr_scenes.geometry.unit_geometry.tag_corners`; tags are sorted by id.
        """
        ...


def adapted(detector: Detector, method: str, *arguments: object) -> Detector:
    """Return what a method of a detector returns; the detector itself if it has no such method.

    A detector that reads tags faster or better where it knows more of an image may have the methods
    ``for_large_tags()`` (all tags appear larger than :data:`LARGE_TAG_PX`), ``for_lens(lens)`` (it measures
    straight edges, which a lens may bend), ``for_blur(blur_px)`` and ``for_noise(noise_grey)`` (standard
    deviations of the blur [px] and of a pixel [grey levels]). Each returns the detector to use there.
    """
    make = getattr(detector, method, None)
    return detector if make is None else make(*arguments)


def detectors_by_size(detector: Detector) -> tuple[tuple[float, Detector], ...]:
    """Return detectors, each with the edge of an upright tag from which to use it [px], largest first.

    The detector for large tags is asked for one for tags that are larger by half of :data:`LARGE_TAG_PX`, and
    that one for the next.
    """
    found = [(0.0, detector)]
    for k in range(2, _MOST_DECIMATION + 1):
        found.append((0.5 * k * LARGE_TAG_PX, adapted(found[-1][1], "for_large_tags")))
    return tuple(reversed(found))


def detector_for(detectors: Sequence[tuple[float, Detector]], upright_px: float) -> Detector:
    """Return which of :func:`detectors_by_size` to use, by the shortest edge of an upright tag [px]."""
    return next(detector for least_px, detector in detectors if upright_px >= least_px)


def for_camera(detector: Detector, lens: Lens, blur_px: float, noise_grey: float) -> Detector:
    """Return the detector to use for a camera, by its calibration and what its data sheet says.

    ``blur_px`` and ``noise_grey`` are the standard deviations of its blur [px] and of a pixel [grey levels].
    """
    behind = adapted(detector, "for_lens", lens) if lens.distorts else detector
    return adapted(adapted(behind, "for_blur", blur_px), "for_noise", noise_grey)


class PupilDetector(RefiningDetector):
    """An AprilTag 3 detector by way of pupil-apriltags.

    All instances in a thread share one native detector (see
    :mod:`msrr_perception.detection.native_apriltag`).
    """

    raw_sigma_px = 0.13

    def __init__(
        self,
        family: str = "tag36h11",
        quad_decimate: float = 1.0,
        quad_sigma: float = 0.0,
        decode_sharpening: float | None = None,
        min_white_black_diff: int | None = None,
        max_hamming: int | None = None,
        min_decision_margin: float = 10.0,
        refine: bool = True,
        restore: bool = True,
    ) -> None:
        """Create a detector; see :class:`NativeSettings` for the native parameters.

        Without ``max_hamming`` as many bits are corrected as the family allows. Without
        ``min_white_black_diff`` it is 30 grey levels, or more if noise asks for it. With ``restore`` tags are
        looked for in images restored from the blur of the camera, where it is told and large enough
        (:func:`msrr_perception.detection.restoration.restoring_filter`). Without ``decode_sharpening`` it is
        1, and 0.25 in restored images.

        Raises:
            ParameterError: A parameter is out of its range.
        """
        check_ranges(locals(), "decode_sharpening", "min_white_black_diff", "max_hamming")
        super().__init__(family, max_hamming, min_decision_margin, refine)
        self._restores = restore
        contrast = _CONTRAST if min_white_black_diff is None else int(min_white_black_diff)
        sharpening = _SHARPENING if decode_sharpening is None else decode_sharpening
        self._sharpening_is_given = decode_sharpening is not None
        self.settings = NativeSettings(quad_decimate, quad_sigma, sharpening, contrast)
        self._decimate_for_large, self._contrast_is_given = 2.0, min_white_black_diff is not None

    def for_large_tags(self) -> PupilDetector:
        """Return a detector that searches at half the resolution; that one returns one for a third of it.

        Its corners are as good because they are refined in the full image; without refinement the detector
        itself is returned.
        """
        decimate = self._decimate_for_large
        if not self.refine or self.settings.quad_decimate >= decimate:
            return self
        quick = copy(self)
        quick.settings = replace(self.settings, quad_decimate=decimate)
        quick._decimate_for_large = min(decimate + 1.0, _MOST_DECIMATION)
        return quick

    def for_noise(self, noise_grey: float) -> PupilDetector:
        """Return a detector that skips tiles whose contrast may be noise, unless a contrast was given.

        It finds the same tags: those have the contrast of their modules beside that of the noise. With more
        noise than 18 grey levels the search lets tiles of noise through, and takes longer. Images of a camera
        that blurs are restored first, which changes the noise.
        """
        noisy = super().for_noise(noise_grey)
        if noisy._restoring is not None:
            noise_grey *= noise_gain(noisy._restoring)
            if not self._sharpening_is_given:
                noisy.settings = replace(noisy.settings, decode_sharpening=_RESTORED_SHARPENING)
        contrast = min(math.ceil(_NOISE_SIGMAS * noise_grey), _MOST_CONTRAST)
        if self._contrast_is_given or contrast <= self.settings.min_white_black_diff:
            return noisy
        noisy = copy(noisy)
        noisy.settings = replace(noisy.settings, min_white_black_diff=contrast)
        return noisy

    def find(self, pixels: Pixels) -> list[TagDetection]:
        """Return the tags as the library finds them; see :meth:`RefiningDetector.find`."""
        return native_apriltag.detect(pixels, self.family, self.settings, int(self.max_hamming))


def default_search_detector(
    family: str = "tag36h11", smallest_px: float = math.inf, blur_px: float = 0.0, noise_grey: float = 0.0
) -> Detector:
    """Return a detector that quickly finds tags at any angle in a full frame.

    It searches at half the resolution where that misses none, which takes a third of the time.
    ``smallest_px`` is the edge of the smallest tag in the image. Blur and noise are those of the camera, as
    for :func:`for_camera`.
    """
    large = smallest_px >= math.sqrt(2.0) * LARGE_TAG_PX
    detector = PupilDetector(family, quad_decimate=2.0 if large else 1.0)
    return (detector if large else detector.for_blur(blur_px)).for_noise(noise_grey)


DETECTORS: ExtensionPoint[Detector] = ExtensionPoint(
    "detector",
    {"pupil": PupilDetector, "pyapriltags": PyAprilTagsDetector, "aruco": ArucoDetector},
    methods={"detect": checked_tags},
    optional=dict.fromkeys(("for_blur", "for_large_tags", "for_lens", "for_noise"), of_the_same_kind),
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
    return build("control.detector", choice, DETECTORS)
