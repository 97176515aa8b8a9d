"""The settings in which laws are studied: drive limits, starts, and errors of the measurements."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from msrr_control.docking.guidance import GuidanceSpec
from msrr_control.docking.law import DockSetup
from msrr_control.path_following.path import PaceSpec
from msrr_control.studies.disturbance import Disturbance
from msrr_control.studies.docking_study import CLOSE, CLOSE_HARD, StartSet
from msrr_control.studies.path_following_study import PathFollowingStartSet
from msrr_scenes.loading.load import load_scene
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.spec import Spread
from msrr_scenes.specs.vehicle import LimitsSpec

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
        description: Description for the readers of the report.
        limits: Drive limits, ``normal`` or ``tight``.
        disturbance: Errors of the measurements, and wheel slip.
        docking_starts: Starts of the close phase.
        path_following_starts: Starts of the long phase.
        docking_params: Parameters that override those of C1 and its ablations in the close phase.
        path_following_params: Parameters that override those of C1 and its ablations in the long phase.
    """

    name: str
    description: str
    limits: str = "normal"
    disturbance: Disturbance = field(default_factory=Disturbance)
    docking_starts: StartSet = CLOSE
    path_following_starts: PathFollowingStartSet = field(default_factory=PathFollowingStartSet)
    docking_params: dict[str, Any] = field(default_factory=dict)
    path_following_params: dict[str, Any] = field(default_factory=dict)

    @property
    def limits_spec(self) -> LimitsSpec:
        """The drive's limits."""
        return LimitsSpec.model_validate({"setting": self.limits})

    @property
    def scene(self) -> Scene:
        """The shipped unit in front of a port, under these limits."""
        return load_scene("close_range", {"limits.setting": self.limits})

    def dock_setup(self) -> DockSetup:
        """Return the facts of the shipped unit's docking step, under these limits."""
        scene = self.scene
        return DockSetup.of(scene, scene.plan[0])

    @property
    def half_fov(self) -> float:
        """Half the field of view of the shipped unit's camera [rad]."""
        return self.scene.cameras.onboard.pinhole.half_fov


def merge_params(base: dict[str, Any], overrides: dict[str, Any]) -> dict[str, Any]:
    """Return nested parameters with the overrides applied at every level."""
    merged = dict(base)
    for key, value in overrides.items():
        old = merged.get(key)
        nested = isinstance(old, dict) and isinstance(value, dict)
        merged[key] = merge_params(merged[key], value) if nested else value
    return merged


_NOISE = Disturbance(sigma_xy_m=0.005, sigma_yaw_deg=1.0, delay_s=0.05, slip=0.02)

IDEAL = Setting("ideal", "no noise, no delay, no slip")
STANDARD = Setting("standard", "5 mm, 1 deg, 50 ms, 2 % slip", disturbance=_NOISE)
UNCOMPENSATED = Setting(
    "uncompensated",
    "5 mm, 1 deg, 2 % slip, 50 ms that the estimator does not compensate for",
    disturbance=_NOISE.model_copy(update={"compensated": False}),
)
HARD = Setting(
    "hard",
    "TIGHT limits, starts of +-15 cm and +-25 deg, 5 mm, 1 deg, 100 ms, 2 % slip",
    limits="tight",
    disturbance=_NOISE.model_copy(update={"delay_s": 0.10}),
    docking_starts=CLOSE_HARD,
)
WIDE = Setting(
    "wide",
    "TIGHT limits, starts of +-25 cm and +-30 deg, 5 mm, 1 deg, 100 ms, 2 % slip",
    limits="tight",
    disturbance=HARD.disturbance,
    docking_starts=StartSet(spread=Spread(x_m=0.05, y_m=0.25, yaw_deg=30.0)),
)
HIGH_GAIN = Setting(
    "high gain",
    "gain 6 1/s (long: 4 1/s), 5 mm, 1 deg, 2 % slip, 100 ms that the estimator does not compensate for",
    disturbance=_NOISE.model_copy(update={"delay_s": 0.10, "compensated": False}),
    docking_params={"feedback": {"k_n_per_s": 6.0}},
    path_following_params={"tracking": {"k_l_per_s": 4.0}},
)
LONG_DELAY = Setting(
    "long delay",
    "5 mm, 1 deg, 2 % slip, 200 ms that the estimator does not compensate for",
    disturbance=_NOISE.model_copy(update={"delay_s": 0.20, "compensated": False}),
)
TIGHT_HIGH_GAIN = Setting(
    "tight, high gain",
    "as high gain, under TIGHT limits and with starts of +-15 cm and +-25 deg",
    limits="tight",
    disturbance=HIGH_GAIN.disturbance,
    docking_starts=CLOSE_HARD,
    docking_params=HIGH_GAIN.docking_params,
    path_following_params=HIGH_GAIN.path_following_params,
)
