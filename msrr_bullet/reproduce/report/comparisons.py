"""Two controllers on the same trials: each figure that differs beyond chance, in numbers and in words."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from msrr_bullet.paired import mcnemar, paired_difference
from msrr_bullet.reproduce.report.formatting import format_value
from msrr_bullet.statistics import quantile
from msrr_bullet.studies.measures import MEASURES, PATH_FOLLOWING, Measure, PhaseName
from msrr_bullet.studies.model import FlagName, Row, Table
from msrr_scenes.arrays import Array

#: Probability with which two equal controllers are told apart by one figure in one setting.
LEVEL = 0.05

#: What is said of all comparisons.
METHOD = (
    "Controllers are compared trial by trial: start and noise of a trial are the same under each. A rate"
    " counts as different by McNemar's exact test, a quantile by the 95 % interval of a paired bootstrap,"
    " which takes 40 trials or more for a 95th or 5th percentile."
    f" Each comparison of one figure in one setting has a level of {100 * LEVEL:g} %, and a figure is listed"
    " if it differs in any: of twenty without a difference in six settings three or four are listed."
)

_FLAGS: dict[FlagName, str] = {"success": "docked", "in_view": "kept in view", "in_cone": "kept in the cone"}


@dataclass(frozen=True, slots=True)
class Change:
    """One figure of a controller beside that of another, in one setting.

    Attributes:
        figure: Name of the figure.
        effect: Amount by which the other controller is better, negative if it is worse; 0 if the two cannot
            be told apart, None if there are too few trials to tell.
        text: Both figures and the evidence, in words.
    """

    figure: str
    effect: float | None
    text: str


def compare(tables: Iterable[Table], base: str, other: str) -> list[Change]:
    """Compare a controller with another one, each given by its label, in every table that has both.

    A law that drives through the obstacle in more than half of the trials has no other figures of the long
    phase: it swings out little and recovers at once, which is no merit.
    """
    found: list[Change] = []
    for table in tables:
        first, second = table.row(base), table.row(other)
        if first is None or second is None:
            continue
        found += _compare_flags(table, first, second)
        hit = min(first.success.rate, second.success.rate) < 0.5
        for measure in MEASURES[table.phase]:
            if not (measure in PATH_FOLLOWING and table.plant == "unicycle" and hit):
                found += _compare_measure(table, measure, first, second)
    return found


def _compare_flags(table: Table, first: Row, second: Row) -> list[Change]:
    found = []
    for name, figure in _FLAGS.items():
        a, b = first.by_trial(name), second.by_trial(name)
        if a is None or b is None:
            continue
        lost, won, p = mcnemar(a, b)
        effect = (won - lost) / len(a) if p < LEVEL else 0.0
        if name == "success":
            figure = success_text(table.plant, table.phase)
        evidence = f"{table.setting}; {lost} trials lost, {won} won, p = {p:.2g}"
        found.append(
            Change(figure, effect, f"{figure} {b.sum()} instead of {a.sum()} of {len(a)} ({evidence})")
        )
    return found


def success_text(plant: str, phase: PhaseName) -> str:
    """Return what it means that a trial ended well."""
    return "docked" if plant == "bullet" or phase == "close" else "clear of the obstacle"


def _compare_measure(table: Table, measure: Measure, first: Row, second: Row) -> list[Change]:
    """Compare the tail of a measure over the trials that have it under both controllers."""
    a, b = shared_values(measure, first, second)
    if not a.size:
        return []
    difference = paired_difference(b, a, measure.tail)
    sign = 1.0 if measure.more_is_better else -1.0
    before, after = (format_value(quantile(v, measure.tail), measure) for v in (a, b))
    of = "" if a.size == first.trials else f", {a.size} trials"
    figure = f"{measure.label}, {100 * measure.tail:.0f}th percentile"
    text = f"{figure} {after} instead of {before} {measure.unit} ({table.setting}{of}"
    if difference.interval is None:
        return [Change(figure, None, f"{text}; too few trials)")]
    effect = sign * difference.value if difference.is_apart else 0.0
    return [Change(figure, effect, f"{text}; by {format_interval(difference.interval, measure)})")]


def shared_values(measure: Measure, first: Row, second: Row) -> tuple[Array, Array]:
    """Return the values of the trials that have a measure under both controllers, shape (trials,) each."""
    if not {measure.key} <= first.measures.keys() & second.measures.keys():
        return np.empty(0), np.empty(0)
    a, b = first.measures[measure.key].by_trial(), second.measures[measure.key].by_trial()
    both = ~(np.isnan(a) | np.isnan(b))
    return a[both], b[both]


def format_interval(interval: tuple[float, float], measure: Measure) -> str:
    """Return the interval of a difference in the unit of the measure, without the unit."""
    signs = ("" if math.isinf(x) else "-" if x < 0.0 else "+" for x in interval)
    return " .. ".join(sign + format_value(abs(x), measure) for sign, x in zip(signs, interval, strict=True))


def largest(changes: Sequence[Change], sign: float) -> list[str]:
    """Return the changes for the better (1) or the worse (-1), of each figure the largest, in words."""
    best: dict[str, tuple[float, str]] = {}
    for change in changes:
        amount = sign * (change.effect or 0.0)
        if amount > 0.0 and (change.figure not in best or amount > best[change.figure][0]):
            best[change.figure] = amount, change.text
    return [text for _, text in best.values()]


def untold(changes: Sequence[Change]) -> list[str]:
    """Return the figures that have too few trials in every setting."""
    told = {change.figure for change in changes if change.effect is not None}
    return list(dict.fromkeys(change.figure for change in changes if change.figure not in told))
