"""The studies of a reproduction on ideal unicycles, spread over processes."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import Executor
from typing import TypeVar

from msrr_bullet.reproduce.figure6 import unicycle_figure6
from msrr_bullet.run_folder import ProgressListener
from msrr_bullet.studies.ablations import RowJob, ablation_jobs
from msrr_bullet.studies.docking_studies import docking_series
from msrr_bullet.studies.gain_delay import GAINS, LATENCIES, gain_delay_map
from msrr_bullet.studies.measures import PHASES, PhaseName
from msrr_bullet.studies.model import Ablations, Reproduction, Row, Table
from msrr_bullet.studies.path_following_studies import path_following_series
from msrr_bullet.studies.series import Panels, Series
from msrr_bullet.studies.settings import (
    HARD,
    IDEAL,
    STANDARD,
    UNCOMPENSATED,
    WIDE,
    WIDE_UNCOMPENSATED,
    Setting,
)
from msrr_bullet.studies.stability import SETTINGS as STABILITY_SETTINGS
from msrr_bullet.studies.stability import stability_checks
from msrr_bullet.trial.versions import package_versions
from msrr_scenes.specs.spec import Choice

T = TypeVar("T")
R = TypeVar("R")

#: Settings of the tables.
TABLES = (STANDARD, IDEAL, UNCOMPENSATED, HARD, WIDE, WIDE_UNCOMPENSATED)

#: Settings of the close phase alone: it is their starts that differ.
_CLOSE_ALONE = (WIDE, WIDE_UNCOMPENSATED)

#: Number of trials in each cell of the map, enough to distinguish docking from not docking.
MAP_TRIALS = 40

#: Number of trials along which the stability proofs are checked.
CHECK_TRIALS = 100

#: Controllers by phase and label, in the order in which they are shown.
Contenders = Mapping[PhaseName, Mapping[str, Choice]]


def reproduce_unicycle(
    seeds: range,
    contenders: Contenders,
    pool: Executor | None = None,
    on_progress: ProgressListener = lambda text: None,
) -> Reproduction:
    """Run the studies.

    Without a pool they run in this process. ``on_progress`` is called with the name of each before it starts.
    """
    seconds: dict[str, float] = {}

    def run_all(function: Callable[[T], R], jobs: Iterable[T]) -> Iterator[R]:
        return pool.map(function, jobs) if pool is not None else map(function, jobs)

    began = time.perf_counter()

    def record_time(name: str) -> None:
        nonlocal began
        now = time.perf_counter()
        seconds[name], began = round(now - began, 2), now

    on_progress("controllers compared with the paper")
    jobs = [
        RowJob(phase, choice, label, setting, seeds)
        for phase, choices in contenders.items()
        for setting in TABLES
        if not (phase == "long" and setting in _CLOSE_ALONE)
        for label, choice in choices.items()
    ]
    tables = _tables(jobs, list(run_all(RowJob.run, jobs)))
    record_time("tables")
    on_progress("one trial over time")
    panel_jobs = [
        (phase, choice, seeds.start) for phase, choices in contenders.items() for choice in choices.values()
    ]
    series = iter(list(run_all(panel_series, panel_jobs)))
    panels = tuple(
        Panels(
            phase=phase,
            setting=STANDARD.description(phase),
            series={label: next(series) for label in choices},
        )
        for phase, choices in contenders.items()
    )
    record_time("panels")
    on_progress("the paper's stability proofs")
    check_jobs = [(setting, seeds[:CHECK_TRIALS]) for setting in STABILITY_SETTINGS]
    checks = tuple(check for found in run_all(stability_checks, check_jobs) for check in found)
    record_time("stability")
    on_progress("ablations")
    jobs = ablation_jobs(seeds)
    ablation_tables = _tables(jobs, list(run_all(RowJob.run, jobs)))
    ablations = tuple(
        Ablations(phase=phase, tables=tuple(t for t in ablation_tables if t.phase == phase))
        for phase in PHASES
    )
    record_time("ablations")
    maps = []
    map_seeds = seeds[:MAP_TRIALS]
    for compensated in (False, True):
        how = "with" if compensated else "without"
        on_progress(f"the map over gain and delay, {how} compensation")
        # With compensation there is little to see, and every second row and column shows it.
        stride = 2 if compensated else 1
        maps.append(gain_delay_map(compensated, map_seeds, run_all, GAINS[::stride], LATENCIES[::stride]))
        record_time(f"map, {how} compensation")
    on_progress("the paper's Fig. 6")
    figure6 = unicycle_figure6(seeds.start, maps[0].paper_cell)  # of the map without compensation
    record_time("Fig. 6")
    return Reproduction(
        versions=package_versions(),
        seeds={"unicycle": (seeds.start, seeds.stop)},
        tables=tables,
        panels=panels,
        figure6=(figure6,),
        checks=checks,
        maps=tuple(maps),
        ablations=ablations,
        seconds=seconds,
    )


def panel_series(job: tuple[PhaseName, Choice, int]) -> Series:
    """Run one trial of a controller under the standard setting."""
    phase, choice, seed = job
    return (path_following_series if phase == "long" else docking_series)(choice, STANDARD, seed)


def _tables(jobs: Iterable[RowJob], rows: Iterable[Row]) -> tuple[Table, ...]:
    """Group the rows of jobs into a table for each phase and setting, in the order of the jobs."""
    groups: dict[tuple[PhaseName, str], list[Row]] = {}
    settings: dict[str, Setting] = {}
    for job, row in zip(jobs, rows, strict=True):
        settings[job.setting.name] = job.setting
        groups.setdefault((job.phase, job.setting.name), []).append(row)
    return tuple(
        Table(
            phase=phase,
            plant="unicycle",
            setting=name,
            description=settings[name].description(phase),
            rows=tuple(group),
        )
        for (phase, name), group in groups.items()
    )
