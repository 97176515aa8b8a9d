"""The figures that are measured in each phase, with the paper's values and this project's targets."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

#: The long-distance phase (path following) and the close-range phase (docking), as they stand in the JSON.
PhaseName = Literal["long", "close"]

#: Phases in the order in which they are shown.
PHASES: tuple[PhaseName, ...] = ("long", "close")

#: Largest lateral error [m] and yaw error [deg] at the port's face that the mechanism centres by itself.
CAPTURE_M, CAPTURE_DEG = 0.013, 8.0


@dataclass(frozen=True, slots=True)
class Measure:
    """One figure of a trial.

    Attributes:
        key: Name in the JSON.
        label: Name in figures and tables.
        unit: Unit in which the figure is shown.
        scale: Factor from SI to that unit.
        paper_c1: The paper's value for its own law C1, in SI; None where the paper gives none.
        paper_c2: The paper's value for its comparison law C2, in SI; None where the paper gives none.
        target_p50: Target for the median of C1 under the standard setting, in SI.
        target_p95: Target for the 95th percentile of C1 under the standard setting, in SI.
        more_is_better: The small values are the bad ones, so that minimum and 5th percentile are shown in
            place of median and 95th percentile.
    """

    key: str
    label: str
    unit: str
    scale: float = 1.0
    paper_c1: float | None = None
    paper_c2: float | None = None
    target_p50: float | None = None
    target_p95: float | None = None
    more_is_better: bool = False

    @property
    def tail(self) -> float:
        """The quantile that says how bad it gets: the 95th percentile, or the 5th where more is better."""
        return 0.05 if self.more_is_better else 0.95


#: Amplitude and recovery are measured twice: by the distance to the desired point, which includes lag along
#: the path, and by the distance to the path itself. The paper's values are compared with the first.
PATH_FOLLOWING = (
    Measure("tracking", "steady tracking error", "mm", 1e3, 0.029, 0.031, 0.020, 0.025),
    Measure("amplitude", "amplitude to the desired point", "m", 1.0, 0.3, 0.5, 0.25, 0.27),
    Measure("amplitude_path", "amplitude to the path", "m"),
    Measure("recovery", "recovery to the desired point", "s", 1.0, 3.0, 6.0, 2.2, 2.5),
    Measure("recovery_path", "recovery to the path", "s"),
    Measure("clearance", "smallest clearance", "m", more_is_better=True),
)

#: The paper's C2 never stays under 15 mm, so that its settling time has no value. The paper's figures are
#: errors to the guidance trajectory, which not every law follows; laws are compared by the error to the port.
DOCKING = (
    Measure("settling", "time to stay under 15 mm", "s", 1.0, 4.0, None, 1.2, 2.0),
    Measure("final", "final error to the guidance", "mm", 1e3, 0.007, 0.044, 0.0025, 0.0035),
    Measure("port", "final error to the port", "mm", 1e3),
    Measure("contact", "time to contact", "s"),
    Measure("lateral", "lateral error at contact", "mm", 1e3),
    Measure("yaw", "yaw error at contact", "deg", 57.29577951308232),
)

MEASURES: dict[PhaseName, tuple[Measure, ...]] = {"long": PATH_FOLLOWING, "close": DOCKING}

#: Keys of the measures that a trial has only if its path met an obstacle.
OBSTACLE_MEASURES = ("amplitude", "recovery")

#: Distance of the controlled point from the guidance trajectory below which it counts as settled [m].
SETTLED_M = 0.015


def measure(key: str) -> Measure:
    """Return the measure with this key."""
    return next(m for measures in MEASURES.values() for m in measures if m.key == key)


def paper_measures(phases: Iterable[PhaseName]) -> tuple[Measure, ...]:
    """Return the measures of these phases for which the paper gives a value of its own law."""
    return tuple(m for phase in phases for m in MEASURES[phase] if m.paper_c1 is not None)
