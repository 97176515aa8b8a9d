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
    if math.isinf(value):
        return "never"
    shown = measure.scale * value
    return f"{shown:.3g}" if abs(shown) < 999.5 else f"{shown:.0f}"


def format_quantiles(row: Row, measure: Measure) -> str:
    """Return median / 95th percentile of one measure; minimum / 5th percentile where more is better.

    The number of trials that have the measure is added if it is not that of all trials, and the number of
    trials in which the timed event never happened if there are any.
    """
    measured = row.measures.get(measure.key)
    if measured is None:
        return "-"
    shown = (measured.quantiles.p50, measured.quantiles.p95)
    if measure.more_is_better:
        shown = (measured.min, measured.p05)
    first, second = (None if q is None else format_value(q, measure) for q in shown)
    if first is None or second is None:
        return "-"
    notes = [f"n = {measured.count}"] if measured.count != row.trials else []
    notes += [f"{measured.never} never"] if measured.never else []
    return f"{first} / {second} ({', '.join(notes)})" if notes else f"{first} / {second}"
