"""The settings that are compared: those of the library, ours, and ours with one setting changed at a time."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.util import find_spec

from msrr_bullet.bench.detection_metrics import Candidate, FullFrameReader, RecordingDetector
from msrr_perception.detection.aruco_detector import ArucoDetector
from msrr_perception.detection.detector import Detector, PupilDetector, default_search_detector
from msrr_perception.detection.onboard_vision import FULL_FRAME_PERIOD, OnboardVision
from msrr_perception.detection.overhead_vision import OVERHEAD_POLICY, OverheadVision
from msrr_perception.detection.pyapriltags_detector import PyAprilTagsDetector
from msrr_perception.detection.windows import DEFAULT_POLICY, WindowPolicy
from msrr_perception.pose.overhead_model import OverheadModel
from msrr_perception.pose.target import TargetModel
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.messages import GlobalPose, Pixels, PoseEstimate, TagDetection

#: Label of the settings that a trial runs with.
OURS = "ours"

#: Label of the library's default settings, which read full frames.
LIBRARY = "library's defaults"

#: Defaults of pupil-apriltags.
LIBRARY_CONTRAST = 5
LIBRARY_SHARPENING = 0.25
LIBRARY_DECIMATION = 2.0

#: Area that no window exceeds [px].
_ANY_AREA = sys.maxsize


def library_detector() -> Detector:
    """Return the detector with the library's defaults and without our refinement of the corners."""
    return PupilDetector(
        quad_decimate=LIBRARY_DECIMATION,
        decode_sharpening=LIBRARY_SHARPENING,
        min_white_black_diff=LIBRARY_CONTRAST,
        max_hamming=2,
        min_decision_margin=0.0,
        refine=False,
        restore=False,
    )


#: Our detector with one setting changed, by label.
_DETECTORS: Mapping[str, Callable[[], Detector]] = {
    "library detector": library_detector,
    "contrast 5": lambda: PupilDetector(min_white_black_diff=LIBRARY_CONTRAST),
    "contrast 60": lambda: PupilDetector(min_white_black_diff=60),
    "decimation 2": lambda: PupilDetector(quad_decimate=LIBRARY_DECIMATION),
    "sharpening 0.25": lambda: PupilDetector(decode_sharpening=LIBRARY_SHARPENING),
    "not restored": lambda: PupilDetector(restore=False),
    "raw corners": lambda: PupilDetector(refine=False),
    "OpenCV's ArUco": ArucoDetector,
}

#: Detectors by way of other libraries in our windows, by label; those that are installed.
if find_spec("pyapriltags") is not None:
    _DETECTORS = {**_DETECTORS, "pyapriltags": PyAprilTagsDetector}

#: Our windows on board with one setting changed, by label.
_POLICIES: Mapping[str, WindowPolicy] = {
    "one window": replace(DEFAULT_POLICY, merge_px=_ANY_AREA),
    "one window each": replace(DEFAULT_POLICY, merge_px=0),
    "no pixel budget": replace(DEFAULT_POLICY, budget_px=_ANY_AREA, extra_px=_ANY_AREA),
    "port's tags only": replace(DEFAULT_POLICY, extra_px=0),
}


def onboard_candidates(target: TargetModel) -> dict[str, Candidate[PoseEstimate]]:
    """Return the candidates for the docking unit's camera, by label."""

    def windows(
        detector: Detector, policy: WindowPolicy = DEFAULT_POLICY, full_every: int = FULL_FRAME_PERIOD
    ) -> Candidate[PoseEstimate]:
        recording = RecordingDetector(detector)
        return Candidate(OnboardVision(target, recording, policy, full_every=full_every), recording)

    candidates: dict[str, Candidate[PoseEstimate]] = {
        LIBRARY: full_frames(library_detector(), target.camera.frame),
        OURS: windows(PupilDetector()),
        **{f"... {label}": windows(build()) for label, build in _DETECTORS.items()},
    }
    candidates["... no decimation"] = windows(_OneResolution(PupilDetector()))
    candidates["... full frames"] = windows(PupilDetector(), full_every=1)
    for label, policy in _POLICIES.items():
        candidates[f"... {label}"] = windows(PupilDetector(), policy)
    return candidates


def overhead_candidates(
    model: OverheadModel, units: Sequence[str]
) -> dict[str, Candidate[Mapping[str, GlobalPose]]]:
    """Return the candidates for the overhead camera, by label; of the units the driving one comes first."""
    frame = model.camera.frame

    def windows(
        detector: Detector | None = None,
        searcher: Detector | None = None,
        policy: WindowPolicy = OVERHEAD_POLICY,
    ) -> Candidate[Mapping[str, GlobalPose]]:
        recording = RecordingDetector(detector or PupilDetector())
        vision = OverheadVision(model, units, recording, searcher, policy)
        return Candidate(vision, recording)

    return {
        LIBRARY: full_frames(library_detector(), frame),
        OURS: windows(),
        **{f"... {label}": windows(build()) for label, build in _DETECTORS.items()},
        "... one window": windows(policy=replace(OVERHEAD_POLICY, merge_px=_ANY_AREA)),
        "... fine search": windows(searcher=PupilDetector()),
        "... full frames": full_frames(PupilDetector(), frame),
        "search alone": full_frames(default_search_detector(), frame),
    }


def full_frames(detector: Detector, frame: Window) -> Candidate[object]:
    """Return a candidate that reads full frames."""
    recording = RecordingDetector(detector)
    return Candidate(FullFrameReader(recording, frame), recording)


@dataclass(frozen=True)
class _OneResolution:
    """A detector that reads large tags at full resolution, too."""

    detector: Detector

    def detect(self, pixels: Pixels, window: Window) -> tuple[TagDetection, ...]:
        return self.detector.detect(pixels, window)
