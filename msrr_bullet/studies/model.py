"""The results of a reproduction: the JSON from which report and figures are made."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, BeforeValidator, ConfigDict

from msrr_bullet.statistics import Quantiles, Rate, quantiles, wilson
from msrr_bullet.studies.measures import PhaseName, measure
from msrr_scenes.arrays import Array


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", ser_json_inf_nan="strings")


class Measured(_Part):
    """One measure over many trials, in SI; trials that do not have the measure are left out.

    Attributes:
        values: Value of every trial that has one. The time to something that never happened is infinite.
        quantiles: Median, 95th percentile and largest of all these values.
        count: Number of trials that have a value.
        never: Number of these values that are infinite.
    """

    values: tuple[float, ...]
    quantiles: Quantiles
    count: int
    never: int = 0

    @classmethod
    def of(cls, values: Iterable[float] | Array) -> Measured:
        """Collect values, rounded to the micrometre; NaN stands for a trial without a value."""
        kept = tuple(round(float(v), 6) for v in values if not math.isnan(v))
        never = sum(math.isinf(v) for v in kept)
        return cls(values=kept, quantiles=quantiles(kept), count=len(kept), never=never)


class Count(_Part):
    """A number ``n`` of trials out of a number ``of`` of trials."""

    n: int
    of: int


class Row(_Part):
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
        measures: Measures by key, see :mod:`msrr_bullet.studies.measures`.
        outcomes: Number of trials by the judge's verdict, where there is a judge.
        met: By key, the number of trials that meet the paper's value of its own law, out of those that have
            the measure.
        within_paper: Number of trials that ended well and meet every value of the paper.
    """

    controller: str
    label: str
    trials: int
    success: Rate
    in_view: Rate | None = None
    in_cone: Rate | None = None
    measures: dict[str, Measured]
    outcomes: dict[str, int] = {}
    met: dict[str, Count] = {}
    within_paper: int | None = None


class Table(_Part):
    """Several controllers in one setting."""

    phase: PhaseName
    plant: str
    setting: str
    description: str
    rows: tuple[Row, ...]


def _rounded(values: Any) -> Any:
    """Turn an array into nested lists, rounded to the micrometre; leave anything else as it is."""
    return np.round(values, 6).tolist() if isinstance(values, np.ndarray) else values


_Scalars = Annotated[tuple[float, ...], BeforeValidator(_rounded)]
_Pairs = Annotated[tuple[tuple[float, float], ...], BeforeValidator(_rounded)]
_Triples = Annotated[tuple[tuple[float, float, float], ...], BeforeValidator(_rounded)]


class Series(_Part):
    """One trial over time, for the six panels; SI, in the frame of the phase's reference.

    Every series may be given as an array of shape (T,), (T, 2) or (T, 3), and is rounded to the micrometre.

    Attributes:
        time: Time [s].
        tip: Controlled point (x, y).
        reference: Point (x, y) that the controlled point follows.
        error: Difference (x, y, yaw) from the reference, in the frame of the phase.
        command: Commanded speeds (v, w).
        twist: Speeds (v, w) behind the drive's limits.
        angles: The two edge angles (close phase), or nothing.
        distance: Distance from the body to the centre of the obstacle (long phase), or nothing.
        auxiliary: States that only this law has, by name, each with two axes.
        obstacle: Centre (x, y) and radius of the obstacle, if there is one.
        limits: Largest v and w.
    """

    time: _Scalars
    tip: _Pairs
    reference: _Pairs
    error: _Triples
    command: _Pairs
    twist: _Pairs
    angles: _Pairs = ()
    distance: _Scalars = ()
    auxiliary: dict[str, _Pairs] = {}
    obstacle: tuple[float, float, float] | None = None
    limits: tuple[float, float]


class Panels(_Part):
    """The series of one phase, by the controller's label."""

    phase: PhaseName
    setting: str
    series: dict[str, Series]


class MapCell(_Part):
    """One controller at one gain and one delay."""

    success: float
    final_p50_m: float | None


class GainDelayMap(_Part):
    """Docking success over gain and delay.

    Attributes:
        compensated: Whether the estimator compensates for the delay.
        gains: Gain k_n of both controllers [1/s].
        latencies: Latency from exposure to use [s].
        lag: Time constant 1 / kappa of the drive [s]; the total delay is latency plus lag.
        extra_gain: Gain that the boundary layer of C2 adds to k_n [1/s].
        trials: Number of trials in each cell.
        cells: Cells by controller, one row for each gain, one column for each latency.
        paper_cell: The (gain, latency) at which the medians of the final error come nearest to the paper's.
    """

    compensated: bool
    gains: tuple[float, ...]
    latencies: tuple[float, ...]
    lag: float
    extra_gain: float
    trials: int
    cells: dict[Literal["c1", "c2"], tuple[tuple[MapCell, ...], ...]]
    paper_cell: tuple[float, float]


class Ablations(_Part):
    """C1 with one of its parts switched off, in several settings."""

    phase: PhaseName
    tables: tuple[Table, ...]


class Reproduction(_Part):
    """All results of a reproduction.

    Attributes:
        versions: Versions of the packages that ran it.
        seeds: First seed and one beyond the last, by plant.
        tables: Controllers compared with the paper, by phase, plant and setting.
        panels: One trial of each phase over time.
        maps: Docking success over gain and delay, without and with compensation.
        ablations: C1 without each of its parts.
        seconds: Computing time of each part [s].
    """

    versions: dict[str, str]
    seeds: dict[str, tuple[int, int]]
    tables: tuple[Table, ...] = ()
    panels: tuple[Panels, ...] = ()
    maps: tuple[GainDelayMap, ...] = ()
    ablations: tuple[Ablations, ...] = ()
    seconds: dict[str, float] = {}

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


def count_within_paper(values_by_key: Mapping[str, Iterable[float] | Array]) -> dict[str, Count]:
    """Count by key the values that meet the paper's value of its own law; NaN is a trial without a value."""
    counts = {}
    for key, values in values_by_key.items():
        bound = measure(key).paper_c1
        if bound is not None:
            known = [v for v in values if not math.isnan(v)]
            counts[key] = Count(n=sum(v <= bound for v in known), of=len(known))
    return counts
