"""Two sweeps over the same seeds, trial by trial, from their tables of trials."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

import numpy as np
from pydantic import BaseModel

from msrr_bullet.paired import Difference, mcnemar, paired_difference
from msrr_bullet.statistics import quantile
from msrr_bullet.sweep.compared_trials import DURATION, FIGURES, Figure, Trial, read_trials
from msrr_scenes.errors import SceneError

_ALL: Mapping[str, str] = MappingProxyType({})


class ComparedQuantile(BaseModel, frozen=True, ser_json_inf_nan="strings"):
    """A quantile of a figure in two sweeps.

    Attributes:
        q: Which quantile, such as 0.5 for the median.
        first: Its value in the first sweep.
        second: Its value in the second sweep.
        difference: The second minus the first.
        interval: 95 % confidence interval of the difference, by a paired bootstrap; None if there are too few
            trials for it, see :class:`msrr_bullet.paired.Difference`.
    """

    q: float
    first: float
    second: float
    difference: float
    interval: tuple[float, float] | None

    @property
    def is_apart(self) -> bool:
        """Whether the sweeps differ beyond chance: the interval does not hold zero."""
        return Difference(self.difference, self.interval).is_apart


class ComparedFigure(BaseModel, frozen=True):
    """A figure in two sweeps, over the trials that have it in both.

    Attributes:
        name: Name of the figure. That of a trial with several docking steps is the largest of theirs, or the
            smallest clearance; where one of the two did not succeed, of the steps that both have.
        unit: Unit of the figure; empty for a number.
        trials: Number of trials that have it in both sweeps.
        quantiles: Median and 95th percentile, of clearances the 5th.
    """

    name: str
    unit: str
    trials: int
    quantiles: tuple[ComparedQuantile, ...]


class SweepComparison(BaseModel, frozen=True):
    """Two sweeps, compared over the seeds that both have.

    Attributes:
        scenes: Names of the scenes of the first sweep and of the second; empty where a table tells none.
        plants: Plants of the first sweep and of the second, likewise.
        perceptions: Kinds of perception of the first sweep and of the second, likewise.
        chosen: Values by dotted key, as texts, by which trials of the first table and of the second were
            chosen; empty where all of them count.
        trials: Number of these seeds.
        only_first: Number of seeds that the first sweep alone has.
        only_second: Number of seeds that the second sweep alone has.
        succeeded: Number of trials that succeeded in the first sweep, and in the second one.
        without_result: Number of trials without a result, which count as not succeeded, likewise.
        succeeded_alone: Number of trials that succeeded in the first sweep alone, and in the second alone.
        p: Probability of so large a difference between these two by chance, by McNemar's exact test.
        figures: Figures that at least one seed has in both sweeps.
    """

    scenes: tuple[str, str]
    plants: tuple[str, str]
    perceptions: tuple[str, str]
    chosen: tuple[dict[str, str], dict[str, str]]
    trials: int
    only_first: int
    only_second: int
    succeeded: tuple[int, int]
    without_result: tuple[int, int]
    succeeded_alone: tuple[int, int]
    p: float
    figures: tuple[ComparedFigure, ...]

    @property
    def is_of_one_scene(self) -> bool:
        """Whether no table says that the sweeps are of scenes with different names."""
        return len({*self.scenes} - {""}) < 2


def compare_sweeps(
    first: Path, second: Path, first_with: Mapping[str, str] = _ALL, second_with: Mapping[str, str] = _ALL
) -> SweepComparison:
    """Compare two sweeps trial by trial, by the files that ``msrr sweep --csv`` wrote of them.

    A trial without a result counts as one that did not succeed. Of each table only trials with its values by
    dotted key, as texts, count: the two may be one table, for two levels of one variation.

    Raises:
        SceneError: A file cannot be read as such a table, or the two have no seed in common.
    """
    (one, a), (other, b) = read_trials(first, first_with), read_trials(second, second_with)
    seeds = sorted(a.keys() & b.keys())
    if not seeds:
        raise SceneError(f"{first} and {second} have no seed in common; sweep the same --seeds in both")
    pairs = [(a[seed], b[seed]) for seed in seeds]
    good = [p.succeeded for p, _ in pairs], [q.succeeded for _, q in pairs]
    both = [(p, q) for p, q in pairs if p.succeeded and q.succeeded]
    first_alone, second_alone, p = mcnemar(*good)
    figures = [
        *(_compared(f, [_values(p, q, f) for p, q in pairs]) for f in FIGURES),
        _compared(DURATION, [(p.duration_s, q.duration_s) for p, q in both]),
    ]
    return SweepComparison(
        scenes=(one["scene"], other["scene"]),
        plants=(one["plant"], other["plant"]),
        perceptions=(one["perception"], other["perception"]),
        chosen=(dict(first_with), dict(second_with)),
        trials=len(seeds),
        only_first=len(a) - len(seeds),
        only_second=len(b) - len(seeds),
        succeeded=(sum(good[0]), sum(good[1])),
        without_result=(sum(not p.has_result for p, _ in pairs), sum(not q.has_result for _, q in pairs)),
        succeeded_alone=(first_alone, second_alone),
        p=p,
        figures=tuple(f for f in figures if f.trials),
    )


def _values(first: Trial, second: Trial, figure: Figure) -> tuple[float | None, float | None]:
    """Return a figure of the same trial in both sweeps, over the same steps."""
    one, other = (trial.values.get(figure.column, {}) for trial in (first, second))
    if not (first.succeeded and second.succeeded):  # else all steps were done, by whatever units
        steps = one.keys() & other.keys()
        one, other = ({step: values[step] for step in steps} for values in (one, other))
    if not one or not other:
        return None, None
    return figure.of_trial(one.values()), figure.of_trial(other.values())


def _compared(figure: Figure, pairs: Sequence[tuple[float | None, float | None]]) -> ComparedFigure:
    known = [(p, q) for p, q in pairs if p is not None and q is not None]
    first, second = figure.factor * np.array(known, dtype=np.float64).reshape(-1, 2).T
    quantiles = []
    for q in (0.5, figure.tail) if known else ():
        difference, interval = paired_difference(second, first, q)
        one, other = quantile(first, q), quantile(second, q)
        quantiles.append(
            ComparedQuantile(q=q, first=one, second=other, difference=difference, interval=interval)
        )
    return ComparedFigure(name=figure.name, unit=figure.unit, trials=len(known), quantiles=tuple(quantiles))
