"""The map of docking success over gain and delay: where the paper's contrast lives."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Literal, Protocol

import numpy as np

from msrr_bullet.studies.close_studies import captured, on_paper_trajectory, run_close
from msrr_bullet.studies.measures import measure
from msrr_bullet.studies.model import GainDelayMap, MapCell
from msrr_bullet.studies.settings import STANDARD, Setting
from msrr_control.feedback.sliding import SlidingGains
from msrr_scenes.specs.spec import Choice

GAINS = (0.8, 1.2, 1.8, 2.5, 3.5, 4.5, 6.0, 8.0, 11.0)
LATENCIES = (0.0, 0.02, 0.04, 0.06, 0.08, 0.10, 0.13, 0.16, 0.20)

Law = Literal["c1", "c2"]
LAWS: tuple[Law, Law] = ("c1", "c2")
Job = tuple[Law, float, float, bool, range]


class Mapper(Protocol):
    """Runs jobs in order: ``map``, or that of an executor."""

    def __call__(self, function: Callable[[Job], MapCell], jobs: Iterable[Job], /) -> Iterable[MapCell]:
        """Return what the function makes of each job."""
        ...


def map_cell(job: Job) -> MapCell:
    """Study one controller at one gain and one delay."""
    law, gain, latency, compensated, seeds = job
    key = "k_n_per_s" if law == "c1" else "k_per_s"
    controller = on_paper_trajectory(Choice(name=law, params={"feedback": {key: gain}}))
    wrong = STANDARD.disturbance.model_copy(update={"delay_s": latency, "compensated": compensated})
    result = run_close(controller, Setting("map", "", disturbance=wrong), seeds, duration=8.5)
    final = float(np.median(result.final_error()))
    return MapCell(success=float(captured(result).mean()), final_p50_m=round(final, 6))


def gain_delay_map(
    compensated: bool,
    seeds: range,
    mapper: Mapper,
    gains: tuple[float, ...] = GAINS,
    latencies: tuple[float, ...] = LATENCIES,
) -> GainDelayMap:
    """Study C1 and C2 over gains and delays.

    Args:
        compensated: Whether the estimator makes up for the delay.
        seeds: As many trials in every cell.
        mapper: Runs the cells, in order: ``map``, or that of an executor.
        gains: k_n of both [1/s]; everything else stays as it ships.
        latencies: From exposure to use [s].
    """
    jobs = [(law, g, t, compensated, seeds) for law in LAWS for g in gains for t in latencies]
    found = iter(list(mapper(map_cell, jobs)))
    cells = {law: tuple(tuple(next(found) for _ in latencies) for _ in gains) for law in LAWS}
    return GainDelayMap(
        compensated=compensated,
        gains=gains,
        latencies=latencies,
        lag=1.0 / STANDARD.limits_spec.kappa_per_s,
        extra_gain=SlidingGains().slope_per_s - SlidingGains().k_per_s,
        trials=len(seeds),
        cells=cells,
        paper_cell=_nearest_to_paper(cells, gains, latencies),
    )


def _nearest_to_paper(
    cells: dict[Law, tuple[tuple[MapCell, ...], ...]], gains: tuple[float, ...], latencies: tuple[float, ...]
) -> tuple[float, float]:
    """Return the cell whose two medians of the final error are nearest to the paper's, as ratios."""
    final = measure("final")

    def apart(i: int, j: int) -> float:
        off = 0.0
        for found, paper in ((cells["c1"][i][j], final.paper_c1), (cells["c2"][i][j], final.paper_c2)):
            off += math.log((found.final_p50_m or math.inf) / (paper or math.nan)) ** 2
        return off

    places = [(i, j) for i in range(len(gains)) for j in range(len(latencies))]
    i, j = min(places, key=lambda at: apart(*at))
    return gains[i], latencies[j]
