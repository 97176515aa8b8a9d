"""The tolerance study of a scene from the trials to the page."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from msrr_bullet.run_folder import make_folder, progress_log
from msrr_bullet.sweep.trial_store import study_store
from msrr_bullet.tolerance.effects import effects_of, select_effects
from msrr_bullet.tolerance.model import ToleranceStudy
from msrr_bullet.tolerance.page import write_study
from msrr_bullet.tolerance.study import tolerance_study
from msrr_scenes.specs.as_built import GRADES, Grade
from msrr_scenes.specs.scene import Scene


def run_study(
    scene: Scene,
    out: Path,
    *,
    seeds: Sequence[int],
    grade_seeds: Sequence[int],
    effects: Sequence[str] = (),
    grades: Sequence[Grade] = tuple(GRADES),
    jobs: int = 1,
    wall_limit_s: float | None = None,
    on_progress: Callable[[str], None] = lambda text: None,
) -> ToleranceStudy:
    """Run a study; write ``tolerance.html``, ``tolerance.json`` and the figure to ``out``.

    An interrupted study resumes from ``out/trials.sqlite`` if scene and code are unchanged. Every line of
    progress is also written to ``out/progress.txt``, so that a run in the background can be followed.

    Args:
        scene: A checked scene.
        out: Folder to write to; it is created if it does not exist.
        seeds: Seeds of every effect.
        grade_seeds: Seeds of every grade.
        effects: Names of effects or of their groups; without any, all that act in the scene.
        grades: Grades that are tried.
        jobs: Number of processes.
        wall_limit_s: Time that each trial may take on the wall clock; None sets no limit.
        on_progress: Called with a line of text whenever a trial is done.

    Raises:
        StoreError: ``out/trials.sqlite`` is something else.
    """
    known = effects_of(scene)
    chosen = select_effects(known, effects) if effects else known
    make_folder(out)
    store = study_store(out)
    report = progress_log(out, on_progress)
    report("checking the scenes of the first round")
    study = tolerance_study(
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
    write_study(study, out)
    return study
