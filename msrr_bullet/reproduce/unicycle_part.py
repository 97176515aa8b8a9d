"""Everything of a reproduction that ideal unicycles can tell, spread over processes."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor
from typing import TypeVar

from msrr_bullet.studies.ablations import SETTINGS, ablation_jobs, ablation_row
from msrr_bullet.studies.close_studies import close_row, close_series
from msrr_bullet.studies.gain_delay import GAINS, LATENCIES, gain_delay_map
from msrr_bullet.studies.long_studies import long_row, long_series
from msrr_bullet.studies.measures import PhaseName
from msrr_bullet.studies.model import Ablations, Panels, Reproduction, Row, Series, Table
from msrr_bullet.studies.settings import HARD, IDEAL, STANDARD, UNCOMPENSATED, WIDE, Setting
from msrr_bullet.trial.result import package_versions
from msrr_scenes.specs.spec import Choice

T = TypeVar("T")
R = TypeVar("R")

RowJob = tuple[PhaseName, Choice, str, Setting, range]

#: Settings of the tables; the last one differs only in the starts of the close phase.
TABLES = (STANDARD, IDEAL, UNCOMPENSATED, HARD, WIDE)

#: The map's cells are many; this many trials in each tell docking from not docking.
MAP_TRIALS = 40

Contenders = dict[PhaseName, dict[str, Choice]]


def reproduce_unicycle(
    seeds: range,
    contenders: Contenders,
    pool: Executor | None = None,
    tell: Callable[[str], None] | None = None,
) -> Reproduction:
    """Run the studies.

    Args:
        seeds: A trial of every study for each of them.
        contenders: Controllers by phase and label, in the order in which they are shown.
        pool: Spreads the work; without one it is done here.
        tell: Is told what is done next.
    """
    tell = tell or (lambda text: None)
    spent: dict[str, float] = {}

    def over(function: Callable[[T], R], jobs: Iterable[T]) -> Iterator[R]:
        return pool.map(function, jobs) if pool is not None else map(function, jobs)

    began = time.perf_counter()

    def lap(name: str) -> None:
        nonlocal began
        now = time.perf_counter()
        spent[name], began = round(now - began, 2), now

    tell("controllers beside the paper")
    shown = [(phase, setting) for phase in contenders for setting in TABLES]
    shown = [(p, s) for p, s in shown if not (p == "long" and s is WIDE)]
    row_jobs: list[RowJob] = [
        (phase, choice, label, setting, seeds)
        for phase, setting in shown
        for label, choice in contenders[phase].items()
    ]
    rows = iter(list(over(table_row, row_jobs)))
    tables = tuple(
        _table(phase, setting, tuple(next(rows) for _ in contenders[phase])) for phase, setting in shown
    )
    lap("tables")
    tell("one trial over time")
    panel_jobs = [
        (phase, choice, seeds.start) for phase, choices in contenders.items() for choice in choices.values()
    ]
    series = iter(list(over(panel_series, panel_jobs)))
    panels = tuple(
        Panels(phase=phase, setting=STANDARD.description, series={label: next(series) for label in choices})
        for phase, choices in contenders.items()
    )
    lap("panels")
    tell("ablations")
    jobs = ablation_jobs(seeds)
    found = list(zip(jobs, over(ablation_row, jobs), strict=True))
    phases: tuple[PhaseName, ...] = ("long", "close")
    ablations = tuple(
        Ablations(
            phase=phase,
            tables=tuple(
                _table(phase, s, tuple(r for j, r in found if j[0] == phase and j[2] is s)) for s in SETTINGS
            ),
        )
        for phase in phases
    )
    lap("ablations")
    maps = []
    few = seeds[: min(len(seeds), MAP_TRIALS)]
    for compensated in (False, True):
        tell(f"the map over gain and delay, {'with' if compensated else 'without'} compensation")
        # With compensation there is little to see, and every second row and column shows it.
        skip = 2 if compensated else 1
        maps.append(gain_delay_map(compensated, few, over, GAINS[::skip], LATENCIES[::skip]))
        lap(f"map, {'with' if compensated else 'without'} compensation")
    return Reproduction(
        versions=package_versions(),
        seeds={"unicycle": (seeds.start, seeds.stop)},
        tables=tables,
        panels=panels,
        maps=tuple(maps),
        ablations=ablations,
        seconds=spent,
    )


def table_row(job: RowJob) -> Row:
    """Study one controller in one setting."""
    phase, choice, label, setting, seeds = job
    return (long_row if phase == "long" else close_row)(choice, label, setting, seeds)


def panel_series(job: tuple[PhaseName, Choice, int]) -> Series:
    """Run one trial under the standard setting."""
    phase, choice, seed = job
    return (long_series if phase == "long" else close_series)(choice, STANDARD, seed)


def _table(phase: PhaseName, setting: Setting, rows: tuple[Row, ...]) -> Table:
    return Table(
        phase=phase, plant="unicycle", setting=setting.name, description=setting.description, rows=rows
    )
