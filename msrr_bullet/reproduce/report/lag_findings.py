"""What of amplitude and recovery is lag along the path: in words, every number read from the findings."""

from __future__ import annotations

from msrr_bullet.reproduce.report.two_quantiles import two_quantiles
from msrr_bullet.studies.measures import measure
from msrr_bullet.studies.model import Reproduction, Table


def lag_text(found: Reproduction) -> list[str]:
    """Set the distance to the desired point beside that to the path for every law, a paragraph per plant."""
    tables = (
        found.table("long", "unicycle", "standard"),
        found.table("long", "bullet", "whole mission"),
    )
    return [_said(table) for table in tables if table is not None]


def _said(table: Table) -> str:
    laws = []
    for row in table.rows:
        kinds = []
        for key in ("amplitude", "recovery"):
            to_point, to_path = measure(key), measure(f"{key}_path")
            kinds.append(
                f"{key} {two_quantiles(row, to_point)} {to_point.unit} to the desired point and"
                f" {two_quantiles(row, to_path)} {to_path.unit} to the path"
            )
        laws.append(f"{row.label}: {', '.join(kinds)}")
    return (
        f"What of the figures at the obstacle is lag behind the desired point, and what is distance from the"
        f" path ({table.plant}; {table.description}). {'; '.join(laws)}."
    )
