"""What is measured in each phase, what the paper reports of it, and what is asked of C1 here."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

PhaseName = Literal["long", "close"]

#: What the mechanism centres by itself: lateral [m] and yaw [deg] of a unit at the port's face.
CAPTURE_M, CAPTURE_DEG = 0.013, 8.0


@dataclass(frozen=True, slots=True)
class Measure:
    """One figure of a trial.

    Attributes:
        key: Name in the JSON.
        label: Name in figures and tables.
        unit: Unit in which it is shown.
        scale: From SI to that unit.
        paper_c1: The paper's figure of its own law, in SI; None where it gives none.
        paper_c2: The same of its comparison.
        asked_p50: What is asked of the median of C1 under the standard setting, in SI.
        asked_p95: The same of the 95th percentile.
    """

    key: str
    label: str
    unit: str
    scale: float = 1.0
    paper_c1: float | None = None
    paper_c2: float | None = None
    asked_p50: float | None = None
    asked_p95: float | None = None


#: Amplitude and recovery are of the distance to the desired point, in which lag along the path counts, and
#: beside that of the distance to the path itself. The paper's figures stand beside the first.
LONG = (
    Measure("tracking", "steady tracking error", "mm", 1e3, 0.029, 0.031, 0.020, 0.025),
    Measure("amplitude", "amplitude to the desired point", "m", 1.0, 0.3, 0.5, 0.25, 0.27),
    Measure("amplitude_path", "amplitude to the path", "m"),
    Measure("recovery", "recovery to the desired point", "s", 1.0, 3.0, 6.0, 2.2, 2.5),
    Measure("recovery_path", "recovery to the path", "s"),
    Measure("clearance", "smallest clearance", "m"),
)

#: The paper's C2 never stays under 15 mm; its settling has no figure.
CLOSE = (
    Measure("settling", "time to stay under 15 mm", "s", 1.0, 4.0, None, 1.2, 2.0),
    Measure("final", "final error", "mm", 1e3, 0.007, 0.044, 0.0025, 0.0035),
    Measure("lateral", "lateral error at contact", "mm", 1e3),
    Measure("yaw", "yaw error at contact", "deg", 57.29577951308232),
)

MEASURES: dict[PhaseName, tuple[Measure, ...]] = {"long": LONG, "close": CLOSE}

#: Figures that a trial has only if its path met an obstacle.
OF_THE_OBSTACLE = ("amplitude", "recovery")

#: Distance [m] below which an error counts as settled.
SETTLED_M = 0.015


def measure(key: str) -> Measure:
    """Return the measure of that key."""
    return next(m for measures in MEASURES.values() for m in measures if m.key == key)


def paper_figures(phases: Iterable[PhaseName]) -> tuple[Measure, ...]:
    """Return the measures of these phases of which the paper gives a figure for its own law."""
    return tuple(m for phase in phases for m in MEASURES[phase] if m.paper_c1 is not None)
