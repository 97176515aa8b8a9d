"""The settings in which laws are studied: drive limits, starts, and errors of the measurements."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

from msrr_bullet.studies.measures import PhaseName
from msrr_control.docking.guidance import GuidanceSpec
from msrr_control.docking.law import DockSetup
from msrr_control.path_following.path import PaceSpec
from msrr_control.studies.disturbance import Disturbance
from msrr_control.studies.docking_study import CLOSE, CLOSE_HARD, StartSet
from msrr_control.studies.path_following_study import PathFollowingStartSet
from msrr_scenes.loading.load import load_scene
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.spec import Spread

#: The guidance trajectory of the paper's close phase. It neither slows down before contact nor waits for a
#: unit that lags behind.
PAPER_TRAJECTORY = GuidanceSpec(contact_mps=0.11, overrun_m=0.08, lag_m=10.0, corridor_m=10.0)

#: The pace of the desired point in the paper's long phase. It does not wait either.
PAPER_PACE = PaceSpec(lag_m=10.0)


@dataclass(frozen=True)
class Setting:
    """One setting of the unicycle studies.

    Attributes:
        name: Name in tables and in the JSON.
        limits: Drive limits, ``normal`` or ``tight``.
        kappa_per_s: Bandwidth of the drive's inner loop; None is that of the limits.
        disturbance: Errors of the measurements, and wheel slip.
        docking_starts: Starts of the close phase.
        path_following_starts: Starts of the long phase.
        docking_params: Parameters that override those of C1 and its ablations in the close phase.
        path_following_params: Parameters that override those of C1 and its ablations in the long phase.
    """

    name: str
    limits: str = "normal"
    kappa_per_s: float | None = None
    disturbance: Disturbance = field(default_factory=Disturbance)
    docking_starts: StartSet = CLOSE
    path_following_starts: PathFollowingStartSet = field(default_factory=PathFollowingStartSet)
    docking_params: dict[str, Any] = field(default_factory=dict)
    path_following_params: dict[str, Any] = field(default_factory=dict)

    def description(self, phase: PhaseName) -> str:
        """Describe one phase of the setting, from the values that it is drawn with."""
        parts = ["TIGHT limits"] if self.limits == "tight" else []
        if self.kappa_per_s is not None:
            parts.append(f"a drive that lags {1e3 / self.kappa_per_s:g} ms")
        if phase == "close":
            spread = self.docking_starts.spread
            x, y, yaw = 100.0 * spread.x_m, 100.0 * spread.y_m, spread.yaw_deg
            parts.append(f"starts within {x:g} cm along and {y:g} cm across the axis and {yaw:g} deg")
            gain = self.docking_params.get("feedback", {}).get("k_n_per_s")
        else:
            starts = self.path_following_starts
            parts.append(f"starts within {100.0 * starts.error_m:g} cm and {starts.error_deg:g} deg")
            gain = self.path_following_params.get("tracking", {}).get("k_l_per_s")
        if gain is not None:
            parts.append(f"gain {gain:g} 1/s")
        return ", ".join([*parts, *_describe_disturbance(self.disturbance, phase)])

    @cached_property
    def scene(self) -> Scene:
        """The shipped unit in front of a port, under these limits."""
        overrides = {"limits.setting": self.limits}
        if self.kappa_per_s is not None:
            overrides["limits.kappa_per_s"] = str(self.kappa_per_s)
        return load_scene("close_range", overrides)

    def dock_setup(self) -> DockSetup:
        """Return the facts of the shipped unit's docking step, under these limits."""
        scene = self.scene
        return DockSetup.of(scene, scene.docks[0])


def merge_params(base: dict[str, Any], overrides: dict[str, Any]) -> dict[str, Any]:
    """Return nested parameters with the overrides applied at every level."""
    merged = dict(base)
    for key, value in overrides.items():
        old = merged.get(key)
        nested = isinstance(old, dict) and isinstance(value, dict)
        merged[key] = merge_params(merged[key], value) if nested else value
    return merged


def _describe_disturbance(wrong: Disturbance, phase: PhaseName) -> list[str]:
    parts = [f"{1e3 * wrong.sigma_xy_m:g} mm", f"{wrong.sigma_yaw_deg:g} deg"] if wrong.sigma_xy_m else []
    if phase == "close" and wrong.sigma_bearing_deg:
        parts.append(f"{wrong.sigma_bearing_deg:g} deg of each edge angle")
    if wrong.slip:
        parts.append(f"{100.0 * wrong.slip:g} % slip")
    if wrong.delay_s:
        how = "" if wrong.compensated else " that the estimator does not compensate for"
        parts.append(f"{1e3 * wrong.delay_s:g} ms{how}")
    return parts or ["no noise, no delay, no slip"]


#: The edge angles are as noisy as the heading.
_NOISE = Disturbance(sigma_xy_m=0.005, sigma_yaw_deg=1.0, sigma_bearing_deg=1.0, delay_s=0.05, slip=0.02)

IDEAL = Setting("ideal")
#: What the proofs of the paper assume: a drive that is limited, but follows within its limits at once.
NO_LAG = Setting("ideal, no lag", kappa_per_s=1000.0)
STANDARD = Setting("standard", disturbance=_NOISE)
UNCOMPENSATED = Setting("uncompensated", disturbance=_NOISE.model_copy(update={"compensated": False}))
HARD = Setting(
    "hard",
    limits="tight",
    disturbance=_NOISE.model_copy(update={"delay_s": 0.10}),
    docking_starts=CLOSE_HARD,
)
_WIDE_STARTS = StartSet(spread=Spread(x_m=0.05, y_m=0.25, yaw_deg=30.0))
WIDE = replace(HARD, name="wide", docking_starts=_WIDE_STARTS)
WIDE_UNCOMPENSATED = replace(
    WIDE,
    name="wide, uncompensated",
    disturbance=WIDE.disturbance.model_copy(update={"compensated": False}),
)
HIGH_GAIN = Setting(
    "high gain",
    disturbance=_NOISE.model_copy(update={"delay_s": 0.10, "compensated": False}),
    docking_params={"feedback": {"k_n_per_s": 6.0}},
    path_following_params={"tracking": {"k_l_per_s": 4.0}},
)
LONG_DELAY = Setting(
    "long delay", disturbance=_NOISE.model_copy(update={"delay_s": 0.20, "compensated": False})
)
TIGHT_HIGH_GAIN = replace(HIGH_GAIN, name="tight, high gain", limits="tight", docking_starts=CLOSE_HARD)
