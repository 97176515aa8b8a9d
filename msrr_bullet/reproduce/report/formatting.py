"""Rates and measures as they are written everywhere in the report."""

from __future__ import annotations

import math

from msrr_bullet.statistics import Rate
from msrr_bullet.studies.measures import Measure
from msrr_bullet.studies.model import Row


def format_rate(rate: Rate) -> str:
    """Return a rate with its interval."""
    return f"{100 * rate.rate:.1f} % ({100 * rate.low:.1f} .. {100 * rate.high:.1f})"


def format_value(value: float, measure: Measure) -> str:
    """Return a value in the unit of the measure, without the unit; an infinite value is ``never``."""
    return "never" if math.isinf(value) else f"{measure.scale * value:.3g}"


def format_quantiles(row: Row, measure: Measure) -> str:
    """Return median / 95th percentile of one measure.

    The number of trials that have the measure is added if it is not that of all trials, and the number of
    trials in which the timed event never happened if there are any.
    """
    measured = row.measures.get(measure.key)
    if measured is None or measured.quantiles.p50 is None or measured.quantiles.p95 is None:
        return "-"
    p50, p95 = (format_value(q, measure) for q in (measured.quantiles.p50, measured.quantiles.p95))
    notes = [f"n = {measured.count}"] if measured.count != row.trials else []
    notes += [f"{measured.never} never"] if measured.never else []
    return f"{p50} / {p95} ({', '.join(notes)})" if notes else f"{p50} / {p95}"
