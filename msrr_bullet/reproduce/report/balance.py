"""What speaks for C1 and what speaks against it; every line is found in the results, none is picked."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from msrr_bullet.reproduce.report.comparisons import compare, largest, untold
from msrr_bullet.reproduce.report.gain_delay_findings import count_cells, region
from msrr_bullet.studies.gain_delay import C1, C1_WITHOUT
from msrr_bullet.studies.labels import C2
from msrr_bullet.studies.measures import PHASES
from msrr_bullet.studies.model import GainDelayMap, Reproduction, Table


@dataclass(frozen=True, slots=True)
class Balance:
    """C1 beside one other controller, or beside itself without one of its parts.

    Attributes:
        other: What C1 is compared with.
        where: Plant and phase, or the map.
        better: Figures in which C1 is better beyond chance, each where it is so most, in words.
        worse: Figures in which C1 is worse, likewise.
        untold: Figures that have too few trials to tell.
    """

    other: str
    where: str
    better: list[str]
    worse: list[str]
    untold: list[str] = field(default_factory=list)


def balances(results: Reproduction) -> list[Balance]:
    """Compare C1 with every other controller, with itself without each part, and on the maps."""
    found = []
    for plant in ("unicycle", "bullet"):
        for phase in PHASES:
            tables = [t for t in results.tables if (t.plant, t.phase) == (plant, phase)]
            found += _against_each(tables, f"{plant}, {phase} phase")
    for ablations in results.ablations:
        found += _against_each(ablations.tables, f"unicycle, {ablations.phase} phase, ablations")
    for chart in results.maps:
        found += [_on_the_map(chart, other) for other in (C2, C1_WITHOUT)]
    return found


def _against_each(tables: Iterable[Table], where: str) -> list[Balance]:
    tables = list(tables)
    labels = dict.fromkeys(row.label for table in tables for row in table.rows)
    found = []
    for other in labels:
        if other == C1 or other.endswith(", tuned"):
            continue
        changes = compare(tables, other, C1)
        if changes:
            name = f"C1 {other}" if other.startswith("without") else other
            better, worse = largest(changes, 1.0), largest(changes, -1.0)
            found.append(Balance(name, where, better, worse, untold(changes)))
    return found


def _on_the_map(chart: GainDelayMap, other: str) -> Balance:
    cells = len(chart.gains) * len(chart.latencies)
    alone, _, other_alone = count_cells(chart, C1, other)
    how = "with" if chart.compensated else "without"
    better = f"docks in {alone} of {cells} cells in which the other does not"
    worse = f"does not dock in {other_alone} of {cells} cells in which the other does"
    if alone:
        better += f": {region(chart, C1, other, (True, False))}"
    if other_alone:
        worse += f": {region(chart, C1, other, (False, True))}"
    return Balance(other, f"unicycle, map {how} delay compensation", [better], [worse])
