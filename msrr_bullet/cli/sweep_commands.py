"""The command of many trials: ``msrr sweep``."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from msrr_bullet.cli.console import open_console, progress_bar
from msrr_bullet.cli.exit_codes import BAD_INPUT, PROGRAM_ERROR, Terminated, report_error
from msrr_bullet.cli.options import (
    DEFAULT_JOBS,
    MOST_JOBS,
    RUNS,
    SEEDS_HELP,
    STANDARD_OUTPUT,
    JsonFile,
    Overrides,
    SceneName,
    WallLimit,
    check_writable,
    naming_overrides,
    parse_overrides,
    parse_seeds,
    parse_varied,
    use_one_thread_per_process,
    write_outputs,
)
from msrr_bullet.wall_limit import DEFAULT_WALL_LIMIT_S
from msrr_scenes.errors import MsrrError, SceneError
from msrr_scenes.outcome import Outcome
from msrr_scenes.wording import counted

if TYPE_CHECKING:  # loaded by the command, so that msrr --help is quick
    from rich.table import Table

    from msrr_bullet.sweep.summary import SweepSummary, TrialFailure
    from msrr_bullet.sweep.trials import TrialObserver
    from msrr_bullet.trial.result import TrialResult
    from msrr_scenes.specs.scene import Scene

#: File of the results of sweeps, unless ``--store`` names another.
STORE = RUNS / "sweeps.sqlite"


def sweep(
    scene: SceneName,
    seeds: Annotated[
        str, typer.Option(metavar="A:B", help=f"{SEEDS_HELP} A list such as 3,8,15 is possible, too.")
    ] = "0:100",
    jobs: Annotated[
        int | None,
        typer.Option(min=1, max=MOST_JOBS, help="Number of processes.", show_default=str(DEFAULT_JOBS)),
    ] = None,
    json_file: JsonFile = None,
    csv_file: Annotated[
        Path | None,
        typer.Option(
            "--csv",
            metavar="FILE",
            help="Write a table of all trials, with a row for every step, to FILE; - is standard output.",
        ),
    ] = None,
    store: Annotated[
        Path | None,
        typer.Option(
            help="SQLite file of results, from which a stopped sweep resumes.", show_default=str(STORE)
        ),
    ] = None,
    wall_limit: WallLimit = DEFAULT_WALL_LIMIT_S,
    fresh: Annotated[bool, typer.Option("--fresh", help="Use no store, so that every trial is run.")] = False,
    dask: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS",
            help="Run the trials in the workers of this Dask scheduler, not in --jobs processes; local:N "
            "starts N workers here.",
        ),
    ] = None,
    overrides: Overrides = None,
    varied: Annotated[
        list[str] | None,
        typer.Option(
            "--vary",
            metavar="KEY=V1,V2",
            help="Run a sweep with --set KEY=V1, one with KEY=V2, ...; repeated, for all combinations.",
        ),
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Plot rate and error at contact over the values of the first --vary."
        ),
    ] = None,
) -> None:
    """Run many trials and report the success rate with its interval.

    Ctrl-C ends it after the trials that are running; a second one, or SIGTERM, ends it at once. What is done
    is reported.
    """
    use_one_thread_per_process()
    if fresh and store is not None:
        raise SceneError("--fresh and --store: give one of them; --fresh uses no store")
    if dask is not None and jobs is not None:
        raise SceneError("--dask and --jobs: give one of them; --dask local:N starts N workers here")
    if json_file == csv_file == STANDARD_OUTPUT:
        raise SceneError("--json - and --csv -: only one of them can be standard output")
    if plot is not None and not varied:
        raise SceneError("--plot: there is nothing to plot over; give --vary as well")
    wanted = parse_seeds(seeds)
    given = parse_overrides(overrides)
    from msrr_bullet.sweep.variation import Variation, levels, load_levels, values_text

    choices = levels(parse_varied(varied))
    with naming_overrides(given):
        scenes = load_levels(scene, choices, given, told_as="--set", varied_as="--vary")
    kept = None if fresh else store or STORE
    used = [scenes[0].source, kept]
    check_writable(json_file, "--json", used)
    check_writable(csv_file, "--csv", [*used, json_file])
    check_writable(plot, "--plot", [*used, json_file, csv_file])
    if plot is not None:
        from msrr_bullet.sweep.variation_plot import check_plot, plot_variation

        check_plot(choices, plot)
    from msrr_bullet.cli.sweep_report import sweep_table, variation_table
    from msrr_bullet.cli.trial_bar import TrialBar
    from msrr_bullet.sweep.ended_trials import EndedTrials
    from msrr_bullet.sweep.trial_table import trials_csv
    from msrr_scenes.loading.load import scene_hash

    console = open_console(stderr=STANDARD_OUTPUT in (json_file, csv_file))
    ended = EndedTrials(scenes, wanted)
    values = {scene_hash(s): {**given, **choice} for s, choice in zip(scenes, choices, strict=True)}
    labels = [values_text(choice) for choice in choices]
    table: Table | None = None
    try:
        with progress_bar(console) as bar:
            shown = TrialBar(bar, scenes, labels, len(scenes) * len(wanted))

            def observe(outcome: TrialResult | TrialFailure, stored: bool) -> None:
                ended.add(outcome, stored)
                shown.show(outcome, stored)

            interrupted, stopped = _run_trials(
                scenes,
                given,
                shown.checking(scenes, wanted),
                kept,
                dask,
                jobs,
                wall_limit,
                observe,
                partial(bar.console.print, highlight=False),
            )
            if stopped is not None and not ended.outcomes():
                raise stopped
            summaries = ended.summaries(interrupted=interrupted)
            if varied:
                found = Variation.of(choices, summaries)
                numbers, table = found.to_json, variation_table(found, console.width, overrides or ())
            else:
                numbers, table = summaries[0].to_json, sweep_table(summaries[0], overrides or ())
            # Before anything is shown, for the reader of the standard output may have gone away.
            try:
                write_outputs(
                    [(json_file, numbers), (csv_file, lambda: trials_csv(ended.outcomes(), values))]
                )
            finally:
                if plot is not None:
                    plot_variation(found, plot)
    finally:
        if table is not None:
            console.print(table)
    if stopped is not None:
        raise stopped
    _exit(summaries, labels)


def _run_trials(
    scenes: Sequence[Scene],
    overrides: Mapping[str, str],
    batches: Iterable[tuple[Scene, Sequence[int]]],
    store: Path | None,
    dask: str | None,
    jobs: int | None,
    wall_limit_s: float,
    observer: TrialObserver,
    say: Callable[[str], None],
) -> tuple[bool, MsrrError | Terminated | None]:
    """Run the trials of a sweep, in processes or on a cluster.

    Returns:
        Whether not all were run, and what stopped them if it was no interrupt; the trials that have ended
        are kept in either case.
    """
    from msrr_bullet.sensors.preparation import prepare_cameras
    from msrr_bullet.sweep.dask_cluster import dask_cluster
    from msrr_bullet.sweep.trial_store import StoreError
    from msrr_bullet.sweep.trials import run_trials

    run = partial(run_trials, batches, store=store, observer=observer, wall_limit_s=wall_limit_s)
    try:
        with naming_overrides(overrides):
            if dask is not None:
                with dask_cluster(dask) as cluster:
                    finished = run(cluster.slots, executor=cluster.executor)
            else:
                for scene in scenes:
                    prepare_cameras(scene, say)
                finished = run(jobs or DEFAULT_JOBS)
        if finished.outdated:
            results = counted(finished.outdated, "result")
            say(f"not taken from the store, for code or packages have changed since: {results}")
        return finished.interrupted, None
    except StoreError as error:
        return True, StoreError(f"{error} (--store), or none (--fresh)")
    except (Terminated, MsrrError) as error:
        return True, error


def _exit(summaries: Sequence[SweepSummary], labels: Sequence[str]) -> None:
    """End the command with the exit code of a sweep that was not stopped at once; return if all went well.

    Each label tells a scene from the others, in words; that of an only one is empty.
    """
    if any(summary.interrupted for summary in summaries):
        raise KeyboardInterrupt
    failures = [(label, f) for label, s in zip(labels, summaries, strict=True) for f in s.failures]
    for label, failure in failures:
        seed = f"{label}, seed {failure.seed}" if label else f"seed {failure.seed}"
        report_error(f"{seed} gave no result: {failure.error}", PROGRAM_ERROR)
    if failures:
        raise typer.Exit(BAD_INPUT if all(f.bad_input for _, f in failures) else PROGRAM_ERROR)
    trials = sum(summary.trials for summary in summaries)
    if failed := sum(summary.outcomes.get(Outcome.PROGRAM_FAILED.value, 0) for summary in summaries):
        text = f"the program of the unit failed in {failed} of {counted(trials, 'trial')}"
        raise typer.Exit(report_error(f"{text}; msrr dock --seed shows one of them", BAD_INPUT))
