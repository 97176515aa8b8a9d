"""The effect of each part of C1, as estimates with intervals and in words."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Literal

import numpy as np
from scipy.stats import binom

from msrr_bullet.reproduce.report.formatting import format_value
from msrr_bullet.statistics import Rate, quantile
from msrr_bullet.studies.measures import MEASURES, PATH_FOLLOWING, Measure
from msrr_bullet.studies.model import Ablations, Measured, Row


@dataclass(frozen=True, slots=True)
class Estimate:
    """A value and its 95 % interval.

    The upper bound is infinite where there are too few trials to bound the value. All three may be infinite
    where a timed event never happened in too many trials.
    """

    value: float
    low: float
    high: float

    def is_apart_from(self, other: Estimate) -> bool:
        """Return whether the two intervals are disjoint."""
        return self.low > other.high or self.high < other.low


def estimate_rate(row: Row, name: Literal["success", "in_view", "in_cone"]) -> Estimate | None:
    """Return one of the rates of a row with its Wilson interval; None if the row does not have it."""
    rate: Rate | None = getattr(row, name)
    return Estimate(rate.rate, rate.low, rate.high) if rate is not None else None


def estimate_measure(row: Row, measure: Measure, q: float) -> Estimate | None:
    """Return a quantile of a measure of a row with its interval.

    It is None without values, and for the path following of a law that drives through the obstacle in more
    than half of the trials: such a law swings out little and recovers at once, which is no merit.
    """
    if measure in PATH_FOLLOWING and row.success.rate < 0.5:
        return None
    return estimate_quantile(row.measures[measure.key], q)


def estimate_quantile(measured: Measured, q: float) -> Estimate | None:
    """Return a quantile with its interval; None without values."""
    if not measured.values:
        return None
    return Estimate(quantile(measured.values, q), *quantile_interval(measured.values, q))


def quantile_interval(values: Sequence[float], q: float, confidence: float = 0.95) -> tuple[float, float]:
    """Return an interval for quantile ``q`` between two order statistics, valid for any distribution.

    The number of n values that lie below the true quantile is binomial (n, q).
    Source: Conover, Practical Nonparametric Statistics, section 3.2.

    Returns:
        Lower and upper bound, infinite on a side on which there are too few values.
    """
    ordered, n = np.sort(np.asarray(values, dtype=np.float64)), len(values)
    tail = 0.5 * (1.0 - confidence)
    lower, upper = int(binom.ppf(tail, n, q)), int(binom.ppf(1.0 - tail, n, q)) + 1
    return (
        float(ordered[lower - 1]) if lower >= 1 else -math.inf,
        float(ordered[upper - 1]) if upper <= n else math.inf,
    )


@dataclass(frozen=True, slots=True)
class Change:
    """One figure of C1 with and without a part, in one setting.

    Attributes:
        figure: Name of the figure.
        setting: Name of the setting.
        complete: Estimate with the part.
        without: Estimate without the part.
        loss: Amount by which the figure is worse without the part; negative if it is better, 0 if the
            intervals overlap.
        format: Writes an estimate.
    """

    figure: str
    setting: str
    complete: Estimate
    without: Estimate
    loss: float
    format: Callable[[Estimate], str]

    def __str__(self) -> str:
        """Return the change in words."""
        without, complete = self.format(self.without), self.format(self.complete)
        return f"{self.figure} {without} instead of {complete} ({self.setting})"


def changes(ablations: Ablations, variant: int) -> list[Change]:
    """Return every change that a variant, given as the index of its row, makes in every setting."""
    success = "docked" if ablations.phase == "close" else "clear of the obstacle"
    # Name, estimate of a row, text of an estimate, and whether more is better.
    figures: list[tuple[str, Callable[[Row], Estimate | None], Callable[[Estimate], str], bool]] = [
        (success, lambda row: estimate_rate(row, "success"), _format_percent, True),
        ("kept in view", lambda row: estimate_rate(row, "in_view"), _format_percent, True),
        ("kept in the cone", lambda row: estimate_rate(row, "in_cone"), _format_percent, True),
    ]
    for measure in MEASURES[ablations.phase]:
        write = partial(_format_measure, measure)
        if measure.paper_c1 is not None:
            p95 = partial(estimate_measure, measure=measure, q=0.95)
            figures.append((f"{measure.label}, 95th percentile", p95, write, False))
        elif measure.key == "clearance":
            median = partial(estimate_measure, measure=measure, q=0.5)
            figures.append((f"{measure.label}, median", median, write, True))
    found = []
    for table in ablations.tables:
        for name, estimate, format_estimate, more_is_better in figures:
            complete, without = estimate(table.rows[0]), estimate(table.rows[variant])
            if complete is None or without is None:
                continue
            loss = 0.0
            if complete.is_apart_from(without):
                loss = (complete.value - without.value) * (1.0 if more_is_better else -1.0)
            found.append(Change(name, table.setting, complete, without, loss, format_estimate))
    return found


def ablation_text(ablations: Ablations) -> list[str]:
    """Describe what C1 loses and gains without each of its parts: each figure where it changes most."""
    texts = []
    for k, variant in enumerate(ablations.tables[0].rows[1:], start=1):
        by_figure: dict[str, list[Change]] = {}
        for change in changes(ablations, k):
            by_figure.setdefault(change.figure, []).append(change)
        largest = [max(group, key=lambda c: c.loss) for group in by_figure.values()]
        smallest = [min(group, key=lambda c: c.loss) for group in by_figure.values()]
        losses = "; ".join(str(c) for c in largest if c.loss > 0.0)
        gains = "; ".join(str(c) for c in smallest if c.loss < 0.0)
        text = f"C1 {variant.label}: {losses or 'nothing is worse beyond the intervals'}."
        texts.append(text + (f" Better without it: {gains}." if gains else ""))
    return texts


def _format_percent(e: Estimate) -> str:
    return f"{100 * e.value:.1f} % ({100 * e.low:.1f} .. {100 * e.high:.1f})"


def _format_measure(measure: Measure, e: Estimate) -> str:
    value, low, high = (format_value(x, measure) for x in (e.value, e.low, e.high))
    # A bound that too few trials leave open is written as such; only an infinite value never happened.
    if math.isinf(e.high) and math.isfinite(e.value):
        high = "inf"
    unit = f" {measure.unit}" if math.isfinite(e.value) else ""
    return f"{value}{unit} ({low} .. {high})"
