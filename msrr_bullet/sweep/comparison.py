"""Two sweeps over the same seeds, trial by trial, from their tables of trials."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
from pydantic import BaseModel

from msrr_bullet.paired import Difference, mcnemar, paired_difference
from msrr_bullet.statistics import quantile
from msrr_scenes.errors import SceneError
from msrr_scenes.outcome import Outcome

_SUCCESSES = (Outcome.DOCKED.value, Outcome.COMPLETE.value)
#: Outcomes of trials; that of one without a result is empty.
_OUTCOMES = frozenset({"", *(outcome.value for outcome in Outcome)})
#: Columns of what all trials of a sweep share; an older table lacks them, and a trial without a result some.
_OF_SWEEP = ("scene", "plant", "perception")
#: What is read of a cell that a row lacks: no text that a table may hold.
_LACKS = "\0"


class _Figure(NamedTuple):
    """A column of the table of trials, how it is shown, and which of the docking steps of a trial counts.

    Of steps of which the column ``where`` is not 1, none does.
    """

    name: str
    unit: str
    column: str
    factor: float = 1.0
    of_trial: Callable[[Iterable[float]], float] = max
    tail: float = 0.95
    where: str = ""


_FIGURES = (
    _Figure("lateral error at first contact", "mm", "contact_lateral_m", 1e3),
    _Figure("yaw error at first contact", "deg", "contact_yaw_rad", math.degrees(1.0)),
    _Figure("gap between seated faces", "mm", "seated_axial_m", 1e3, where="seated"),
    _Figure("attempts", "", "attempts"),
    _Figure("steady tracking error", "m", "tracking_error_m"),
    _Figure("amplitude at an obstacle", "m", "amplitude_m"),
    _Figure("recovery from an obstacle", "s", "recovery_s"),
    _Figure("smallest clearance", "m", "min_clearance_m", of_trial=min, tail=0.05),
)

#: Simulated time of a trial, which counts where the trial succeeded in both sweeps.
_DURATION = _Figure("duration where both succeed", "s", "duration_s")

#: Columns of :data:`msrr_bullet.sweep.trial_table.TRIAL_COLUMNS` that have to be there.
_COLUMNS = (
    *("seed", "outcome", "duration_s", "step", "undocks"),
    *(column for figure in _FIGURES for column in (figure.column, figure.where) if column),
)


@dataclass(slots=True)
class _Trial:
    """A trial as its rows tell of it: how it ended, and the values of its docking steps by column."""

    outcome: str
    duration_s: float | None
    values: dict[str, list[float]] = field(default_factory=dict)
    steps: set[str] = field(default_factory=set)

    @property
    def succeeded(self) -> bool:
        """Whether the trial ended as it should."""
        return self.outcome in _SUCCESSES

    @property
    def has_result(self) -> bool:
        """Whether the trial came to an end of its own."""
        return self.outcome != ""


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
            smallest clearance.
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


def compare_sweeps(first: Path, second: Path) -> SweepComparison:
    """Compare two sweeps trial by trial, by the files that ``msrr sweep --csv`` wrote of them.

    A trial without a result counts as one that did not succeed.

    Raises:
        SceneError: A file cannot be read as such a table, or the two have no seed in common.
    """
    (one, a), (other, b) = _read(first), _read(second)
    seeds = sorted(a.keys() & b.keys())
    if not seeds:
        raise SceneError(f"{first} and {second} have no seed in common; sweep the same --seeds in both")
    pairs = [(a[seed], b[seed]) for seed in seeds]
    good = [p.succeeded for p, _ in pairs], [q.succeeded for _, q in pairs]
    both = [(p, q) for p, q in pairs if p.succeeded and q.succeeded]
    first_alone, second_alone, p = mcnemar(*good)
    figures = [
        *(_compared(f, [(_value(p, f), _value(q, f)) for p, q in pairs]) for f in _FIGURES),
        _compared(_DURATION, [(p.duration_s, q.duration_s) for p, q in both]),
    ]
    return SweepComparison(
        scenes=(one["scene"], other["scene"]),
        plants=(one["plant"], other["plant"]),
        perceptions=(one["perception"], other["perception"]),
        trials=len(seeds),
        only_first=len(a) - len(seeds),
        only_second=len(b) - len(seeds),
        succeeded=(sum(good[0]), sum(good[1])),
        without_result=(sum(not p.has_result for p, _ in pairs), sum(not q.has_result for _, q in pairs)),
        succeeded_alone=(first_alone, second_alone),
        p=p,
        figures=tuple(f for f in figures if f.trials),
    )


def _value(trial: _Trial, figure: _Figure) -> float | None:
    values = trial.values.get(figure.column)
    return figure.of_trial(values) if values else None


def _compared(figure: _Figure, pairs: Sequence[tuple[float | None, float | None]]) -> ComparedFigure:
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


def _read(path: Path) -> tuple[dict[str, str], dict[int, _Trial]]:
    """Read a table of trials.

    Returns:
        What is the same in all trials, by column of :data:`_OF_SWEEP`, empty if the table does not tell, and
        the trials by seed.

    Raises:
        SceneError: The file cannot be read, is cut off, lacks a column, holds what is no number or no
            outcome, holds a step twice, or is of several scenes, plants or kinds of perception.
    """
    trials: dict[int, _Trial] = {}
    of_sweep = dict.fromkeys(_OF_SWEEP, "")
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            text = file.read()
            reader = csv.DictReader(io.StringIO(text, newline=""), restval=_LACKS)
            missing = [name for name in _COLUMNS if name not in (reader.fieldnames or ())]
            if missing:
                raise SceneError(f"{path}: no column {missing[0]}; give a table of msrr sweep --csv")
            if not text.endswith(("\n", "\r")):
                raise SceneError(f"{path}: cut off within its last line; write it anew")
            for row in reader:
                place = f"{path}, line {reader.line_num}"
                if None in row or _LACKS in row.values():
                    raise SceneError(f"{place}: another number of cells than of columns; write it anew")
                for column, known in of_sweep.items():
                    of_sweep[column] = row.get(column) or known
                    if known and of_sweep[column] != known:
                        text = f"{column} {of_sweep[column]} after {known}"
                        raise SceneError(f"{place}: {text}; give one sweep a file")
                _add(trials, row, place)
    except OSError as error:
        raise SceneError(f"{path}: {error.strerror}") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise SceneError(f"{path}: not a table of trials ({error}); give one of msrr sweep --csv") from None
    return of_sweep, trials


def _add(trials: dict[int, _Trial], row: dict[str, str], place: str) -> None:
    """Add a row of the table, which is a step, or a trial in which no step began."""
    if not row["seed"]:
        raise SceneError(f"{place}: no seed")
    try:
        seed = int(row["seed"])  # exactly: a float does not tell large seeds apart
    except ValueError:
        raise SceneError(f"{place}: seed is {row['seed']!r}, which is no whole number") from None
    if seed < 0:
        raise SceneError(f"{place}: seed is {seed}, and none is negative")
    if row["outcome"] not in _OUTCOMES:
        raise SceneError(f"{place}: outcome is {row['outcome']!r}, which no trial has")
    duration_s = _number(row, "duration_s", place)
    trial = trials.setdefault(seed, _Trial(row["outcome"], duration_s))
    if row["step"] in trial.steps:
        raise SceneError(f"{place}: step {row['step']} of seed {seed} a second time; give one sweep a file")
    if (trial.outcome, trial.duration_s) != (row["outcome"], duration_s):
        raise SceneError(f"{place}: seed {seed} ends otherwise than in a row before; give one sweep a file")
    trial.steps.add(row["step"])
    if _number(row, "undocks", place):
        return
    for figure in _FIGURES:
        value = _number(row, figure.column, place)
        counts = not figure.where or _number(row, figure.where, place) == 1.0
        if value is not None and counts:
            trial.values.setdefault(figure.column, []).append(value)


def _number(row: dict[str, str], column: str, place: str) -> float | None:
    try:
        value = float(row[column] or math.nan)
    except ValueError:
        raise SceneError(f"{place}: {column} is {row[column]!r}, which is no number") from None
    if math.isinf(value):
        raise SceneError(f"{place}: {column} is {row[column]!r}, which no trial has")
    return None if math.isnan(value) else value
