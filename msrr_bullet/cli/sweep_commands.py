"""The commands of many trials: ``msrr sweep | compare | merge``."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from msrr_bullet.cli.console import open_console, progress_bar
from msrr_bullet.cli.exit_codes import BAD_INPUT, PROGRAM_ERROR, Terminated, report_error
from msrr_bullet.cli.options import (
    DEFAULT_JOBS,
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
    use_one_thread_per_process,
    write_output,
    write_outputs,
)
from msrr_bullet.wall_limit import DEFAULT_WALL_LIMIT_S
from msrr_scenes.errors import ChangedFileError, SceneError
from msrr_scenes.outcome import Outcome
from msrr_scenes.wording import counted

if TYPE_CHECKING:  # loaded by the command, so that msrr --help is quick
    from rich.progress import Progress

    from msrr_bullet.sweep.summary import SweepSummary, TrialFailure
    from msrr_bullet.sweep.trial_store import StoreError
    from msrr_bullet.trial.result import TrialResult
    from msrr_scenes.specs.scene import Scene

#: File of the results of sweeps, unless ``--store`` names another.
STORE = RUNS / "sweeps.sqlite"


class _EndedTrials:
    """The trials that have ended, counted on a bar; what did not succeed is named above it.

    Attributes:
        reused: Number of trials taken from the store.
    """

    def __init__(self, bar: Progress, scene: Scene, trials: int) -> None:
        from msrr_bullet.cli.console_report import goal

        self.reused = 0
        self._bar, self._name, self._goal = bar, scene.name, goal(scene.coordinated)
        self._task = bar.add_task(scene.name, total=trials)
        self._by_seed: dict[int, TrialResult | TrialFailure] = {}
        self._succeeded = 0

    def show(self, outcome: TrialResult | TrialFailure, stored: bool) -> None:
        """Show a trial that has ended; an observer of sweeps."""
        from msrr_bullet.sweep.summary import TrialFailure

        self._by_seed[outcome.seed] = outcome
        self.reused += stored
        if isinstance(outcome, TrialFailure):
            self._print(f"seed {outcome.seed}: {outcome.error}", style="red")
        elif outcome.docked:
            self._succeeded += 1
        else:
            self._print(f"seed {outcome.seed}: {outcome.outcome.value}, {outcome.reason}")
        description = f"{self._name}, {self._succeeded} {self._goal}"
        self._bar.update(self._task, advance=1, description=description)

    def of(self, seeds: Sequence[int]) -> list[TrialResult | TrialFailure]:
        """Return those of some seeds that have ended, in their order."""
        return [self._by_seed[seed] for seed in seeds if seed in self._by_seed]

    def _print(self, text: str, style: str | None = None) -> None:
        # Trials go on where nobody reads of them any more; the table at the end tells of the error.
        with suppress(OSError):
            self._bar.console.print(text, style=style, highlight=False, soft_wrap=True)


def sweep(
    scene: SceneName,
    seeds: Annotated[
        str, typer.Option(metavar="A:B", help=f"{SEEDS_HELP} A list such as 3,8,15 is possible, too.")
    ] = "0:100",
    jobs: Annotated[
        int | None, typer.Option(min=1, help="Number of processes.", show_default=str(DEFAULT_JOBS))
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
) -> None:
    """Run many trials and report the success rate with its interval.

    Ctrl-C ends it after the trials that are running; a second one, or SIGTERM, ends it at once. What is done
    is reported.
    """
    from msrr_scenes.loading.load import load_scene

    use_one_thread_per_process()
    if fresh and store is not None:
        raise SceneError("--fresh and --store: give one of them; --fresh uses no store")
    if dask is not None and jobs is not None:
        raise SceneError("--dask and --jobs: give one of them; --dask local:N starts N workers here")
    if json_file == csv_file == STANDARD_OUTPUT:
        raise SceneError("--json - and --csv -: only one of them can be standard output")
    wanted = parse_seeds(seeds)
    given = parse_overrides(overrides)
    with naming_overrides(given):
        loaded = load_scene(scene, given, told_as="--set")
    kept = None if fresh else store or STORE
    used = [loaded.source, kept]
    check_writable(json_file, "--json", used)
    check_writable(csv_file, "--csv", [*used, json_file])
    from msrr_bullet.cli.console_report import sweep_table
    from msrr_bullet.sensors.preparation import prepare_cameras
    from msrr_bullet.sweep.dask_cluster import dask_cluster
    from msrr_bullet.sweep.provenance import code_fingerprint
    from msrr_bullet.sweep.summarise import summarise
    from msrr_bullet.sweep.sweep import sweep as run_sweep
    from msrr_bullet.sweep.trial_store import StoreError
    from msrr_bullet.sweep.trial_table import trials_csv

    console = open_console(stderr=STANDARD_OUTPUT in (json_file, csv_file))
    code = code_fingerprint(loaded)
    stopped: Terminated | StoreError | ChangedFileError | None = None
    summary: SweepSummary | None = None
    try:
        with progress_bar(console) as bar:
            ended = _EndedTrials(bar, loaded, len(wanted))
            run = partial(run_sweep, loaded, wanted, store=kept, observer=ended.show, wall_limit_s=wall_limit)
            with naming_overrides(given):
                try:
                    if dask is None:
                        prepare_cameras(loaded, lambda text: bar.console.print(text, highlight=False))
                        summary = run(jobs or DEFAULT_JOBS)
                    else:
                        with dask_cluster(dask) as cluster:
                            summary = run(cluster.slots, executor=cluster.executor)
                except (Terminated, StoreError, ChangedFileError) as error:
                    if not ended.of(wanted):
                        raise
                    stopped = error
                    summary = summarise(loaded, code, ended.of(wanted), reused=ended.reused, interrupted=True)
            rows = ended.of(wanted)
            # Before anything is shown, for the reader of the standard output may have gone away.
            write_outputs([(json_file, summary.to_json), (csv_file, lambda: trials_csv(rows))])
    finally:
        if summary is not None:
            console.print(sweep_table(summary, overrides or ()))
    if stopped is not None:
        raise stopped
    _exit(summary)


def _exit(summary: SweepSummary) -> None:
    """End the command with the exit code of a sweep that was not stopped at once; return if all went well."""
    if summary.interrupted:
        raise KeyboardInterrupt
    for failure in summary.failures:
        report_error(f"seed {failure.seed} gave no result: {failure.error}", PROGRAM_ERROR)
    if summary.failures:
        raise typer.Exit(BAD_INPUT if all(f.stopped for f in summary.failures) else PROGRAM_ERROR)
    if failed := summary.outcomes.get(Outcome.PROGRAM_FAILED.value):
        text = f"the program of the unit failed in {failed} of {counted(summary.trials, 'trial')}"
        raise typer.Exit(report_error(f"{text}; msrr dock --seed shows one of them", BAD_INPUT))


def compare(
    first: Annotated[Path, typer.Argument(metavar="FIRST.csv", help="Table by msrr sweep --csv.")],
    second: Annotated[Path, typer.Argument(metavar="SECOND.csv", help="Table of another sweep.")],
    json_file: JsonFile = None,
) -> None:
    """Compare two sweeps over the same seeds, trial by trial.

    What the trials share, such as the start and the robots, cancels out.
    """
    from msrr_bullet.cli.console_report import comparison_table
    from msrr_bullet.sweep.comparison import compare_sweeps

    check_writable(json_file, taken=[first, second])
    comparison = compare_sweeps(first, second)
    names = (first.stem, second.stem) if first.stem != second.stem else (str(first), str(second))
    table = comparison_table(comparison, *names)
    write_output(json_file, comparison.model_dump_json(indent=2) + "\n")
    open_console(stderr=json_file == STANDARD_OUTPUT).print(table)


def merge(
    stores: Annotated[list[Path], typer.Argument(metavar="STORE...", help="Stores of sweeps.")],
    into: Annotated[Path, typer.Option(metavar="FILE", help="Store that gets all their results.")] = Path(
        "runs/sweeps.sqlite"
    ),
) -> None:
    """Put the results of several stores of sweeps into one.

    A sweep with that store then takes them from there.
    """
    from msrr_bullet.sweep.trial_store import TrialStore, check_store

    for path in stores:
        check_store(path)  # before a new store is made of nothing
    with TrialStore(into) as store:
        for path, (added, held) in zip(stores, store.merge(*stores), strict=True):
            typer.echo(f"{path}: {added} results added, {held} were there already")
