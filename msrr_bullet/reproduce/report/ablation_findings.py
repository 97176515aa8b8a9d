"""What C1 loses, and gains, without each of its parts: in words, every number read from the findings."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Literal

from msrr_bullet.reproduce.report.intervals import Estimate, of_quantile, of_rate
from msrr_bullet.reproduce.report.two_quantiles import shown
from msrr_bullet.statistics import Rate
from msrr_bullet.studies.measures import MEASURES, Measure
from msrr_bullet.studies.model import Ablations, Row

#: Share of trials that has to be clear of the obstacle for the other measures to mean anything.
_PASSES = 0.5

Read = Callable[[Row], Estimate | None]


@dataclass(frozen=True, slots=True)
class Change:
    """One estimate of C1 and the same without a part, in one setting.

    Attributes:
        what: What is estimated.
        setting: Where.
        whole: With the part.
        without: Without it.
        worse: By how much it is worse without; negative if it is better, 0 if the intervals overlap.
        text: Shows an estimate.
    """

    what: str
    setting: str
    whole: Estimate
    without: Estimate
    worse: float
    text: Callable[[Estimate], str]

    def __str__(self) -> str:
        """Return it in words."""
        return f"{self.what} {self.text(self.without)} instead of {self.text(self.whole)} ({self.setting})"


def changes(found: Ablations, k: int) -> list[Change]:
    """Return every change that variant ``k`` makes, in every setting."""
    docks = "docked" if found.phase == "close" else "clear of the obstacle"
    kinds: list[tuple[str, Read, Callable[[Estimate], str], bool]] = [
        (docks, _rate("success"), _percent, True),
        ("kept in view", _rate("in_view"), _percent, True),
        ("kept in the cone", _rate("in_cone"), _percent, True),
    ]
    for what in MEASURES[found.phase]:
        if what.paper_c1 is not None:
            name = f"{what.label}, 95th percentile"
            kinds.append((name, _quantile(what, 0.95), partial(_scaled, what), False))
        elif what.key == "clearance":
            kinds.append((f"{what.label}, median", _quantile(what, 0.5), partial(_scaled, what), True))
    made = []
    for table in found.tables:
        for name, read, text, more_is_better in kinds:
            whole, without = read(table.rows[0]), read(table.rows[k])
            if whole is None or without is None:
                continue
            apart = whole.value - without.value if more_is_better else without.value - whole.value
            worse = apart if whole.apart(without) else 0.0
            made.append(Change(name, table.setting, whole, without, worse, text))
    return made


def ablation_text(found: Ablations) -> list[str]:
    """Say what C1 loses and gains without each of its parts: of each figure, where it changes most."""
    said = []
    for k, variant in enumerate(found.tables[0].rows):
        if k == 0:
            continue
        by_kind: dict[str, list[Change]] = {}
        for change in changes(found, k):
            by_kind.setdefault(change.what, []).append(change)
        losses = [max(group, key=lambda c: c.worse) for group in by_kind.values()]
        gains = [min(group, key=lambda c: c.worse) for group in by_kind.values()]
        lost = "; ".join(str(c) for c in losses if c.worse > 0.0)
        gained = "; ".join(str(c) for c in gains if c.worse < 0.0)
        text = f"C1 {variant.label}: {lost if lost else 'nothing is worse beyond the intervals'}."
        said.append(text + (f" Better without it: {gained}." if gained else ""))
    return said


def _rate(name: Literal["success", "in_view", "in_cone"]) -> Read:
    def read(row: Row) -> Estimate | None:
        rate: Rate | None = getattr(row, name)
        return of_rate(rate) if rate is not None else None

    return read


def _quantile(what: Measure, q: float) -> Read:
    def read(row: Row) -> Estimate | None:
        # One that drives through the obstacle swings out little and recovers at once: no merit of its.
        if what in MEASURES["long"] and row.success.rate < _PASSES:
            return None
        return of_quantile(row.measures[what.key], q)

    return read


def _percent(e: Estimate) -> str:
    return f"{100 * e.value:.1f} % ({100 * e.low:.1f} .. {100 * e.high:.1f})"


def _scaled(what: Measure, e: Estimate) -> str:
    value, low, high = (shown(x, what) for x in (e.value, e.low, e.high))
    # A bound that too few trials leave open is written as such; only a value that is infinite never came.
    if math.isinf(e.high) and math.isfinite(e.value):
        high = "inf"
    unit = f" {what.unit}" if math.isfinite(e.value) else ""
    return f"{value}{unit} ({low} .. {high})"
