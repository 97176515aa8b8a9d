"""The map of docking success over gain and delay, on which C1 and C2 differ."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from msrr_bullet.studies.docking_studies import captured, run_docking, with_paper_trajectory
from msrr_bullet.studies.labels import C2, label_of
from msrr_bullet.studies.measures import measure
from msrr_bullet.studies.model import GainDelayMap, MapCell
from msrr_bullet.studies.settings import STANDARD, Setting
from msrr_control.feedback.sliding import SlidingGains
from msrr_scenes.specs.spec import Choice

GAINS = (0.8, 1.2, 1.8, 2.5, 3.5, 4.5, 6.0, 8.0, 11.0)
LATENCIES = (0.0, 0.02, 0.04, 0.06, 0.08, 0.10, 0.13, 0.16, 0.20)

C1 = label_of("c1")

#: Gain [1/s] and latency [s] of the cell whose final errors are most like the paper's in the shipped results,
#: for a reproduction that makes no map; see ``GainDelayMap.paper_cell``.
PAPER_LIKE = (8.0, 0.06)

#: C1 and C2, and each with the other's treatment of the drive's limits: registered name and parameters by
#: label. The latter two show what the contrast of the first two comes from.
LAWS: dict[str, tuple[str, dict[str, Any]]] = {
    C1: ("c1", {}),
    C2: ("c2", {}),
    "C1 without anti-windup": ("c1", {"anti_windup": False}),
    f"{C2} with anti-windup": ("c2", {"anti_windup": True}),
}
C1_WITHOUT, C2_WITH = tuple(LAWS)[2:]

#: Law, gain [1/s], latency [s], whether the estimator compensates for the delay, and the seeds.
CellJob = tuple[str, float, float, bool, range]


def law_at(label: str, gain: float) -> Choice:
    """Return one of the laws of the map at a gain k_n [1/s]."""
    name, params = LAWS[label]
    key = "k_n_per_s" if name == "c1" else "k_per_s"
    return Choice(name=name, params={**params, "feedback": {key: gain}})


def delayed(latency: float, compensated: bool) -> Setting:
    """Return the setting of a cell: the standard one at another latency [s]."""
    update = {"delay_s": latency, "compensated": compensated}
    return Setting("map", disturbance=STANDARD.disturbance.model_copy(update=update))


def map_cell(job: CellJob) -> MapCell:
    """Study one controller at one gain and one delay."""
    label, gain, latency, compensated, seeds = job
    controller, setting = with_paper_trajectory(law_at(label, gain)), delayed(latency, compensated)
    result = run_docking(controller, setting, seeds, duration_s=8.5)
    final = float(np.median(result.final_error()))
    return MapCell(success=float(captured(result).mean()), final_p50_m=round(final, 6))


def gain_delay_map(
    compensated: bool,
    seeds: range,
    mapper: Callable[[Callable[[CellJob], MapCell], Iterable[CellJob]], Iterable[MapCell]],
    gains: tuple[float, ...] = GAINS,
    latencies: tuple[float, ...] = LATENCIES,
) -> GainDelayMap:
    """Study C1, C2 and what lies between them over gains and delays.

    Args:
        compensated: Whether the estimator compensates for the delay.
        seeds: Seeds of the trials of every cell.
        mapper: Runs the cells in order, as the built-in ``map`` or that of an executor does.
        gains: Gain k_n of all controllers [1/s]; all other parameters keep their defaults.
        latencies: Latency from exposure to use [s].
    """
    jobs = [(law, g, t, compensated, seeds) for law in LAWS for g in gains for t in latencies]
    results = iter(list(mapper(map_cell, jobs)))
    cells = {law: tuple(tuple(next(results) for _ in latencies) for _ in gains) for law in LAWS}
    return GainDelayMap(
        compensated=compensated,
        gains=gains,
        latencies=latencies,
        lag=1.0 / STANDARD.scene.limits.kappa_per_s,
        extra_gain=SlidingGains().slope_per_s - SlidingGains().k_per_s,
        trials=len(seeds),
        cells=cells,
        paper_cell=_nearest_to_paper(cells, gains, latencies),
    )


def _nearest_to_paper(
    cells: dict[str, tuple[tuple[MapCell, ...], ...]], gains: tuple[float, ...], latencies: tuple[float, ...]
) -> tuple[float, float]:
    """Return the (gain, latency) at which both medians of the final error are nearest to the paper's."""
    final = measure("final")

    def squared_log_ratios(indices: tuple[int, int]) -> float:
        i, j = indices
        total = 0.0
        for cell, paper in ((cells[C1][i][j], final.paper_c1), (cells[C2][i][j], final.paper_c2)):
            total += math.log(cell.final_p50_m / (paper or math.nan)) ** 2
        return total

    i, j = min(np.ndindex(len(gains), len(latencies)), key=squared_log_ratios)
    return gains[i], latencies[j]
