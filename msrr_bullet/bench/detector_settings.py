"""The settings that are compared: the library's, ours, and ours with one thing changed at a time."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

from msrr_bullet.bench.detection_metrics import Contestant, WatchedDetector, WholeFrame
from msrr_bullet.robot.autonomy import FULL_LOOK_EVERY
from msrr_perception.detection.detector import Detector, PupilDetector
from msrr_perception.detection.onboard_vision import OnboardVision
from msrr_perception.detection.overhead_vision import OVERHEAD_POLICY, OverheadVision, default_search_detector
from msrr_perception.detection.windows import DEFAULT_POLICY, WindowPolicy
from msrr_perception.pose.overhead_model import OverheadModel
from msrr_perception.pose.target import TargetModel
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.messages import GlobalPose, Pixels, PoseEstimate, TagDetection

#: Label of the settings that a trial runs with.
OURS = "ours"

#: Label of the library's own settings, which know nothing of windows.
LIBRARY = "library's defaults"

#: What pupil-apriltags does when it is told nothing.
LIBRARY_CONTRAST = 5
LIBRARY_SHARPENING = 0.25
LIBRARY_DECIMATION = 2.0

#: Any number of pixels is fewer.
_ANY_AREA = sys.maxsize


def library_detector() -> Detector:
    """Return the detector as the library sets it up, its corners as they come."""
    return PupilDetector(
        quad_decimate=LIBRARY_DECIMATION,
        decode_sharpening=LIBRARY_SHARPENING,
        min_white_black_diff=LIBRARY_CONTRAST,
        max_hamming=2,
        min_decision_margin=0.0,
        refine=False,
    )


#: What is changed of our detector, by label.
_DETECTORS: Mapping[str, Callable[[], Detector]] = MappingProxyType(
    {
        "library detector": library_detector,
        "contrast 5": lambda: PupilDetector(min_white_black_diff=LIBRARY_CONTRAST),
        "contrast 60": lambda: PupilDetector(min_white_black_diff=60),
        "decimation 2": lambda: PupilDetector(quad_decimate=LIBRARY_DECIMATION),
        "sharpening 0.25": lambda: PupilDetector(decode_sharpening=LIBRARY_SHARPENING),
        "raw corners": lambda: PupilDetector(refine=False),
    }
)

#: What is changed of our windows on board, by label.
_POLICIES: Mapping[str, WindowPolicy] = MappingProxyType(
    {
        "one window": replace(DEFAULT_POLICY, merge_px=_ANY_AREA),
        "one window each": replace(DEFAULT_POLICY, merge_px=0),
        "no pixel budget": replace(DEFAULT_POLICY, budget_px=_ANY_AREA, extra_px=_ANY_AREA),
        "port's tags only": replace(DEFAULT_POLICY, extra_px=0),
    }
)


def onboard_contestants(target: TargetModel) -> dict[str, Contestant[PoseEstimate]]:
    """Return who reads the docking unit's camera, by label."""

    def windows(
        detector: Detector, policy: WindowPolicy = DEFAULT_POLICY, full_every: int = FULL_LOOK_EVERY
    ) -> Contestant[PoseEstimate]:
        watched = WatchedDetector(detector)
        return Contestant(OnboardVision(target, watched, policy, full_every=full_every), watched)

    contestants: dict[str, Contestant[PoseEstimate]] = {
        LIBRARY: whole_frames(library_detector(), target.camera.frame),
        OURS: windows(PupilDetector()),
        **{f"... {label}": windows(build()) for label, build in _DETECTORS.items()},
    }
    contestants["... no decimation"] = windows(_OneResolution(PupilDetector()))
    contestants["... full frames"] = windows(PupilDetector(), full_every=1)
    for label, policy in _POLICIES.items():
        contestants[f"... {label}"] = windows(PupilDetector(), policy)
    return contestants


def overhead_contestants(model: OverheadModel) -> dict[str, Contestant[Mapping[str, GlobalPose]]]:
    """Return who reads the overhead camera, by label."""
    frame = model.camera.frame

    def windows(
        detector: Detector | None = None,
        searcher: Detector | None = None,
        policy: WindowPolicy = OVERHEAD_POLICY,
        period_s: float = 1.0,
    ) -> Contestant[Mapping[str, GlobalPose]]:
        watched = WatchedDetector(detector or PupilDetector())
        vision = OverheadVision(model, watched, searcher, policy, search_period_s=period_s)
        return Contestant(vision, watched)

    return {
        LIBRARY: whole_frames(library_detector(), frame),
        OURS: windows(),
        **{f"... {label}": windows(build()) for label, build in _DETECTORS.items()},
        "... one window": windows(policy=replace(OVERHEAD_POLICY, merge_px=_ANY_AREA)),
        "... fine search": windows(searcher=PupilDetector()),
        "... constant search": windows(period_s=1e-3),
        "... full frames": whole_frames(PupilDetector(), frame),
        "search alone": whole_frames(default_search_detector(), frame),
    }


def whole_frames(detector: Detector, frame: Window) -> Contestant[object]:
    """Return a contestant that reads full frames."""
    watched = WatchedDetector(detector)
    return Contestant(WholeFrame(watched, frame), watched)


@dataclass(frozen=True)
class _OneResolution:
    """A detector that has no quicker way with large tags."""

    detector: Detector

    def detect(self, pixels: Pixels, window: Window) -> tuple[TagDetection, ...]:
        return self.detector.detect(pixels, window)
