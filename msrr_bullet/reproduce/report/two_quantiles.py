"""A measure of a row as it is shown everywhere: median / 95th percentile."""

from __future__ import annotations

import math

from msrr_bullet.studies.measures import Measure
from msrr_bullet.studies.model import Row


def two_quantiles(row: Row, what: Measure) -> str:
    """Return median and 95th percentile.

    Behind it how many trials they are of if not of all, and how many of these never came to it.
    """
    measured = row.measures.get(what.key)
    if measured is None or measured.quantiles.p50 is None or measured.quantiles.p95 is None:
        return "-"
    text = f"{shown(measured.quantiles.p50, what)} / {shown(measured.quantiles.p95, what)}"
    notes = [f"n = {measured.count}"] if measured.count != row.trials else []
    notes += [f"{measured.never} never"] if measured.never else []
    return f"{text} ({', '.join(notes)})" if notes else text


def shown(value: float, what: Measure) -> str:
    """Return a value in the measure's unit, without its name; what is infinite never came."""
    return "never" if math.isinf(value) else f"{what.scale * value:.3g}"
