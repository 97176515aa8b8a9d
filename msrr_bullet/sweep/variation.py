"""Sweeps of one scene at several values of its keys: how often, and how precisely, do units dock at each?"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import product
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel

from msrr_bullet.statistics import Quantiles, interval_text
from msrr_bullet.sweep.summary import SweepSummary
from msrr_bullet.sweep.sweep import run_sweeps
from msrr_bullet.sweep.trials import TrialObserver, one_trial
from msrr_bullet.sweep.worker_pool import SupportsSubmit, TrialFunction
from msrr_scenes.errors import SceneError
from msrr_scenes.html import html_table
from msrr_scenes.loading.load import load_scene, scene_hash
from msrr_scenes.loading.overrides import override_text
from msrr_scenes.specs.scene import Scene
from msrr_scenes.wording import counted

#: Largest number of levels of a variation.
MAX_LEVELS = 1000

_NONE: Mapping[str, object] = MappingProxyType({})


class Level(BaseModel, frozen=True):
    """One choice of the values that are varied, and the trials with it.

    Attributes:
        values: Values by dotted key, as YAML text.
        summary: Summary of the trials.
    """

    values: dict[str, str]
    summary: SweepSummary


class Variation(BaseModel, frozen=True):
    """Sweeps over the same seeds, one for each choice of the values that are varied.

    Attributes:
        levels: The choices; the values of the last key vary fastest.
    """

    levels: tuple[Level, ...]

    @classmethod
    def of(cls, choices: Iterable[Mapping[str, str]], summaries: Iterable[SweepSummary]) -> Variation:
        """Return the variation of choices, as :func:`levels` returns them, from the summary of each."""
        pairs = zip(choices, summaries, strict=True)
        return cls(levels=tuple(Level(values=dict(choice), summary=s) for choice, s in pairs))

    def to_json(self) -> str:
        """Return the variation as indented JSON."""
        return self.model_dump_json(indent=2) + "\n"

    def _repr_html_(self) -> str:
        """Return the variation as a notebook shows it: a table."""
        rows = [[f"{text} ({bounds})" if bounds else text for text, bounds in row] for row in self.rows()]
        return html_table(self.title, rows, self.head())

    @property
    def title(self) -> str:
        """What was varied, in words."""
        summaries = [level.summary for level in self.levels]
        scene = " and ".join(dict.fromkeys(s.scene for s in summaries))
        plant = " and ".join(dict.fromkeys(s.plant for s in summaries))
        perception = " and ".join(dict.fromkeys(s.perception for s in summaries))
        over = " and ".join(self.levels[0].values)
        what = "value" if len(self.levels[0].values) == 1 else "combination"
        cut = ", stopped before all trials were run" if any(s.interrupted for s in summaries) else ""
        return f"{scene} ({plant}, {perception}) at {counted(len(self.levels), what)} of {over}{cut}"

    @property
    def goal(self) -> str:
        """The outcome of the trials that succeed; where that of missions and of others differ, both."""
        return " or ".join(dict.fromkeys(level.summary.goal.value for level in self.levels))

    @property
    def steps(self) -> list[str]:
        """The names of the docking steps that a level has, each once."""
        return list(dict.fromkeys(name for level in self.levels for name, _ in level.summary.docking_steps))

    @property
    def _has_missions(self) -> bool:
        return any(level.summary.mission is not None for level in self.levels)

    def head(self) -> list[str]:
        """Return the titles of the columns of the table."""
        return [
            *short_keys(list(self.levels[0].values)),
            self.goal,
            *(["last lock [s]"] if self._has_missions else []),
            *(["step"] if len(self.steps) > 1 else []),
            "lateral error,\nmedian [mm]",
            "lateral error,\n95 % [mm]",
            "yaw error,\n95 % [deg]",
        ]

    def rows(self) -> list[list[tuple[str, str]]]:
        """Return the rows of the table: one for every level, and one more for every further docking step.

        A cell is a text, and the 95 % confidence interval of its value, that of a rate in percent, or else
        an empty text.
        """
        rows = []
        several = len(self.steps) > 1
        for level in self.levels:
            s = level.summary
            bounds = f"{100 * s.success.low:.1f} .. {100 * s.success.high:.1f}"
            cells = [
                *((value, "") for value in level.values.values()),
                (f"{s.outcomes.get(s.goal.value, 0)} of {s.trials}", bounds),
            ]
            if self._has_missions:
                cells.append(("", "") if s.mission is None else _median(s.mission.makespan_s))
            for name, step in s.docking_steps:
                figures = (
                    _median(step.contact_lateral_mm),
                    _tail(step.contact_lateral_mm),
                    _tail(step.contact_yaw_deg),
                )
                rows.append([*cells, *([(name, "")] if several else []), *figures])
                cells = [("", "")] * len(cells)
        return rows


def _median(values: Quantiles) -> tuple[str, str]:
    return "" if values.p50 is None else f"{values.p50:z.2f}", interval_text(values.p50_interval)


def _tail(values: Quantiles) -> tuple[str, str]:
    return "" if values.p95 is None else f"{values.p95:z.2f}", interval_text(values.p95_interval)


def short_keys(keys: Sequence[str]) -> list[str]:
    """Return the last parts of each key, as few as tell it from the others."""
    parts = [key.split(".") for key in keys]
    titles = []
    for own in parts:
        n = 1
        while n < len(own) and sum(other[-n:] == own[-n:] for other in parts) > 1:
            n += 1
        titles.append(".".join(own[-n:]))
    return titles


def levels(values: Mapping[str, Sequence[object] | NDArray[Any]]) -> list[dict[str, str]]:
    """Return every choice of one value for each key, as YAML text; the values of the last key vary fastest.

    Raises:
        SceneError: There is no value for a key, a value is none that YAML has a text for, or there are too
            many choices.
    """
    lists = {key: given.tolist() if isinstance(given, np.ndarray) else given for key, given in values.items()}
    for key, given in lists.items():
        if isinstance(given, str) or not isinstance(given, Sequence) or not given:
            raise SceneError(f"{key}: expected a list of at least one value, found {given!r}")
    texts = [[override_text(key, value) for value in given] for key, given in lists.items()]
    choices = [dict(zip(values, choice, strict=True)) for choice in product(*texts)]
    if len(choices) > MAX_LEVELS:
        raise SceneError(f"{len(choices)} choices of values; at most {MAX_LEVELS} are possible")
    return choices


def load_levels(
    scene: str | Path,
    choices: Iterable[Mapping[str, str]],
    overrides: Mapping[str, object] = _NONE,
    *,
    told_as: str = "override",
    varied_as: str = "override",
) -> list[Scene]:
    """Return the scene with the values of every choice, beside values that are the same in all.

    A value of a key within another one holds beside any value of the latter, whichever of them is varied.
    Choices are as :func:`levels` returns them. ``told_as`` is what messages call a value that is set in all,
    and ``varied_as`` one of a choice.

    Raises:
        SceneError: A scene is unusable, a key is both varied and set, or two choices are the same scene.
    """
    loaded: dict[str, tuple[Mapping[str, str], Scene]] = {}
    for choice in choices:
        if twice := [key for key in choice if key in overrides]:
            raise SceneError(
                f"{twice[0]} is varied, and {told_as} sets it to one value; leave one of both out"
            )
        names = {**dict.fromkeys(overrides, told_as), **dict.fromkeys(choice, varied_as)}
        values = sorted({**overrides, **choice}.items(), key=lambda item: item[0].count("."))
        try:
            found = load_scene(scene, dict(values), told_as=names)
        except SceneError as error:
            if not choice or f"{varied_as} " in str(error):
                raise
            raise SceneError(f"with {values_text(choice)}: {error}") from error
        same, _ = loaded.setdefault(scene_hash(found), (choice, found))
        if same is not choice:
            raise SceneError(
                f"{values_text(same)} and {values_text(choice)} are the same scene; leave one of them out"
            )
    return [found for _, found in loaded.values()]


def run_variation(
    scene: str | Path,
    values: Mapping[str, Sequence[object] | NDArray[Any]],
    seeds: Iterable[int],
    jobs: int | Callable[[], int] = 1,
    store: str | Path | None = None,
    *,
    overrides: Mapping[str, object] = _NONE,
    executor: SupportsSubmit | None = None,
    trial: TrialFunction = one_trial,
    observer: TrialObserver | None = None,
    wall_limit_s: float | None = None,
) -> Variation:
    """Sweep a scene at several values of one key, or at every combination of the values of several keys.

    Trials of the same seed share what does not follow from these values, such as the start, so that levels
    differ by less chance than their intervals say.

    Args:
        scene: Name of a shipped scene, or path of a scene file.
        values: The values by dotted key, ``{"cameras.onboard.latency_ms": [0, 60, 120]}``.
        seeds: Seeds of the trials at every level.
        jobs: See :func:`msrr_bullet.sweep.sweep.run_sweep`, as for all that follow but one.
        store: SQLite file of results.
        overrides: Values by dotted key that are the same at all levels; see
            :func:`msrr_scenes.loading.load.load_scene`.
        executor: Runs the trials instead of a pool of processes.
        trial: Runs one trial.
        observer: Called for each trial as it is done.
        wall_limit_s: Time that each trial may take on the wall clock; None sets no limit.

    Raises:
        SceneError: As :func:`levels` and :func:`load_levels` raise it.
        MsrrError: See :func:`msrr_bullet.sweep.sweep.run_sweep`, also for other errors.
        TypeError: ``scene`` is neither a name nor a path.
    """
    if not isinstance(scene, (str, Path)):
        kind = type(scene).__name__
        raise TypeError(f"expected the name of a scene or the path of its file, found a {kind}")
    if not isinstance(values, Mapping) or not values:
        raise SceneError(f"expected the values of at least one dotted key as a dict, found {values!r}")
    choices = levels(values)
    summaries = run_sweeps(
        load_levels(scene, choices, overrides),
        seeds,
        jobs,
        store,
        executor=executor,
        trial=trial,
        observer=observer,
        wall_limit_s=wall_limit_s,
    )
    return Variation.of(choices, summaries)


def values_text(values: Mapping[str, str]) -> str:
    """Return values that are set as text, each ``KEY=VALUE``."""
    return " ".join(f"{key}={value}" for key, value in values.items())
