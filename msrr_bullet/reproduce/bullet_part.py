"""The part of a reproduction that runs the real loop: contact physics, rendered images, real detection."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path

from msrr_bullet.reproduce.forecast import Forecast
from msrr_bullet.reproduce.measured_trial import MeasuredTrial, TrialCache, measured_trial
from msrr_bullet.statistics import Rate, wilson
from msrr_bullet.studies.measures import MEASURES, OF_THE_OBSTACLE, Measure, PhaseName, paper_figures
from msrr_bullet.studies.model import Count, Measured, Reproduction, Row, Table
from msrr_bullet.sweep.summary import TrialFailure
from msrr_bullet.sweep.sweep import sweep
from msrr_bullet.trial.result import TrialResult, package_versions
from msrr_scenes.errors import MsrrError
from msrr_scenes.loading.load import load_scene
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.spec import Choice

#: Said of every experiment: in the real loop the trajectory is not quite the paper's.
_AS_SHIPPED = (
    "guidance as shipped: the paper's, but it slows down before contact and waits for a unit that lags behind"
)


@dataclass(frozen=True)
class Experiment:
    """One scene of the real loop, run under several controllers.

    Attributes:
        name: In tables and the JSON.
        scene: Name or path.
        description: For readers.
        phases: Which of its phases are measured.
        docking: Docking controllers by label.
        assembly: Assemblers by label; a label without one keeps the scene's.
        overrides: Of the scene.
    """

    name: str
    scene: str
    description: str
    phases: tuple[PhaseName, ...]
    docking: dict[str, Choice]
    assembly: dict[str, Choice] = field(default_factory=dict)
    overrides: dict[str, str] = field(default_factory=dict)

    def load(self, label: str) -> Scene:
        """Return the scene under one of the controllers."""
        chosen = {**self.overrides, "control.docking": json.dumps(self.docking[label].model_dump())}
        if label in self.assembly:
            chosen["control.assembly"] = json.dumps(self.assembly[label].model_dump())
        return load_scene(self.scene, chosen)


def paper_experiments(docking: dict[str, Choice], mission: str = "two_units") -> tuple[Experiment, ...]:
    """Return the experiments of ``msrr reproduce --plant bullet``.

    Args:
        docking: Contenders of the close phase by label.
        mission: Scene of the whole mission.
    """
    both = {"C1": Choice(name="c1"), "C2": Choice(name="c2")}
    fierce = {
        "C1": Choice(name="c1", params={"feedback": {"k_n_per_s": 6.0}}),
        "C2": Choice(name="c2", params={"feedback": {"k_per_s": 6.0}}),
    }
    return (
        Experiment(
            "whole mission", mission, f"scene {mission}; {_AS_SHIPPED}", ("long", "close"), both, both
        ),
        Experiment(
            "hard starts", "close_range_hard", f"scene close_range_hard; {_AS_SHIPPED}", ("close",), docking
        ),
        Experiment(
            "high gain",
            "close_range",
            "scene close_range, gain 6 1/s, 100 ms latency that the estimator does not make up for;"
            f" {_AS_SHIPPED}",
            ("close",),
            fierce,
            overrides={"cameras.onboard.latency_ms": "100", "control.delay_compensation": "false"},
        ),
    )


def reproduce_bullet(
    experiments: Iterable[Experiment],
    seeds: range,
    folder: Path,
    jobs: int = 1,
    tell: Callable[[str], None] | None = None,
) -> Reproduction:
    """Run the experiments; what is in ``folder`` from the same scene and code is not run again.

    Args:
        experiments: What to run.
        seeds: One trial of each experiment and controller for each of them.
        folder: Keeps every trial.
        jobs: How many trials run at the same time.
        tell: Is told what is done next, and how far it is.

    Raises:
        KeyboardInterrupt: It was stopped; what was computed is kept.
        MsrrError: A scene cannot be run, or a trial's program failed.
    """
    tell = tell or (lambda text: None)
    experiments = tuple(experiments)
    weights = {e.name: (len(e.docking) * len(seeds), _weight(e)) for e in experiments}
    forecast = Forecast(weights)
    tables, spent = [], {}
    for experiment in experiments:
        began = time.perf_counter()
        found: dict[str, tuple[MeasuredTrial, ...]] = {}
        for label in experiment.docking:
            count = _Counter(tell, forecast, experiment.name, label, len(seeds))
            found[label] = run_trials(experiment.load(label), seeds, folder, jobs, count)
        spent[experiment.name] = round(time.perf_counter() - began, 2)
        for phase in experiment.phases:
            rows = tuple(
                _row(experiment.docking[label], label, phase, experiment.phases, trials)
                for label, trials in found.items()
            )
            tables.append(
                Table(
                    phase=phase,
                    plant="bullet",
                    setting=experiment.name,
                    description=experiment.description,
                    rows=rows,
                )
            )
    return Reproduction(
        versions=package_versions(),
        seeds={"bullet": (seeds.start, seeds.stop)},
        tables=tuple(tables),
        seconds=spent,
    )


def _weight(experiment: Experiment) -> float:
    """Return how long its trials take in proportion to others: the way there is longer than the docking."""
    return 3.0 if "long" in experiment.phases else 1.0


class _Counter:
    """Counts the trials of one controller in one experiment, and says how far all of them are."""

    def __init__(
        self, tell: Callable[[str], None], forecast: Forecast, experiment: str, label: str, of: int
    ) -> None:
        self._tell, self._forecast = tell, forecast
        self._experiment, self._label, self._of = experiment, label, of
        self._done = 0

    def kept(self, count: int) -> None:
        self._done += count
        self._forecast.kept(self._experiment, count)
        self._say()

    def ran(self) -> None:
        self._done += 1
        self._forecast.ran(self._experiment)
        self._say()

    def _say(self) -> None:
        self._tell(f"{self._experiment}, {self._label}: {self._done} of {self._of} ({self._forecast})")


def run_trials(
    scene: Scene, seeds: range, folder: Path, jobs: int, count: _Counter
) -> tuple[MeasuredTrial, ...]:
    """Run or fetch a measured trial for each seed, in order.

    Args:
        scene: With its controllers.
        seeds: A trial for each.
        folder: Keeps them.
        jobs: How many run at the same time.
        count: Is told of each.

    Raises:
        KeyboardInterrupt: It was stopped; what was computed is kept.
        MsrrError: The scene cannot be run, a trial's program failed, or the code was changed meanwhile.
    """
    shelf = TrialCache(folder, scene)
    trials = {t.seed: t for t in shelf if t.seed in seeds}
    count.kept(len(trials))

    def keep(found: TrialResult | TrialFailure, stored: bool) -> None:
        if isinstance(found, MeasuredTrial):
            shelf.put(found)
            trials[found.seed] = found
            count.ran()

    left = [seed for seed in seeds if seed not in trials]
    if left:
        summary = sweep(scene, left, jobs, trial=measured_trial, observer=keep)
        if summary.interrupted:
            raise KeyboardInterrupt
        if summary.failures:
            first = summary.failures[0]
            raise MsrrError(f"{scene.name}, seed {first.seed}: the program failed: {first.error}")
    return tuple(trials[seed] for seed in seeds)


def _row(
    choice: Choice,
    label: str,
    phase: PhaseName,
    phases: tuple[PhaseName, ...],
    trials: tuple[MeasuredTrial, ...],
) -> Row:
    counted = {o.value: sum(t.outcome is o for t in trials) for o in Outcome}
    measures = {}
    for what in MEASURES[phase]:
        values = [t.measures[what.key] for t in trials if what.key in t.measures]
        if what.key == "clearance":
            values = [t.min_clearance_m for t in trials if t.min_clearance_m is not None]
        measures[what.key] = Measured.of(values)

    def share(flags: Iterable[bool | None]) -> Rate | None:
        # One that never came to an approach kept nothing in view.
        return wilson(sum(flag is True for flag in flags), len(trials)) if phase == "close" else None

    return Row(
        controller=choice.name,
        label=label,
        trials=len(trials),
        success=wilson(sum(t.docked for t in trials), len(trials)),
        in_view=share(t.kept_in_view for t in trials),
        in_cone=share(t.kept_in_cone for t in trials),
        measures=measures,
        outcomes={name: n for name, n in counted.items() if n},
        met={what.key: _met(trials, what) for what in paper_figures((phase,))},
        within_paper=sum(within_paper(t, phases) for t in trials),
    )


def _met(trials: tuple[MeasuredTrial, ...], what: Measure) -> Count:
    said = [meets(t, what) for t in trials]
    return Count(n=sum(flag is True for flag in said), of=sum(flag is not None for flag in said))


def meets(trial: MeasuredTrial, what: Measure) -> bool | None:
    """Say whether a trial meets the paper's figure of C1 of one measure; None where it does not apply.

    A path that met no obstacle has neither amplitude nor recovery. What else a trial lacks, it does not meet.
    """
    value = trial.measures.get(what.key)
    if value is None:
        return None if what.key in OF_THE_OBSTACLE and "tracking" in trial.measures else False
    return what.paper_c1 is not None and value <= what.paper_c1


def within_paper(trial: MeasuredTrial, phases: tuple[PhaseName, ...]) -> bool:
    """Say whether a trial docked and meets every figure that the paper gives of C1 in these phases."""
    return trial.docked and all(meets(trial, what) is not False for what in paper_figures(phases))
