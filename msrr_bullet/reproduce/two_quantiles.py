"""A measure of a row as it is shown everywhere: median / 95th percentile."""

from __future__ import annotations

from msrr_bullet.reproduce.measures import Measure
from msrr_bullet.reproduce.model import Row


def two_quantiles(row: Row, what: Measure) -> str:
    """Return median and 95th percentile, and how many trials they are of if not of all."""
    measured = row.measures.get(what.key)
    if measured is None or measured.quantiles.p50 is None or measured.quantiles.p95 is None:
        return "-"
    text = f"{what.scale * measured.quantiles.p50:.3g} / {what.scale * measured.quantiles.p95:.3g}"
    return text if measured.count == row.trials else f"{text} (n = {measured.count})"
