"""The tolerance study: all that asks for trials asks in rounds, and each round is run in one pool."""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping, Sequence
from pathlib import Path
from typing import Any, get_args

from msrr_bullet.run_folder import ProgressListener, locked, make_folder, progress_log
from msrr_bullet.sweep.summary import TrialFailure
from msrr_bullet.sweep.trial_store import study_store
from msrr_bullet.sweep.trials import one_trial, run_trials
from msrr_bullet.sweep.worker_pool import SupportsSubmit, TrialFunction
from msrr_bullet.tolerance.effects import (
    Effect,
    as_designed_scene,
    effects_of,
    nearly_the_same,
    select_effects,
)
from msrr_bullet.tolerance.model import GradeSample, Sample, Slope, ToleranceStudy
from msrr_bullet.tolerance.page import write_study
from msrr_bullet.tolerance.slopes import ContactQuantity, chance_of
from msrr_bullet.tolerance.trial_plan import Batch, EffectTrials, condition_trials
from msrr_bullet.trial.result import TrialResult
from msrr_bullet.trial.versions import package_versions
from msrr_scenes.loading.load import scene_hash
from msrr_scenes.specs.as_built import GRADES, Grade
from msrr_scenes.specs.scene import Scene

#: What asks for trials: it yields batches, is sent their outcomes in the same order, and returns a result.
Asking = Generator[list[Batch], list[TrialResult | TrialFailure], Any]

#: Outcomes of trials by hash of the scene and seed.
Outcomes = Mapping[tuple[str, int], TrialResult | TrialFailure]


def run_study(
    scene: Scene,
    out: Path,
    *,
    seeds: Sequence[int],
    grade_seeds: Sequence[int],
    effects: Sequence[str] = (),
    grades: Sequence[Grade] = tuple(GRADES),
    overrides: Mapping[str, str] | None = None,
    jobs: int = 1,
    wall_limit_s: float | None = None,
    on_progress: ProgressListener = lambda text: None,
) -> ToleranceStudy:
    """Run a study; write ``tolerance.html``, ``tolerance.json`` and the figure to ``out``.

    An interrupted study resumes from ``out/trials.sqlite`` if scene and code are unchanged. Every line of
    progress is also written to ``out/progress.txt``, so that a run in the background can be followed.

    The folder ``out`` is created if it does not exist; ``effects`` are names of effects or of their groups,
    and without any, all that act in the scene. The report tells the values that were set in the scene,
    ``overrides``, by key. All else is that of :func:`tolerance_study`.

    Raises:
        StoreError: ``out/trials.sqlite`` is something else.
        RunFolderError: The folder cannot be written, or another study is under way in it.
    """
    known = effects_of(scene)
    chosen = select_effects(known, effects) if effects else known
    make_folder(out)
    with locked(out):
        store = study_store(out)
        report = progress_log(out, on_progress)
        report("checking the scenes of the first round")
        found = tolerance_study(
            scene,
            chosen,
            grades,
            seeds=seeds,
            grade_seeds=grade_seeds,
            all_graded={e.name for e in known if e.graded} <= {e.name for e in chosen},
            store=store,
            jobs=jobs,
            wall_limit_s=wall_limit_s,
            on_progress=report,
        )
        study = found.model_copy(update={"overrides": dict(overrides or {})})
        write_study(study, out)
    return study


def tolerance_study(
    scene: Scene,
    effects: Sequence[Effect],
    grades: Sequence[Grade],
    *,
    seeds: Sequence[int],
    grade_seeds: Sequence[int],
    all_graded: bool = True,
    store: Path | None = None,
    jobs: int = 1,
    executor: SupportsSubmit | None = None,
    trial: TrialFunction = one_trial,
    wall_limit_s: float | None = None,
    on_progress: ProgressListener = lambda text: None,
) -> ToleranceStudy:
    """Try each effect alone and all together by grade, on common seeds.

    While effects are tried alone, the robots know the tolerances of the scene, and its cameras have the
    optics of perfect calibration. Under a grade tolerances and optics are those of the grade. Optics that
    the scene itself gives stay in both.

    Args:
        scene: A checked scene.
        effects: Effects that are tried alone.
        grades: Grades that are tried.
        seeds: Seeds of every effect.
        grade_seeds: Seeds of every grade.
        all_graded: Whether the effects are all that the grades have and that act in the scene: only then can
            they be added up to a grade.
        store: SQLite file of results, from which an interrupted study resumes.
        jobs: Number of trials that run at the same time.
        executor: Runs the trials instead of a pool of ``jobs`` processes.
        trial: Runs one trial; importable by name, because it is sent to other processes.
        wall_limit_s: Time that each trial may take on the wall clock; None sets no limit.
        on_progress: Called with a line of text whenever a trial is done.

    Raises:
        KeyboardInterrupt: The study was interrupted; all trials computed so far are in the store.
        MsrrError: A scene cannot be run with any seed, or the store cannot be used.
    """
    base = as_designed_scene(scene)
    seeds, grade_seeds = tuple(dict.fromkeys(seeds)), tuple(dict.fromkeys(grade_seeds))  # each counts once
    asking: list[Asking] = [condition_trials(base, seeds), condition_trials(nearly_the_same(base), seeds)]
    asking += [condition_trials(scene.at_grade(grade), grade_seeds) for grade in grades]
    asking += [EffectTrials(base, effect, seeds).ask() for effect in effects]

    def run(batches: list[Batch], say: Callable[[int, int], str]) -> Outcomes:
        done = reused = 0

        def count(outcome: TrialResult | TrialFailure, stored: bool) -> None:
            nonlocal done, reused
            done, reused = done + 1, reused + stored
            on_progress(say(done, reused))

        finished = run_trials(
            batches,
            jobs,
            store,
            executor=executor,
            trial=trial,
            observer=count,
            wall_limit_s=wall_limit_s,
        )
        if finished.interrupted:
            raise KeyboardInterrupt
        return finished.outcomes

    without, nearly, *others = run_in_rounds(asking, run)
    chance: dict[ContactQuantity, Slope | None] = {
        quantity: chance_of(nearly, without, quantity) for quantity in get_args(ContactQuantity)
    }
    under, alone = others[: len(grades)], others[len(grades) :]
    return ToleranceStudy(
        scene=scene.name,
        scene_hash=scene_hash(scene),
        plant=scene.plant,
        perception=scene.perception,
        told=str(scene.as_built.told()),
        versions=package_versions(),
        all_graded=all_graded,
        seeds=tuple(seeds),
        drawn=Sample.of(without),
        chance_lateral=chance["lateral_mm"],
        chance_yaw=chance["yaw_deg"],
        grades=tuple(GradeSample.of(found, grade=grade) for grade, found in zip(grades, under, strict=True)),
        effects=tuple(trials.result(without, chance) for trials in alone),
    )


def run_in_rounds(
    asking: Sequence[Asking],
    run: Callable[[list[Batch], Callable[[int, int], str]], Outcomes],
) -> list[Any]:
    """Let generators ask for trials until all have returned, and return what they returned, in their order.

    What all of them ask for in one round is run together, so that every process of a pool has work.

    Args:
        asking: The generators.
        run: Runs the batches of one round; returns outcomes by hash of the scene and seed. Its other argument
            puts into words how many trials are done, and how many of these are from the store.
    """
    results: dict[int, Any] = {}
    asked = {i: next(generator) for i, generator in enumerate(asking)}
    number = 0
    while asked:
        number += 1
        batches = [batch for listed in asked.values() for batch in listed]
        wanted = {
            i: [(scene_hash(scene), seed) for scene, seeds in listed for seed in seeds]
            for i, listed in asked.items()
        }
        total = len({key for keys in wanted.values() for key in keys})
        text = f"round {number} for {len(asked)} of {len(asking)} conditions:"
        outcomes = run(batches, f"{text} {{}} of {total} trials, {{}} from the store".format)
        following: dict[int, list[Batch]] = {}
        for i, keys in wanted.items():
            try:
                following[i] = asking[i].send([outcomes[key] for key in keys])
            except StopIteration as end:
                results[i] = end.value
        asked = following
    return [results[i] for i in range(len(asking))]
