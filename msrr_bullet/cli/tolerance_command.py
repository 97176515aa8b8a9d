"""The command ``msrr tolerance``: what each deviation from the drawing costs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from msrr_bullet.cli.console import open_console, status_line
from msrr_bullet.cli.exit_codes import BAD_INPUT, PROGRAM_ERROR, Terminated, report_error
from msrr_bullet.cli.options import (
    DEFAULT_JOBS,
    RUNS,
    SEEDS_HELP,
    Jobs,
    Overrides,
    SceneName,
    WallLimit,
    naming_overrides,
    parse_overrides,
    parse_seeds,
    use_one_thread_per_process,
)
from msrr_bullet.wall_limit import DEFAULT_WALL_LIMIT_S
from msrr_scenes.errors import SceneError, UnknownNameError
from msrr_scenes.wording import counted

if TYPE_CHECKING:  # loaded by the command, so that msrr --help is quick
    from rich.console import Console

    from msrr_bullet.tolerance.model import ToleranceStudy
    from msrr_scenes.specs.as_built import Grade

#: Number of effects that the table on the console shows.
_SHOWN = 12


def tolerance(
    scene: SceneName,
    seeds: Annotated[
        str, typer.Option(metavar="A:B", help=f"Seeds of each effect alone. {SEEDS_HELP}")
    ] = "0:10",
    grade_seeds: Annotated[
        str, typer.Option(metavar="A:B", help="Seeds of each grade, with everything together.")
    ] = "0:30",
    effects: Annotated[
        str | None,
        typer.Option(
            metavar="NAME,...",
            help="Effects or groups of them, such as drive,onboard.yaw_deg,cameras.",
            show_default="all that act in the scene",
        ),
    ] = None,
    grades: Annotated[
        str | None, typer.Option(metavar="GRADE,...", help="Grades that are tried.", show_default="all")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Folder of page, figure, JSON and trials, from which a stopped study resumes.",
            show_default="runs/tolerance/SCENE-HASH",
        ),
    ] = None,
    jobs: Jobs = DEFAULT_JOBS,
    wall_limit: WallLimit = DEFAULT_WALL_LIMIT_S,
    overrides: Overrides = None,
) -> None:
    """Try each deviation from the drawing alone, and all by grade.

    The report says what to build more precisely first. Ctrl-C ends it after the trials that are running; a
    second one ends it at once.
    """
    from msrr_scenes.loading.load import load_scene, scene_hash

    use_one_thread_per_process()
    given = parse_overrides(overrides)
    with naming_overrides(given):
        loaded = load_scene(scene, given, told_as="--set")
    folder = out if out is not None else RUNS / "tolerance" / f"{loaded.name}-{scene_hash(loaded)[:6]}"
    arguments = {"seeds": parse_seeds(seeds), "grade_seeds": parse_seeds(grade_seeds, "--grade-seeds")}
    if len(arguments["seeds"]) < 2:
        raise SceneError(f"--seeds {seeds}: a study needs two seeds or more, one for each sign of an error")
    wanted = _parse_grades(grades)
    from msrr_bullet.sweep.trial_store import STUDY_STORE
    from msrr_bullet.tolerance.study import run_study

    console = open_console()
    with status_line(console, f"{loaded.name}: checking the effects") as show:
        try:
            study = run_study(
                loaded,
                folder,
                effects=effects.split(",") if effects is not None else (),
                grades=wanted,
                overrides=given,
                jobs=jobs,
                wall_limit_s=wall_limit,
                on_progress=lambda text: show(f"{loaded.name}, {text}"),
                **arguments,
            )
        except (KeyboardInterrupt, Terminated):
            if (store := folder / STUDY_STORE).exists():
                typer.echo(f"The trials so far are in {store}; the same command goes on from there.")
            raise
    _report(console, study)
    typer.echo(f"page: {folder / 'tolerance.html'}")
    if study.failures:
        code = BAD_INPUT if study.only_bad_input else PROGRAM_ERROR
        raise typer.Exit(report_error("\n".join(study.failures), code))
    if failed := study.program_failures:
        text = f"the program of a unit failed in {counted(len(failed), 'trial')}; the first one: {failed[0]}"
        raise typer.Exit(report_error(text, BAD_INPUT))


def _parse_grades(text: str | None) -> list[Grade]:
    """Parse a comma-separated list of grades; None is all of them.

    Raises:
        UnknownNameError: A grade does not exist.
    """
    from msrr_scenes.specs.as_built import GRADES

    if text is None:
        return list(GRADES)
    for name in text.split(","):
        if name not in GRADES:
            raise UnknownNameError("grade", name, GRADES)
    return [grade for grade in GRADES if grade in text.split(",")]


def _report(console: Console, study: ToleranceStudy) -> None:
    """Print the two tables of what the grades have, and the findings."""
    from rich.table import Table

    from msrr_bullet.tolerance import wording
    from msrr_bullet.tolerance.error_budget import contributions

    found = contributions(study)
    together = Table(title=f"{study.scene}, all together", title_justify="left")
    for column in ("grade", "docked", "lateral [mm]", "yaw [deg]", "outcomes"):
        together.add_column(column)
    for sample in study.grades:
        together.add_row(
            sample.grade,
            f"{wording.docked_count(sample)} ({wording.interval(sample.docked)})",
            wording.median_and_95(sample.lateral_mm),
            wording.median_and_95(sample.yaw_deg),
            wording.outcomes(sample),
        )
    first = Table(title=f"{study.scene}, build more precisely first", title_justify="left")
    first.add_column("effect", no_wrap=True)
    for column in ("1 sigma", "docks to, and no longer", "of used up", "adds [mm]"):
        first.add_column(column)
    for contribution in found[:_SHOWN]:
        first.add_row(*wording.first_cells(contribution)[:-1])  # a terminal has no room for the last one
    for table in (together, first):
        if table.row_count:
            console.print(table)
    for text in wording.findings(study, found):
        typer.echo(text)
