"""The results of a reproduction: the JSON from which report and figures are made."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from msrr_bullet.statistics import Quantiles, Rate, quantile, quantiles, wilson
from msrr_bullet.studies.measures import MEASURES, OBSTACLE_MEASURES, Measure, PhaseName, measure
from msrr_bullet.studies.series import Figure6, Panels, ResultPart
from msrr_scenes.arrays import Array


class Measured(ResultPart):
    """One measure over many trials, in SI.

    Attributes:
        values: Value of every trial that has one. The time to something that never happened is infinite.
        missing: Trials that do not have the measure, by their place among all trials.
        quantiles: Median, 95th percentile and largest of all these values.
        min: Smallest of them, None without any.
        p05: Their 5th percentile.
        count: Number of trials that have a value.
        never: Number of these values that are infinite.
    """

    values: tuple[float, ...]
    missing: tuple[int, ...] = ()
    quantiles: Quantiles
    min: float | None = None
    p05: float | None = None
    count: int
    never: int = 0

    @classmethod
    def of(cls, values: Iterable[float] | Array) -> Measured:
        """Collect values, rounded to the micrometre; NaN stands for a trial without a value."""
        given = [round(float(v), 6) for v in values]
        kept = tuple(v for v in given if not math.isnan(v))
        return cls(
            values=kept,
            missing=tuple(i for i, v in enumerate(given) if math.isnan(v)),
            quantiles=quantiles(kept),
            min=min(kept, default=None),
            p05=quantile(kept, 0.05) if kept else None,
            count=len(kept),
            never=sum(math.isinf(v) for v in kept),
        )

    def by_trial(self) -> Array:
        """Return the value of every trial, NaN for one without a value, shape (trials,)."""
        values = np.full(len(self.values) + len(self.missing), np.nan)
        values[np.setdiff1d(np.arange(len(values)), np.array(self.missing, dtype=int))] = self.values
        return values


class Count(ResultPart):
    """A number ``n`` of trials out of a number ``of`` of trials."""

    n: int
    of: int


#: What is true or not of a trial, in the order in which it is shown.
FlagName = Literal["success", "in_view", "in_cone"]


class Row(ResultPart):
    """One controller in one setting.

    Attributes:
        controller: Registered name of the controller.
        label: Name of the controller in tables and figures.
        trials: Number of trials.
        success: Share of trials that ended well: at the face inside the mechanism's capture range (close),
            clear of the obstacle (long), docked by the judge's verdict (bullet).
        in_view: Share of trials whose camera had both edges of the target in its field of view in every
            approach, from the hand-over to the contact, by truth; None where that has no meaning.
        in_cone: Share of trials that kept both edges within the outer bound of the line of sight, which is
            narrower than the field of view.
        flags: Whether each trial counts in ``success``, ``in_view`` and ``in_cone``: a digit 0 or 1 each.
            Trials of the same number have the same start and noise under every controller of a table.
        measures: Measures by key, see :mod:`msrr_bullet.studies.measures`.
        outcomes: Number of trials by the judge's verdict, where there is a judge.
        met: By key, the number of trials that meet the paper's value of its own law, out of those to which it
            applies: see :func:`count_within_paper`.
        within_paper: Number of trials that ended well and meet every value of the paper.
    """

    controller: str
    label: str
    trials: int
    success: Rate
    in_view: Rate | None = None
    in_cone: Rate | None = None
    flags: dict[FlagName, Annotated[str, Field(pattern=r"^[01]*$")]] = Field(default_factory=dict)
    measures: dict[str, Measured]
    outcomes: dict[str, int] = Field(default_factory=dict)
    met: dict[str, Count] = Field(default_factory=dict)
    within_paper: int | None = None

    def by_trial(self, name: FlagName) -> NDArray[np.bool_] | None:
        """Return what is true or not of each trial, shape (trials,); None where it has no meaning."""
        digits = self.flags.get(name)
        return None if digits is None else np.array([d == "1" for d in digits], dtype=bool)


class Table(ResultPart):
    """Several controllers in one setting."""

    phase: PhaseName
    plant: str
    setting: str
    description: str
    rows: tuple[Row, ...]

    def row(self, label: str) -> Row | None:
        """Return the row of a controller; None if the table does not have it."""
        return next((r for r in self.rows if r.label == label), None)

    @property
    def measures(self) -> list[Measure]:
        """The measures of the phase that any row has."""
        return [m for m in MEASURES[self.phase] if any(m.key in row.measures for row in self.rows)]


class MapCell(ResultPart):
    """One controller at one gain and one delay: share of trials docked, and final error to the guidance."""

    success: float
    final_p50_m: float


class GainDelayMap(ResultPart):
    """Docking success over gain and delay.

    Attributes:
        compensated: Whether the estimator compensates for the delay.
        gains: Gain k_n of every controller [1/s].
        latencies: Latency from exposure to use [s].
        lag: Time constant 1 / kappa of the drive [s]; the total delay is latency plus lag.
        extra_gain: Gain that the boundary layer of C2 adds to k_n [1/s].
        trials: Number of trials in each cell.
        cells: Cells by the controller's label, one row for each gain, one column for each latency.
        paper_cell: The (gain, latency) at which the medians of the final error come nearest to the paper's.
    """

    compensated: bool
    gains: tuple[float, ...]
    latencies: tuple[float, ...]
    lag: float
    extra_gain: float
    trials: int
    cells: dict[str, tuple[tuple[MapCell, ...], ...]]
    paper_cell: tuple[float, float]


class Ablations(ResultPart):
    """C1 with one of its parts switched off, in several settings."""

    phase: PhaseName
    tables: tuple[Table, ...]


class ConditionShare(ResultPart):
    """How often V falls under a condition.

    Attributes:
        time: Share of the time in which the condition holds.
        falls: Share of that in which V falls; None where the condition never holds.
        proved: Share of that in which V changes as the equation says, within what sampling makes of it.
    """

    time: float
    falls: float | None
    proved: float | None


class StabilityCheck(ResultPart):
    """One of the paper's stability proofs checked along trials, see :mod:`msrr_bullet.studies.stability`.

    Attributes:
        equation: Number of the equation.
        setting: Name of the setting.
        description: Its description.
        trials: Number of trials.
        conditions: Shares by condition; the conditions may hold at the same time.
    """

    equation: int
    setting: str
    description: str
    trials: int
    conditions: dict[str, ConditionShare]


class Reproduction(ResultPart):
    """All results of a reproduction.

    Attributes:
        versions: Versions of the packages that ran it.
        seeds: First seed and one beyond the last, by plant.
        tables: Controllers compared with the paper, by phase, plant and setting.
        panels: One trial of each phase over time.
        figure6: C1 and C2 over each other, on each plant.
        checks: The paper's stability proofs along trials.
        maps: Docking success over gain and delay, without and with compensation.
        ablations: C1 without each of its parts.
        seconds: Computing time of each part [s].
    """

    versions: dict[str, str]
    seeds: dict[str, tuple[int, int]]
    tables: tuple[Table, ...] = ()
    panels: tuple[Panels, ...] = ()
    figure6: tuple[Figure6, ...] = ()
    checks: tuple[StabilityCheck, ...] = ()
    maps: tuple[GainDelayMap, ...] = ()
    ablations: tuple[Ablations, ...] = ()
    seconds: dict[str, float] = Field(default_factory=dict)

    def to_json(self) -> str:
        """Return the results as JSON."""
        return self.model_dump_json(indent=1) + "\n"

    def table(self, phase: PhaseName, plant: str, setting: str) -> Table | None:
        """Return one of the tables; None if it was not made."""
        wanted = (phase, plant, setting)
        return next((t for t in self.tables if (t.phase, t.plant, t.setting) == wanted), None)


def rate_of(flags: NDArray[np.bool_]) -> Rate:
    """Return the share of true flags with its interval."""
    return wilson(int(flags.sum()), int(flags.size))


def rates_of(**flags: NDArray[np.bool_]) -> dict[str, Any]:
    """Return the fields of a row that flags by trial determine: each flag's rate, and ``flags``."""
    digits = {name: "".join("01"[int(flag)] for flag in values) for name, values in flags.items()}
    return {**{name: rate_of(values) for name, values in flags.items()}, "flags": digits}


def count_within_paper(values_by_key: Mapping[str, Iterable[float] | Array]) -> dict[str, Count]:
    """Count by key the values that meet the paper's value of its own law; NaN is a trial without a value.

    A path that met no obstacle has neither amplitude nor recovery, and does not count there. A trial that
    lacks any other measure does not meet it.
    """
    counts = {}
    for key, values in values_by_key.items():
        bound = measure(key).paper_c1
        if bound is not None:
            counted = [v for v in values if not (math.isnan(v) and key in OBSTACLE_MEASURES)]
            counts[key] = Count(n=sum(v <= bound for v in counted), of=len(counted))
    return counts
