"""The trials in a table of a sweep, with the figures by which two sweeps are compared."""

from __future__ import annotations

import csv
import io
import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from msrr_scenes.errors import SceneError, nearest
from msrr_scenes.outcome import Outcome

_SUCCESSES = (Outcome.DOCKED.value, Outcome.COMPLETE.value)
#: Outcomes of trials; that of one without a result is empty.
_OUTCOMES = frozenset({"", *(outcome.value for outcome in Outcome)})
#: Columns of what all trials of a sweep share; an older table lacks them, and a trial without a result some.
_OF_SWEEP = ("scene", "plant", "perception")
#: What the columns of values begin with that were set or varied.
_SET = "set."
#: What helps where a table holds more trials of a seed than one.
_ONE_SWEEP = "give one sweep a file, or name one level of a variation by all its values"
#: What is read of a cell that a row lacks: no text that a table may hold.
_LACKS = "\0"


class Figure(NamedTuple):
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


FIGURES = (
    Figure("lateral error at first contact", "mm", "contact_lateral_m", 1e3),
    Figure("yaw error at first contact", "deg", "contact_yaw_rad", math.degrees(1.0)),
    Figure("gap between seated faces", "mm", "seated_axial_m", 1e3, where="seated"),
    Figure("attempts", "", "attempts"),
    Figure("steady tracking error", "m", "tracking_error_m"),
    Figure("amplitude at an obstacle", "m", "amplitude_m"),
    Figure("recovery from an obstacle", "s", "recovery_s"),
    Figure("smallest clearance", "m", "min_clearance_m", of_trial=min, tail=0.05),
)

#: Simulated time of a trial, which counts where the trial succeeded in both sweeps.
DURATION = Figure("duration where both succeed", "s", "duration_s")

#: Columns of :data:`msrr_bullet.sweep.trial_table.TRIAL_COLUMNS` that have to be there.
_COLUMNS = (
    *("seed", "outcome", "duration_s", "step", "unit", "target", "undocks"),
    *(column for figure in FIGURES for column in (figure.column, figure.where) if column),
)


#: Unit and target of a step, and how many steps of the same two came before: orders may differ in two trials.
StepKey = tuple[str, str, int]


@dataclass(slots=True)
class Trial:
    """A trial as its rows tell of it: how it ended, and the values of its docking steps.

    These are kept by column, then by unit, target and how often that pair had a step before.
    """

    outcome: str
    duration_s: float | None
    values: dict[str, dict[StepKey, float]] = field(default_factory=dict)
    pairs: Counter[tuple[str, str]] = field(default_factory=Counter)
    steps: set[str] = field(default_factory=set)

    @property
    def succeeded(self) -> bool:
        """Whether the trial ended as it should."""
        return self.outcome in _SUCCESSES

    @property
    def has_result(self) -> bool:
        """Whether the trial came to an end of its own."""
        return self.outcome != ""


def read_trials(path: Path, chosen: Mapping[str, str]) -> tuple[dict[str, str], dict[int, Trial]]:
    """Read a table of trials.

    Only trials are read in which the values of ``chosen``, by dotted key, were set or varied.

    Returns:
        What is the same in all trials, by column of ``_OF_SWEEP``, empty if the table does not tell, and
        the trials by seed.

    Raises:
        SceneError: The file cannot be read, is cut off, lacks a column, holds what is no number or no
            outcome, holds a step twice, or is of several scenes, plants or kinds of perception.
    """
    trials: dict[int, Trial] = {}
    of_sweep = dict.fromkeys(_OF_SWEEP, "")
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            text = file.read()
            reader = csv.DictReader(io.StringIO(text, newline=""), restval=_LACKS)
            missing = [name for name in _COLUMNS if name not in (reader.fieldnames or ())]
            if missing:
                raise SceneError(f"{path}: no column {missing[0]}; give a table of msrr sweep --csv")
            keys = [name.removeprefix(_SET) for name in reader.fieldnames or () if name.startswith(_SET)]
            if unknown := [key for key in chosen if key not in keys]:
                raise SceneError(f"{path}: {unknown[0]} was not set or varied{nearest(unknown[0], keys)}")
            there = {key: set[str]() for key in chosen}
            counted = {key: set[str]() for key in keys}
            if not text.endswith(("\n", "\r")):
                raise SceneError(f"{path}: cut off within its last line; write it anew")
            for row in reader:
                place = f"{path}, line {reader.line_num}"
                if None in row or _LACKS in row.values():
                    raise SceneError(f"{place}: another number of cells than of columns; write it anew")
                for key in chosen:
                    there[key].add(row[_SET + key])
                if any(not _is_same(row[_SET + key], value) for key, value in chosen.items()):
                    continue
                for column, known in of_sweep.items():
                    of_sweep[column] = row.get(column) or known
                    if known and of_sweep[column] != known:
                        text = f"{column} {of_sweep[column]} after {known}"
                        raise SceneError(f"{place}: {text}; give one sweep a file")
                for key in keys:
                    counted[key].add(row[_SET + key])
                _add(trials, row, place, counted)
    except OSError as error:
        raise SceneError(f"{path}: {error.strerror}; give a table of msrr sweep --csv") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise SceneError(f"{path}: not a table of trials ({error}); give one of msrr sweep --csv") from None
    if chosen and not trials:
        values = "; ".join(f"{key} is {' or '.join(sorted(found))}" for key, found in there.items())
        wanted = " ".join(f"{key}={value}" for key, value in chosen.items())
        raise SceneError(f"{path}: no trial with {wanted}; in the table {values or 'is none at all'}")
    return of_sweep, trials


def is_same_level(first: Mapping[str, str], second: Mapping[str, str]) -> bool:
    """Return whether two choices of values are one, also if a number is written in two ways."""
    return first.keys() == second.keys() and all(_is_same(first[key], second[key]) for key in first)


def _is_same(text: str, value: str) -> bool:
    """Return whether two values are the same text, or the same number."""
    try:
        return text == value or float(text) == float(value)
    except ValueError:
        return False


def _one_sweep(values: Mapping[str, set[str]]) -> str:
    """Return what helps where a table holds more trials of a seed than one, by the values of its columns."""
    several = [f"{key} is {' or '.join(sorted(found))}" for key, found in values.items() if len(found) > 1]
    return f"these are several sweeps ({', '.join(several)}); {_ONE_SWEEP}" if several else _ONE_SWEEP


def _add(trials: dict[int, Trial], row: dict[str, str], place: str, counted: Mapping[str, set[str]]) -> None:
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
    trial = trials.setdefault(seed, Trial(row["outcome"], duration_s))
    if row["step"] in trial.steps:
        raise SceneError(f"{place}: step {row['step']} of seed {seed} a second time; {_one_sweep(counted)}")
    if (trial.outcome, trial.duration_s) != (row["outcome"], duration_s):
        raise SceneError(f"{place}: seed {seed} ends otherwise than in a row before; {_one_sweep(counted)}")
    trial.steps.add(row["step"])
    if _number(row, "undocks", place):
        return
    pair = (row["unit"], row["target"])
    key = (*pair, trial.pairs[pair])
    trial.pairs[pair] += 1
    for figure in FIGURES:
        value = _number(row, figure.column, place)
        if figure.column == "recovery_s" and value is None and row["amplitude_m"]:
            value = math.inf  # it passed an obstacle, and ended beyond the distance that counts as recovered
        counts = not figure.where or _number(row, figure.where, place) == 1.0
        if value is not None and counts:
            trial.values.setdefault(figure.column, {})[key] = value


def _number(row: dict[str, str], column: str, place: str) -> float | None:
    try:
        value = float(row[column] or math.nan)
    except ValueError:
        raise SceneError(f"{place}: {column} is {row[column]!r}, which is no number") from None
    if math.isinf(value):
        raise SceneError(f"{place}: {column} is {row[column]!r}, which no trial has")
    return None if math.isnan(value) else value
