"""What a reproduction found: the JSON from which report and figures are made."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict

from msrr_bullet.statistics import Rate, wilson
from msrr_bullet.studies.measures import PhaseName, measure
from msrr_bullet.studies.open_quantiles import OpenQuantiles
from msrr_scenes.arrays import Array


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", ser_json_inf_nan="strings")


class Measured(_Part):
    """One measure over many trials, in SI; trials that do not have it are left out.

    Attributes:
        values: Of every trial that has one; infinite is a time to something that never came.
        quantiles: Median, 95th percentile, largest, of all these.
        count: How many trials have one.
        never: How many of these are infinite.
    """

    values: tuple[float, ...]
    quantiles: OpenQuantiles
    count: int
    never: int = 0

    @classmethod
    def of(cls, values: Iterable[float] | Array) -> Measured:
        """Collect them, to the micrometre; NaN is a trial without one."""
        kept = tuple(round(float(v), 6) for v in values if not math.isnan(v))
        return cls(
            values=kept,
            quantiles=OpenQuantiles.of(kept),
            count=len(kept),
            never=sum(math.isinf(v) for v in kept),
        )


class Count(_Part):
    """So many of so many trials."""

    n: int
    of: int


class Row(_Part):
    """One controller in one setting.

    Attributes:
        controller: Its registered name.
        label: Its name in tables and figures.
        trials: How many.
        success: Share that ended well: inside the mechanism's capture at the face (close), clear of the
            obstacle (long), docked by the judge's verdict (bullet).
        in_view: Share whose camera had the target, both edges of it, in its field of view in every approach,
            from the hand-over to the contact, by truth; None where that means nothing.
        in_cone: Share that kept both edges within the outer bound of the line of sight, which is narrower.
        measures: By key, see :mod:`msrr_bullet.studies.measures`.
        outcomes: The judge's verdicts, where there is a judge.
        met: Trials that meet the paper's figure of its own law, of those that have the measure, by key.
        within_paper: Trials that ended well and meet every figure of the paper.
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
    """Controllers beside each other in one setting."""

    phase: PhaseName
    plant: str
    setting: str
    description: str
    rows: tuple[Row, ...]


class Series(_Part):
    """One trial over time, for the six panels; SI, world of the phase's reference.

    Attributes:
        time: [s].
        tip: Controlled point (x, y).
        reference: What it follows.
        error: (x, y, yaw) against that, in the frame of the phase.
        command: (v, w) asked for.
        twist: (v, w) behind the limits.
        angles: The two edge angles (close), or nothing.
        distance: From the body to the obstacle's middle (long), or nothing.
        auxiliary: States that only this law has, by name, each of two axes.
        obstacle: Its middle and radius, if there is one.
        limits: Largest v and w.
    """

    time: tuple[float, ...]
    tip: tuple[tuple[float, float], ...]
    reference: tuple[tuple[float, float], ...]
    error: tuple[tuple[float, float, float], ...]
    command: tuple[tuple[float, float], ...]
    twist: tuple[tuple[float, float], ...]
    angles: tuple[tuple[float, float], ...] = ()
    distance: tuple[float, ...] = ()
    auxiliary: dict[str, tuple[tuple[float, float], ...]] = {}
    obstacle: tuple[float, float, float] | None = None
    limits: tuple[float, float]


class Panels(_Part):
    """The series of one phase, by the controller's label."""

    phase: PhaseName
    setting: str
    series: dict[str, Series]


class MapCell(_Part):
    """One gain and one delay under one controller."""

    success: float
    final_p50_m: float | None


class GainDelayMap(_Part):
    """Docking success over gain and delay.

    Attributes:
        compensated: Whether the estimator makes up for the delay.
        gains: k_n of both controllers [1/s].
        latencies: From exposure to use [s].
        lag: 1 / kappa of the drive [s]; with the latency it makes the total delay.
        extra_gain: What the boundary layer of C2 adds to k_n [1/s].
        trials: Per cell.
        cells: By controller, one row for each gain, one column for each latency.
        paper_cell: (gain, latency) whose medians of the final error come nearest to the paper's two.
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
    """C1 without one of its parts, in several settings."""

    phase: PhaseName
    tables: tuple[Table, ...]


class Reproduction(_Part):
    """Everything that was found.

    Attributes:
        versions: Packages that ran it.
        seeds: First and one beyond the last.
        tables: Controllers beside the paper, by phase, plant and setting.
        panels: One trial of each phase over time.
        maps: Over gain and delay, without and with compensation.
        ablations: What each part of C1 is worth.
        seconds: How long each part took.
    """

    versions: dict[str, str]
    seeds: dict[str, tuple[int, int]]
    tables: tuple[Table, ...] = ()
    panels: tuple[Panels, ...] = ()
    maps: tuple[GainDelayMap, ...] = ()
    ablations: tuple[Ablations, ...] = ()
    seconds: dict[str, float] = {}

    def to_json(self) -> str:
        """Return it as JSON."""
        return self.model_dump_json(indent=1) + "\n"

    def table(self, phase: PhaseName, plant: str, setting: str) -> Table | None:
        """Return one of the tables, if it was made."""
        wanted = (phase, plant, setting)
        return next((t for t in self.tables if (t.phase, t.plant, t.setting) == wanted), None)


def rate_of(flags: NDArray[np.bool_]) -> Rate:
    """Return the share of true flags with its interval."""
    return wilson(int(flags.sum()), int(flags.size))


def met_of(values: Mapping[str, Iterable[float] | Array]) -> dict[str, Count]:
    """Count which values meet the paper's figure of its own law, by key; NaN is a trial without a value."""
    counts = {}
    for key, found in values.items():
        most = measure(key).paper_c1
        if most is not None:
            kept = [v for v in found if not math.isnan(v)]
            counts[key] = Count(n=sum(v <= most for v in kept), of=len(kept))
    return counts
