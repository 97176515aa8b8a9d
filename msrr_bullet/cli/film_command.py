"""The command ``msrr film``: a finished run as a film, from its log."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from msrr_bullet.cli.console import open_console, progress_bar
from msrr_bullet.cli.options import Run, check_writable, folder_of, run_or_last
from msrr_bullet.cli.run_commands import warn_of_early_end
from msrr_scenes.errors import SceneError

#: What this command writes into a run folder, unless --out names another place.
FILM_NAME = "film.mp4"

#: What a film can show, by the value of --show.
SHOWN: dict[str, tuple[Literal["scene", "overhead", "onboard"], ...]] = {
    "scene": ("scene",),
    "overhead": ("overhead",),
    "onboard": ("onboard",),
    "cameras": ("overhead", "onboard"),
    "all": ("scene", "overhead", "onboard"),
}


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
    from msrr_bullet.figures.film import write_film
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
    warn_of_early_end(log)
    typer.echo(str(file))


def _parse_size(text: str) -> tuple[int, int]:
    """Parse ``WIDTHxHEIGHT``.

    Raises:
        SceneError: The text is something else.
    """
    width, _, height = text.partition("x")
    if not (width.isdecimal() and height.isdecimal()):
        raise SceneError(f"--size {text}: expected WIDTHxHEIGHT in pixels, such as 1280x720")
    return int(width), int(height)
