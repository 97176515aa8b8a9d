"""The commands that run trials: ``msrr dock | sweep``."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console

from msrr_bullet.cli.exit_codes import NOT_DOCKED, PROGRAM_ERROR, say
from msrr_bullet.cli.options import (
    JsonFile,
    Overrides,
    SceneName,
    check_writable,
    parse_overrides,
    parse_seeds,
    write_json,
)
from msrr_scenes.loading.load import load_scene, scene_hash
from msrr_scenes.specs.scene import Scene

if TYPE_CHECKING:  # loaded only by the commands that need them: msrr --help has to be quick
    from msrr_bullet.trial.result import TrialResult
    from msrr_bullet.viewer.live import LiveViewer

#: How long the live view waits for a browser before it runs the trial all the same [s].
BROWSER_PATIENCE_S = 20.0


def dock(
    scene: SceneName,
    seed: Annotated[int, typer.Option(min=0, help="Determines, with the scene, every bit of the trial.")] = 0,
    out: Annotated[Path | None, typer.Option(help="Run folder [default: runs/SCENE-SEED-HASH].")] = None,
    view: Annotated[bool, typer.Option("--view", help="Shows the running trial in a browser.")] = False,
    overrides: Overrides = None,
) -> None:
    """Run one trial and compare what the robot believed with what was true."""
    loaded = load_scene(scene, parse_overrides(overrides))
    folder = out if out is not None else Path("runs") / f"{loaded.name}-{seed}-{scene_hash(loaded)[:6]}"
    from msrr_bullet.pybullet_client import load_simulator
    from msrr_bullet.trial.telemetry import Progress

    load_simulator()
    from msrr_bullet.render import prepare_renderers
    from msrr_bullet.run import run_trial

    console = Console()
    prepare_renderers(loaded, console.print)
    with ExitStack() as stack:
        viewer = stack.enter_context(_shown_in_browser(loaded, console)) if view else None
        with console.status(f"{loaded.name}: building the world") as status:

            def show(progress: Progress) -> None:
                status.update(_live_line(loaded, progress))

            result = run_trial(loaded, seed, out=folder, viewer=viewer, observer=show)
        _report(console, result, folder)
        if view and sys.stdin.isatty():
            console.input("The page stays until you press Enter. ")
    raise typer.Exit(0 if result.docked else NOT_DOCKED)


@contextmanager
def _shown_in_browser(scene: Scene, console: Console) -> Iterator[LiveViewer]:
    """Open the live view and wait a while for somebody to look."""
    import webbrowser

    from msrr_bullet.viewer.live import LiveViewer

    with LiveViewer(scene, pace=1.0) as viewer:
        console.print(f"Watch the trial at {viewer.url}", highlight=False, markup=False, soft_wrap=True)
        webbrowser.open(viewer.url)
        with console.status("waiting for a browser"):
            viewer.wait_for_browser(BROWSER_PATIENCE_S)
        yield viewer


def _report(console: Console, result: TrialResult, folder: Path) -> None:
    from msrr_bullet.cli.console_report import trial_table

    console.print(trial_table(result))
    console.print(f"The robot says: {result.belief_reason}", highlight=False, markup=False, soft_wrap=True)
    console.print(
        f"{result.outcome.value}, run folder {folder}", highlight=False, markup=False, soft_wrap=True
    )


def _live_line(scene: Scene, progress: Any) -> str:
    step = scene.plan[progress.step]
    where = ""
    if progress.believed is not None:
        where = f", {-1000.0 * progress.believed.x:.0f} mm from the target as it believes"
    return (
        f"{step.unit} to {step.to}: {progress.time_s:6.2f} s, attempt {progress.attempt}, "
        f"{progress.phase.value.replace('_', ' ')}{where}"
    )


def sweep(
    scene: SceneName,
    seeds: Annotated[str, typer.Option(metavar="A:B", help="Seeds A to B - 1.")] = "0:100",
    jobs: Annotated[int, typer.Option(min=1, help="Trials at the same time.")] = max(1, os.cpu_count() or 1),
    json_file: JsonFile = None,
    store: Annotated[Path, typer.Option(help="Keeps results, so that a stopped sweep resumes.")] = Path(
        "runs/sweeps.sqlite"
    ),
    fresh: Annotated[bool, typer.Option("--fresh", help="Uses no store: every trial is run.")] = False,
    overrides: Overrides = None,
) -> None:
    """Run many trials and report rates with their intervals."""
    # Before numpy is loaded in the workers: as many threads as trials, not as trials times cores.
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    wanted = parse_seeds(seeds)
    loaded = load_scene(scene, parse_overrides(overrides))
    check_writable(json_file)
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    from msrr_bullet.cli.console_report import sweep_table
    from msrr_bullet.render import prepare_renderers
    from msrr_bullet.sweep.summary import TrialFailure
    from msrr_bullet.sweep.sweep import sweep as run_sweep

    console = Console(stderr=json_file == Path("-"))
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    docked = 0
    with Progress(*columns, console=console) as bar:
        task = bar.add_task(loaded.name, total=len(wanted))

        def tell(found: TrialResult | TrialFailure, stored: bool) -> None:
            nonlocal docked
            if isinstance(found, TrialFailure):
                bar.console.print(f"[red]seed {found.seed}: {found.error}[/]", highlight=False)
            elif found.docked:
                docked += 1
            elif not stored:
                bar.console.print(
                    f"seed {found.seed}: {found.outcome.value}, {found.belief_reason}", highlight=False
                )
            bar.update(task, advance=1, description=f"{loaded.name}, {docked} docked")

        prepare_renderers(loaded, lambda text: bar.console.print(text, highlight=False))
        summary = run_sweep(loaded, wanted, jobs, None if fresh else store, observer=tell)
    console.print(sweep_table(summary))
    write_json(json_file, summary.to_json())
    if summary.interrupted:
        raise KeyboardInterrupt
    for failure in summary.failures:
        say(f"seed {failure.seed} gave no result: {failure.error}", PROGRAM_ERROR)
    raise typer.Exit(PROGRAM_ERROR if summary.failures else 0)
