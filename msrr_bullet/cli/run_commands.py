"""The commands that evaluate a finished run from its log: ``msrr replay | frames | film | plot | export``."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from msrr_bullet.cli.console import open_console, progress_bar, status_line
from msrr_bullet.cli.exit_codes import NOT_DOCKED
from msrr_bullet.cli.options import Run, check_writable, folder_of, run_or_last
from msrr_scenes.errors import SceneError
from msrr_scenes.wording import counted

if TYPE_CHECKING:  # loaded by the commands that read one, so that msrr --help is quick
    from msrr_bullet.log import Log

#: Number of differences that a replay prints.
_SHOWN = 3

#: What these commands write into a run folder, unless --out names another place.
FRAMES_NAME, FILM_NAME, PLOT_NAME = "frames", "film.mp4", "plot.png"
TABLES_NAME, RERUN_NAME = "csv", "trial.rrd"

#: What a film can show, by the value of --show.
SHOWN: dict[str, tuple[Literal["scene", "overhead", "onboard"], ...]] = {
    "scene": ("scene",),
    "overhead": ("overhead",),
    "onboard": ("onboard",),
    "cameras": ("overhead", "onboard"),
    "all": ("scene", "overhead", "onboard"),
}


def replay(
    run: Run = None,
    trust: Annotated[
        bool, typer.Option("--trust", help="Run the code of classes that the log names by import path.")
    ] = False,
) -> None:
    """Run the robots again from a log and compare their commands.

    Perception and control run in a process that cannot import the simulator. The exit code is 1 if a command
    differs, or if the log ends early, as that of a trial that was interrupted or killed.
    """
    run = run_or_last(run)
    from msrr_bullet.replay.isolation import replay_isolated
    from msrr_bullet.trial.versions import trial_versions

    report = replay_isolated(run, trust=trust)
    for mismatch in report.mismatches[:_SHOWN]:
        typer.echo(mismatch)
    if len(report.mismatches) > _SHOWN:
        typer.echo(f"and {counted(len(report.mismatches) - _SHOWN, 'difference')} more")
    counts = ", ".join(
        (
            counted(report.commands, "command"),
            counted(report.windows, "window"),
            counted(report.estimates, "estimate"),
        )
    )
    if report.statuses:
        counts += (
            f", {counted(report.reports, 'report')}; base station: {counted(report.statuses, 'decision')}, "
            f"{report.authorities} authorities"
        )
    verdict = "identical" if report.identical else "different"
    if report.left:
        verdict += f"; compared up to {report.end_s:.3f} s"
    elif not report.complete:
        verdict += f" up to {report.end_s:.3f} s, where the log ends early"
    elif not report.judged:
        verdict += f" up to {report.end_s:.3f} s, where the trial was interrupted"
    typer.echo(f"{run}: {verdict} ({counts})")
    if report.own_classes and not report.identical:
        typer.echo(
            f"{run}: the log holds no code of {', '.join(report.own_classes)}, which may have changed since"
        )
    here = trial_versions()
    other = {name: was for name, was in report.written_with.items() if was != here.get(name)}
    if other and not report.identical:
        then, now = (", ".join(f"{name} {of.get(name, 'none')}" for name in other) for of in (other, here))
        typer.echo(f"{run}: written with {then}; here with {now}, where robots may round or decide otherwise")
    raise typer.Exit(0 if report.identical and report.complete and report.judged else NOT_DOCKED)


@contextmanager
def _open_log(run: Path, doing: str) -> Iterator[Log]:
    """Open the log of a run, with a line that says what is being done; warn at the end if it ends early."""
    from msrr_bullet.log import unpacked_log

    with status_line(open_console(), f"{run}: {doing}"), unpacked_log(run) as log:
        yield log
    _warn_of_early_end(log)


def _warn_of_early_end(log: Log) -> None:
    """Write to standard error where a log ends that is not of a whole trial; it has no more."""
    from msrr_bullet.timeline.log_snapshots import read_verdict
    from msrr_scenes.messages import seconds

    if not log.complete:
        typer.echo(f"{log.path}: the log ends early, at {seconds(log.end_ns()):.3f} s", err=True)
    elif log.header.recording is None and read_verdict(log) is None:
        typer.echo(f"{log.path}: the trial was interrupted at {seconds(log.end_ns()):.3f} s", err=True)


def frames(
    run: Run = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder of the images.", show_default=f"RUN/{FRAMES_NAME}")
    ] = None,
    camera: Annotated[
        Literal["overhead", "onboard", "both"], typer.Option(help="Camera whose frames are written.")
    ] = "both",
    every: Annotated[
        float | None,
        typer.Option(metavar="S", min=0.001, max=1e6, help="Write one frame of each camera every S seconds."),
    ] = None,
    count: Annotated[
        int | None,
        typer.Option(
            metavar="N", min=1, help="Number of frames of each camera, evenly spread.", show_default="8"
        ),
    ] = None,
) -> None:
    """Write camera frames with detections and estimates drawn in."""
    run = run_or_last(run)
    from msrr_bullet.figures.frames.frame_files import write_frames

    folder = out if out is not None else folder_of(run) / FRAMES_NAME
    with _open_log(run, "drawing") as log:
        written = write_frames(log, folder, camera, every_s=every, count=count)
    typer.echo(f"{folder}: {counted(len(written.frames), 'frame')}, {written.sheet.name}")


def film(
    run: Run = None,
    show: Annotated[
        Literal["scene", "overhead", "onboard", "cameras", "all"],
        typer.Option(
            help="What is shown: the scene in three dimensions, what a camera saw with what was detected "
            "in it, what both saw, or all three."
        ),
    ] = "scene",
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="MP4, WebM or GIF file.", show_default=f"RUN/{FILM_NAME}"),
    ] = None,
    speed: Annotated[
        float, typer.Option(metavar="FACTOR", help="Simulated seconds in a second of the film.")
    ] = 1.0,
    size: Annotated[
        str, typer.Option(metavar="WIDTHxHEIGHT", help="Size of the film in pixels, two even numbers.")
    ] = "1280x720",
) -> None:
    """Write a run as a film from its log, 25 pictures a second."""
    pixels = _parse_size(size)
    run = run_or_last(run)
    from msrr_bullet.figures.film.film import write_film
    from msrr_bullet.log import unpacked_log

    file = out if out is not None else folder_of(run) / FILM_NAME
    with unpacked_log(run) as log:
        check_writable(file, "--out")
        shown = SHOWN[show]
        if len(shown) > 1 and log.header.scene.cameras.overhead is None:
            shown = tuple(each for each in shown if each != "overhead")  # all that there is
        with progress_bar(open_console()) as bar:

            def show_picture(done: int, total: int) -> None:
                if done == 1:
                    bar.add_task(str(run), total=total)
                bar.update(bar.task_ids[0], completed=done)

            write_film(log, file, shown, size=pixels, speed=speed, on_picture=show_picture)
    _warn_of_early_end(log)
    typer.echo(str(file))


#: Digits of an edge of a film [px]: more are no size of a picture.
_MOST_DIGITS = 5


def _parse_size(text: str) -> tuple[int, int]:
    """Parse ``WIDTHxHEIGHT``.

    Raises:
        SceneError: The text is something else.
    """
    width, _, height = text.partition("x")
    if not all(edge.isdecimal() and len(edge) <= _MOST_DIGITS for edge in (width, height)):
        raise SceneError(f"--size {text}: expected WIDTHxHEIGHT in pixels, such as 1280x720")
    return int(width), int(height)


def plot(
    run: Run = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="PNG, PDF or SVG file to write.", show_default=f"RUN/{PLOT_NAME}"),
    ] = None,
    unit: Annotated[
        str | None,
        typer.Option(
            metavar="UNIT",
            help="Unit whose steps are shown.",
            show_default="the mission of a base station, or all, or the first of several under way at once",
        ),
    ] = None,
) -> None:
    """Plot a run over time.

    A mission is shown as rows of its units, any other run as errors, speeds, clearance and line of sight.
    """
    run = run_or_last(run)
    from msrr_bullet.figures.plots.run_plot import write_plot
    from msrr_bullet.timeline.log_snapshots import read_snapshots, read_verdict

    file = out if out is not None else folder_of(run) / PLOT_NAME
    with _open_log(run, "drawing") as log:
        check_writable(file, "--out")
        verdict = read_verdict(log) or (None if log.header.recording else "interrupted")
        headline = ", ".join(filter(None, (verdict, log.header.origin)))
        write_plot(file, log.header.scene, read_snapshots(log), headline, unit)
    typer.echo(str(file))


def export(
    run: Run = None,
    as_csv: Annotated[
        bool, typer.Option("--csv", help="Write tables, one for each kind of message.")
    ] = False,
    as_rerun: Annotated[
        bool, typer.Option("--rerun", help="Write a recording of Rerun with a layout of views.")
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Folder of the tables, or file of the recording.",
            show_default=f"RUN/{TABLES_NAME}, RUN/{RERUN_NAME}",
        ),
    ] = None,
) -> None:
    """Write the log of a run as tables, or as a recording of Rerun."""
    if as_csv == as_rerun:
        raise SceneError("give one format: msrr export RUN --csv, or msrr export RUN --rerun")
    run = run_or_last(run)
    from msrr_bullet.export import write_csv
    from msrr_bullet.export.rerun_file import write_rerun

    if as_rerun:
        file = out if out is not None else folder_of(run) / RERUN_NAME
        with _open_log(run, "writing a recording") as log:
            check_writable(file, "--out")
            write_rerun(log, file)
        typer.echo(str(file))
        return
    folder = out if out is not None else folder_of(run) / TABLES_NAME
    with _open_log(run, "writing tables") as log:
        written = write_csv(log, folder)
    typer.echo(f"{folder}: {', '.join(path.name for path in written)}")
