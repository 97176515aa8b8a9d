"""The experiments of a reproduction in the real loop: contact physics, rendered images, real detection."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from msrr_bullet.reproduce.measured_trial import MeasuredTrial, measured_trial
from msrr_bullet.reproduce.progress import Forecast, TrialCounter
from msrr_bullet.run_folder import ProgressListener
from msrr_bullet.studies.labels import label_of
from msrr_bullet.studies.measures import MEASURES, OBSTACLE_MEASURES, Measure, PhaseName, paper_measures
from msrr_bullet.studies.model import Count, Measured, Reproduction, Row, Table, rates_of
from msrr_bullet.sweep.summary import TrialFailure
from msrr_bullet.sweep.trials import run_trials
from msrr_bullet.trial.versions import package_versions
from msrr_scenes.errors import MsrrError, SceneError
from msrr_scenes.loading.load import load_scene
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.spec import Choice

#: Part of every description: in the real loop the trajectory is not quite the paper's.
_GUIDANCE = (
    "perfect calibration; guidance as shipped: the paper's, but it slows down before contact and waits for a"
    " unit that lags behind"
)


@dataclass(frozen=True)
class Experiment:
    """One scene of the real loop, run under several controllers.

    Attributes:
        name: Name in tables and in the JSON.
        scene: Name or path of the scene.
        description: Description for the readers of the report.
        phases: Phases of the scene that are measured.
        docking: Docking controllers by label.
        assembly: Assemblers by label; a label without one keeps the scene's assembler.
        overrides: Overridden values of the scene.
    """

    name: str
    scene: str
    description: str
    phases: tuple[PhaseName, ...]
    docking: dict[str, Choice]
    assembly: dict[str, Choice] = field(default_factory=dict)
    overrides: dict[str, str] = field(default_factory=dict)

    def load(self, label: str) -> Scene:
        """Return the scene under one of the controllers, with the perfect calibration that the paper has.

        Raises:
            UnknownNameError: There is no such scene.
            SceneError: It has no overhead camera, or a base station leads it: measured are both phases of the
                last step of a plan whose docks are carried out one by one.
        """
        overrides = {
            "as_built": "perfect",
            **self.overrides,
            "control.docking": json.dumps(self.docking[label].model_dump()),
        }
        if label in self.assembly:
            if load_scene(self.scene).cameras.overhead is None:
                raise SceneError(
                    f"{self.scene}: without an overhead camera it has no long-distance phase; expected a "
                    "mission of both phases, such as two_units"
                )
            overrides["control.assembly"] = json.dumps(self.assembly[label].model_dump())
        scene = load_scene(self.scene, overrides)
        if scene.coordinated:
            raise SceneError(
                f"{scene.name}: a base station leads its units; expected a mission whose plan docks one unit"
                " after the other, such as two_units"
            )
        return scene


def paper_experiments(docking: dict[str, Choice], mission: str = "two_units") -> tuple[Experiment, ...]:
    """Return the experiments of ``msrr reproduce --plant bullet``."""
    both = {label_of(name): Choice(name=name) for name in ("c1", "c2")}
    high_gain = {
        label_of("c1"): Choice(name="c1", params={"feedback": {"k_n_per_s": 6.0}}),
        label_of("c2"): Choice(name="c2", params={"feedback": {"k_per_s": 6.0}}),
    }
    return (
        Experiment("whole mission", mission, f"scene {mission}; {_GUIDANCE}", ("long", "close"), both, both),
        Experiment(
            "hard starts", "close_range_hard", f"scene close_range_hard; {_GUIDANCE}", ("close",), docking
        ),
        Experiment(
            "hard starts, uncompensated",
            "close_range_hard",
            f"scene close_range_hard, whose 100 ms the estimator does not compensate for; {_GUIDANCE}",
            ("close",),
            docking,
            overrides={"control.delay_compensation": "false"},
        ),
        Experiment(
            "high gain",
            "close_range",
            "scene close_range, gain 6 1/s, 100 ms latency that the estimator does not compensate for;"
            f" {_GUIDANCE}",
            ("close",),
            high_gain,
            overrides={"cameras.onboard.latency_ms": "100", "control.delay_compensation": "false"},
        ),
    )


def reproduce_bullet(
    experiments: Iterable[Experiment],
    seeds: range,
    store: Path,
    jobs: int = 1,
    on_progress: ProgressListener = lambda text: None,
) -> Reproduction:
    """Run the experiments; a trial that ``store`` holds from the same scene and code is not run again.

    Each experiment and controller has the same seeds, and ``store`` is an SQLite file. ``on_progress`` is
    called with a line of text whenever a trial is done.

    Raises:
        KeyboardInterrupt: The run was interrupted; all trials computed so far are stored.
        MsrrError: A scene cannot be run, or the program failed in a trial.
    """
    experiments = tuple(experiments)
    forecast = Forecast({e.name: (len(e.docking) * len(seeds), _relative_duration(e)) for e in experiments})
    tables, seconds_by_name = [], {}
    for experiment in experiments:
        began = time.perf_counter()
        trials: dict[str, tuple[MeasuredTrial, ...]] = {}
        for label in experiment.docking:
            counter = TrialCounter(on_progress, forecast, experiment.name, label, len(seeds))
            trials[label] = run_or_fetch_trials(experiment.load(label), seeds, store, jobs, counter)
        seconds_by_name[experiment.name] = round(time.perf_counter() - began, 2)
        tables += [
            Table(
                phase=phase,
                plant="bullet",
                setting=experiment.name,
                description=experiment.description,
                rows=tuple(_row(experiment, label, phase, found) for label, found in trials.items()),
            )
            for phase in experiment.phases
        ]
    return Reproduction(
        versions=package_versions(),
        seeds={"bullet": (seeds.start, seeds.stop)},
        tables=tuple(tables),
        seconds=seconds_by_name,
    )


def _relative_duration(experiment: Experiment) -> float:
    """Return how long a trial takes relative to one of docking alone: the way there is the longer part."""
    return 3.0 if "long" in experiment.phases else 1.0


def run_or_fetch_trials(
    scene: Scene, seeds: range, store: Path, jobs: int, counter: TrialCounter
) -> tuple[MeasuredTrial, ...]:
    """Run a measured trial for each seed, or fetch it from the SQLite file ``store``, in order.

    Raises:
        KeyboardInterrupt: The run was interrupted; all trials computed so far are stored.
        MsrrError: The scene cannot be run, the program failed in a trial, or the code was changed meanwhile.
    """
    counter.report()
    finished = run_trials(
        [(scene, seeds)], jobs, store, trial=measured_trial, result_type=MeasuredTrial, observer=counter.count
    )
    if finished.interrupted:
        raise KeyboardInterrupt
    by_seed = {found.seed: found for found in finished.outcomes.values()}
    trials = []
    for seed in seeds:
        found = by_seed[seed]
        if isinstance(found, TrialFailure):
            raise MsrrError(f"{scene.name}, seed {seed} gave no result: {found.error}")
        assert isinstance(found, MeasuredTrial)
        trials.append(found)
    return tuple(trials)


def _row(experiment: Experiment, label: str, phase: PhaseName, trials: tuple[MeasuredTrial, ...]) -> Row:
    outcomes = {o.value: sum(t.outcome is o for t in trials) for o in Outcome}
    # A trial without an approach never settled, unless its law follows no trajectory. An approach of such a
    # law has an error to the port, and none to the guidance.
    follows = all("final" in t.measures for t in trials if "port" in t.measures)
    measures = {}
    for measure in MEASURES[phase]:
        values = [t.measures.get(measure.key) for t in trials]
        if measure.key == "clearance":
            values = [t.min_clearance_m for t in trials]
        if measure.key == "settling" and not follows:
            values = [None] * len(trials)
        measures[measure.key] = Measured.of([math.nan if v is None else v for v in values])
    flags = {"success": np.array([t.docked for t in trials])}
    if phase == "close":
        # A trial that never came to an approach kept nothing in view.
        flags["in_view"] = np.array([t.kept_in_view is True for t in trials])
        flags["in_cone"] = np.array([t.kept_in_cone is True for t in trials])
    comparable = phase == "long" or follows
    return Row(
        controller=experiment.docking[label].name,
        label=label,
        trials=len(trials),
        **rates_of(**flags),
        measures=measures,
        outcomes={name: n for name, n in outcomes.items() if n},
        met={m.key: _count_met(trials, m) for m in paper_measures((phase,)) if comparable},
        within_paper=sum(within_paper(t, experiment.phases) for t in trials) if comparable else None,
    )


def _count_met(trials: tuple[MeasuredTrial, ...], measure: Measure) -> Count:
    flags = [meets_paper(t, measure) for t in trials]
    return Count(n=sum(flag is True for flag in flags), of=sum(flag is not None for flag in flags))


def meets_paper(trial: MeasuredTrial, measure: Measure) -> bool | None:
    """Return whether a trial meets the paper's value of C1 for one measure; None where it does not apply.

    A path that met no obstacle has neither amplitude nor recovery. A trial that lacks any other measure does
    not meet it.
    """
    value = trial.measures.get(measure.key)
    if value is None:
        return None if measure.key in OBSTACLE_MEASURES and "tracking" in trial.measures else False
    return measure.paper_c1 is not None and value <= measure.paper_c1


def within_paper(trial: MeasuredTrial, phases: tuple[PhaseName, ...]) -> bool:
    """Return whether a trial docked and meets every value that the paper gives of C1 in these phases."""
    return trial.docked and all(meets_paper(trial, m) is not False for m in paper_measures(phases))
