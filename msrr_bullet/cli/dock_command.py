"""The command that runs one trial: ``msrr dock``."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from msrr_bullet.cli.console import open_console, status_line
from msrr_bullet.cli.exit_codes import BAD_INPUT, NOT_DOCKED, report_error
from msrr_bullet.cli.options import (
    RUNS,
    Overrides,
    SceneName,
    WallLimit,
    naming_overrides,
    parse_overrides,
)
from msrr_bullet.cli.run_commands import FILM_NAME, FRAMES_NAME, PLOT_NAME, RERUN_NAME, TABLES_NAME
from msrr_bullet.seeds import MAX_SEED
from msrr_bullet.wall_limit import DEFAULT_WALL_LIMIT_S
from msrr_scenes.outcome import Outcome

if TYPE_CHECKING:  # the commands that need these load them, so that msrr --help is quick
    from rich.console import Console

    from msrr_bullet.log.foxglove_server import FoxgloveServer
    from msrr_bullet.trial.result import TrialResult
    from msrr_bullet.trial.telemetry import Progress
    from msrr_bullet.viewer.live import LiveViewer
    from msrr_scenes.specs.scene import Scene

#: Time after which the live view runs the trial even if no browser has connected [s].
BROWSER_TIMEOUT_S = 20.0


def dock(
    scene: SceneName,
    seed: Annotated[
        int, typer.Option(min=0, max=MAX_SEED, help="Seed of every random number of the trial.")
    ] = 0,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Run folder; a run that is there already gives way to the new one.",
            show_default="runs/SCENE-SEED-HASH",
        ),
    ] = None,
    view: Annotated[bool, typer.Option("--view", help="Show the running trial in a browser.")] = False,
    foxglove: Annotated[
        bool, typer.Option("--foxglove", help="Serve the running trial to Foxglove, on loopback.")
    ] = False,
    wall_limit: WallLimit = DEFAULT_WALL_LIMIT_S,
    overrides: Overrides = None,
) -> None:
    """Run one trial and compare the robot's belief with the truth."""
    from msrr_scenes.loading.load import load_scene, scene_hash

    given = parse_overrides(overrides)
    with naming_overrides(given):
        loaded = load_scene(scene, given, told_as="--set")
    folder = out if out is not None else RUNS / f"{loaded.name}-{seed}-{scene_hash(loaded)[:6]}"
    from msrr_bullet.run import run_trial
    from msrr_bullet.sensors.preparation import prepare_cameras

    console = open_console()
    prepare_cameras(loaded, console.print)
    with naming_overrides(given), ExitStack() as stack:
        viewer = stack.enter_context(_live_view(loaded, seed, console)) if view else None
        listener = stack.enter_context(_foxglove_server()).publish if foxglove else None
        try:
            with status_line(console, f"{loaded.name}: building the world") as show:

                def show_progress(progress: Progress) -> None:
                    show(_progress_line(progress))

                result = run_trial(
                    loaded,
                    seed,
                    out=folder,
                    viewer=viewer,
                    observer=show_progress,
                    wall_limit_s=wall_limit,
                    listener=listener,
                )
            _report(console, result, folder)
        finally:  # also of a trial that was interrupted
            _name_older_files(folder)
        if (view or foxglove) and sys.stdin.isatty():
            with suppress(EOFError):  # of Ctrl-D
                console.input("What is shown stays until you press Enter. ")
    if result.outcome is Outcome.PROGRAM_FAILED:
        raise typer.Exit(report_error(result.reason, BAD_INPUT))
    raise typer.Exit(0 if result.docked else NOT_DOCKED)


@contextmanager
def _live_view(scene: Scene, seed: int, console: Console) -> Iterator[LiveViewer]:
    """Open the live view and wait until a browser shows it, or for a limited time."""
    import webbrowser

    from msrr_bullet.figures.frames.stills import live_stills
    from msrr_bullet.viewer.live import LiveViewer

    with LiveViewer(scene, pace=1.0, drawer=live_stills(scene, seed)) as viewer:
        typer.echo(f"Watch the trial at {viewer.url}")
        webbrowser.open(viewer.url)
        with status_line(console, "waiting for a browser"):
            viewer.wait_for_browser(BROWSER_TIMEOUT_S)
        yield viewer


def _foxglove_server() -> FoxgloveServer:
    """Open a server for Foxglove, for whose connection the trial waits a while."""
    from msrr_bullet.log.foxglove_server import FoxgloveServer

    server = FoxgloveServer()
    typer.echo(f"Foxglove: open a connection to {server.url}")
    return server


def _report(console: Console, result: TrialResult, folder: Path) -> None:
    from msrr_bullet.cli.console_report import mission_table, step_table, steps_table

    step = result.decisive_step
    if len(result.steps) > 1:
        console.print(steps_table(result))
    if step is not None and not (result.mission is not None and step.succeeded):
        console.print(step_table(result, step))
        if step.verdict_reason:
            typer.echo(f"The judge's reason: {step.verdict_reason}")
        typer.echo(f"The robot's reason: {step.belief_reason}")
    if result.mission is not None:
        console.print(mission_table(result, result.mission))
    typer.echo(f"{result.outcome.value}, run folder {folder}")


def _name_older_files(folder: Path) -> None:
    """Name what is older than the log in a run folder, and so was made from another one."""
    from msrr_bullet.log.reader import LOG_NAME

    log = folder / LOG_NAME
    derived = [folder / name for name in (FRAMES_NAME, FILM_NAME, PLOT_NAME, TABLES_NAME, RERUN_NAME)]
    found = [file for file in derived if file.exists() and log.exists()]
    older = [file.name for file in found if file.stat().st_mtime_ns < log.stat().st_mtime_ns]
    if older:
        typer.echo(f"Made from an earlier run in this folder: {', '.join(older)}")


def _progress_line(progress: Progress) -> str:
    position = ""
    if progress.believed is not None:
        position = f", believed to be {-1000.0 * progress.believed.x:z.0f} mm from the target"
    return (
        f"{progress.step.unit} to {progress.step.to}: {progress.time_s:6.2f} s, attempt {progress.attempt}, "
        f"{progress.phase.text}{position}"
    )
