"""The findings of a reproduction in words; every number is read from the results."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from msrr_bullet.reproduce.report.formatting import format_quantiles, format_rate, format_value
from msrr_bullet.reproduce.report.gain_delay_findings import count_cells
from msrr_bullet.statistics import wilson
from msrr_bullet.studies.gain_delay import C1
from msrr_bullet.studies.labels import C2
from msrr_bullet.studies.measures import MEASURES, PHASES, measure
from msrr_bullet.studies.model import Reproduction, Row, Table


@dataclass(frozen=True, slots=True)
class Requirement:
    """A requirement on this project, the result, and whether the result meets it."""

    text: str
    result: str
    met: bool


def requirements(results: Reproduction) -> list[Requirement]:
    """Return every requirement that the available tables can answer."""
    answered: list[Requirement] = []
    for phase in PHASES:
        table = results.table(phase, "unicycle", "standard")
        row = _row(table, "C1")
        if table is None or row is None:
            continue
        for figure in MEASURES[phase]:
            q = row.measures[figure.key].quantiles if figure.key in row.measures else None
            if figure.target_p50 is None or figure.target_p95 is None or q is None:
                continue
            p50, p95 = (float("inf") if v is None else v for v in (q.p50, q.p95))
            targets = " / ".join(format_value(v, figure) for v in (figure.target_p50, figure.target_p95))
            answered.append(
                Requirement(
                    f"C1, unicycle, {table.description}: {figure.label} at most {targets} {figure.unit}",
                    f"{format_value(p50, figure)} / {format_value(p95, figure)} {figure.unit}",
                    p50 <= figure.target_p50 and p95 <= figure.target_p95,
                )
            )
    return answered + _map_requirements(results) + _loop_requirements(results)


def _map_requirements(results: Reproduction) -> list[Requirement]:
    maps = [m for m in results.maps if not m.compensated]
    if not maps:
        return []
    c1_alone, both, _ = count_cells(maps[0], C1, C2)
    return [
        Requirement(
            f"the map over gain and delay has a region where C1 docks and {C2} does not, and one where both"
            " do",
            f"{c1_alone} cells of C1 alone, {both} of both",
            c1_alone > 0 and both > 0,
        )
    ]


def _loop_requirements(results: Reproduction) -> list[Requirement]:
    answered = []
    tables = [results.table(phase, "bullet", "whole mission") for phase in PHASES]
    rows = {label: [r for r in (_row(t, label) for t in tables) if r is not None] for label in (C1, C2)}
    if rows[C1]:
        c1 = rows[C1][0]
        answered.append(
            Requirement(
                "C1, whole mission, bullet and images: docked and every figure of the paper met in 95 %",
                "; ".join(f"{label}: {_within_paper(found)}" for label, found in rows.items() if found),
                (c1.within_paper or 0) >= 0.95 * c1.trials,
            )
        )
    cbf = _row(results.table("close", "bullet", "hard starts"), "CBF")
    if cbf is not None and cbf.in_view is not None:
        answered.append(
            Requirement(
                "CBF, hard starts, bullet and images: target kept in view in all, docked in 97 %",
                f"{format_rate(cbf.success)} docked, {format_rate(cbf.in_view)} in view",
                cbf.in_view.rate == 1.0 and cbf.success.rate >= 0.97,
            )
        )
    return answered


def _within_paper(rows: Sequence[Row]) -> str:
    """Return how many trials meet every figure of the paper, and how many meet each of them."""
    rate = wilson(rows[0].within_paper or 0, rows[0].trials)
    each = ", ".join(
        f"{measure(key).label} {count.n} of {count.of}" for row in rows for key, count in row.met.items()
    )
    return f"{rows[0].within_paper} of {rows[0].trials} ({format_rate(rate)}): {each}"


def _row(table: Table | None, label: str) -> Row | None:
    return None if table is None else table.row(label)


def lag_text(results: Reproduction) -> list[str]:
    """Compare the distances to the desired point and to the path for every law, a paragraph per plant."""
    tables = (
        results.table("long", "unicycle", "standard"),
        results.table("long", "bullet", "whole mission"),
    )
    return [_lag_paragraph(table) for table in tables if table is not None]


def _lag_paragraph(table: Table) -> str:
    laws = []
    for row in table.rows:
        figures = []
        for key in ("amplitude", "recovery"):
            to_point, to_path = measure(key), measure(f"{key}_path")
            figures.append(
                f"{key} {format_quantiles(row, to_point)} {to_point.unit} to the desired point and"
                f" {format_quantiles(row, to_path)} {to_path.unit} to the path"
            )
        laws.append(f"{row.label}: {', '.join(figures)}")
    return (
        "At the obstacle the distance to the desired point includes lag along the path, that to the path"
        f" does not ({table.plant}; {table.description}). {'; '.join(laws)}."
    )
