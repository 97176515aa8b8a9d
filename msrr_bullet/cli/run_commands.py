"""The commands that look at a finished run, by its log alone: ``msrr replay | frames | plot | export``."""

from __future__ import annotations

from enum import Enum
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from msrr_bullet.cli.exit_codes import NOT_DOCKED
from msrr_scenes.errors import SceneError

Run = Annotated[Path, typer.Argument(metavar="RUN", help="Run folder of a trial, or its log.")]


class CameraChoice(Enum):
    """Whose frames."""

    OVERHEAD = "overhead"
    ONBOARD = "onboard"
    BOTH = "both"


def replay(run: Run) -> None:
    """Run perception and control again from a log alone, without the simulator, and compare."""
    from msrr_bullet.replay import replay_isolated

    report = replay_isolated(run)
    console = Console()
    for mismatch in report.mismatches:
        _tell(
            console,
            f"{mismatch.time_s:.3f} s, {mismatch.what}: "
            f"logged {mismatch.logged}, replayed {mismatch.replayed}",
        )
    counts = f"{report.commands} commands, {report.windows} windows, {report.estimates} estimates"
    verdict = "identical" if report.identical else "different"
    _tell(console, f"{run}: {verdict} ({counts})")
    raise typer.Exit(0 if report.identical else NOT_DOCKED)


def frames(
    run: Run,
    out: Annotated[Path | None, typer.Option(help="Folder for the pictures [default: RUN/frames].")] = None,
    camera: Annotated[CameraChoice, typer.Option(help="Whose frames.")] = CameraChoice.BOTH,
    every: Annotated[
        float | None, typer.Option(metavar="S", min=0.001, help="One frame of each camera every S seconds.")
    ] = None,
    count: Annotated[int, typer.Option(metavar="N", min=1, help="Frames of each camera, spread.")] = 8,
    video: Annotated[bool, typer.Option("--video", help="Also writes the run as film.webm.")] = False,
) -> None:
    """Write camera frames with what the robot made of them drawn on."""
    _quietly()
    from msrr_bullet.figures.frame_files import write_frames
    from msrr_bullet.log import unpacked_log

    folder = out if out is not None else _beside(run) / "frames"
    console = Console()
    with console.status(f"{run}: drawing"), unpacked_log(run) as log:
        written = write_frames(log, folder, camera.value, every_s=every, count=count, film=video)
    film = f", {written.film.name}" if written.film else ""
    _tell(console, f"{folder}: {len(written.frames)} frames, {written.sheet.name}{film}")


def plot(
    run: Run,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="A .png, .pdf or .svg file [default: RUN/plot.png].")
    ] = None,
) -> None:
    """Plot a run's time series: errors, velocities, clearance, line of sight; belief on truth."""
    _quietly()
    from msrr_bullet.figures.plot import write_plot
    from msrr_bullet.log import unpacked_log
    from msrr_bullet.timeline.log_snapshots import read_snapshots, read_verdict

    file = out if out is not None else _beside(run) / "plot.png"
    console = Console()
    with console.status(f"{run}: drawing"), unpacked_log(run) as log:
        headline = f"{read_verdict(log) or 'broken off'}, seed {log.header.seed}"
        write_plot(file, log.header.scene, read_snapshots(log), headline)
    _tell(console, str(file))


def export(
    run: Run,
    as_csv: Annotated[bool, typer.Option("--csv", help="As CSV files, the one format there is.")] = False,
    out: Annotated[Path | None, typer.Option(help="Folder for the tables [default: RUN/csv].")] = None,
) -> None:
    """Write a run's log as tables: one for each kind of message."""
    if not as_csv:
        raise SceneError("say in which format: msrr export RUN --csv")
    from msrr_bullet.export import write_csv
    from msrr_bullet.log import unpacked_log

    folder = out if out is not None else _beside(run) / "csv"
    console = Console()
    with console.status(f"{run}: writing tables"), unpacked_log(run) as log:
        written = write_csv(log, folder)
    _tell(console, f"{folder}: {', '.join(path.name for path in written)}")


def _quietly() -> None:
    """Load the simulator, whose shapes and tags the pictures borrow, before it can print its greeting."""
    from msrr_bullet.pybullet_client import load_simulator

    load_simulator()


def _beside(run: Path) -> Path:
    return run if run.is_dir() else run.parent


def _tell(console: Console, text: str) -> None:
    console.print(text, highlight=False, markup=False, soft_wrap=True)
