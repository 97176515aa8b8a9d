"""The command ``msrr bench``."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeAlias

import typer

from msrr_bullet.cli.console import open_console, status_line
from msrr_bullet.cli.exit_codes import NOT_DOCKED
from msrr_bullet.cli.options import (
    STANDARD_OUTPUT,
    JsonFile,
    Overrides,
    check_writable,
    parse_overrides,
    scenes_beginning_with,
    write_output,
)
from msrr_scenes.errors import SceneError

if TYPE_CHECKING:  # loaded by what makes the tables, so that msrr --help is quick
    from pydantic import BaseModel
    from rich.table import Table

Target = Annotated[
    str,
    typer.Argument(
        metavar="TARGET",
        help="A scene, or cameras (compares renderers), or detection (compares settings).",
        autocompletion=scenes_beginning_with,
    ),
]


#: Runs a benchmark, calls its argument with a text before each part, and returns the report, its tables, and
#: what is worse than it was.
_Bench: TypeAlias = "Callable[[Callable[[str], None]], tuple[BaseModel, Iterable[Table], Sequence[str]]]"


def bench(
    target: Target,
    json_file: JsonFile = None,
    overrides: Overrides = None,
    photographs: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Photographs and their tags.txt, for the bench of the detection."),
    ] = None,
    grades: Annotated[
        list[str] | None,
        typer.Option(
            "--grade", metavar="GRADE", help="Grade of the workmanship to compare; may be repeated."
        ),
    ] = None,
    units: Annotated[
        list[int] | None,
        typer.Option(
            "--units",
            metavar="N",
            help="Number of units to compare: of so many of the scene a line is built; may be repeated.",
        ),
    ] = None,
    plot: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Draw the comparison: a PNG, PDF or SVG file.")
    ] = None,
    against: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Comparison that --json wrote earlier; the exit code is 1 if a trial costs much more now, "
            "over the physics within it.",
        ),
    ] = None,
    profile: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Profile one trial, which is all that is run: an HTML file."),
    ] = None,
) -> None:
    """Measure a trial, the renderers, or the detection of tags.

    A trial is compared with the naive loop of its scene, which reads and searches whole frames; with --grade
    or --units, variants of the scene are compared instead.
    """
    if photographs is not None and target != "detection":
        raise SceneError(f"--photographs: msrr bench {target} reads none, msrr bench detection does")
    named: dict[str, _Bench] = {"cameras": _cameras, "detection": partial(_detection, photographs)}
    benchmark = named.get(target)
    compares = bool(grades or units)
    if benchmark is not None and (overrides or compares or profile):
        raise SceneError(f"msrr bench {target}: --set, --grade, --units and --profile apply to scenes only")
    if (plot or against) and not compares:
        raise SceneError(
            "--plot and --against: expected --grade or --units, which compare variants of a scene"
        )
    if profile and compares:
        raise SceneError("--profile: expected no --grade and no --units; it runs one trial of the scene")
    settings = parse_overrides(overrides)
    taken = [against]
    for option, file in (("--json", json_file), ("--plot", plot), ("--profile", profile)):
        check_writable(file, option, taken)
        taken.append(file)
    if profile is not None:
        _profile(target, settings, profile)
        return
    if compares:
        run = _comparison(target, settings, grades or (), units or (), plot, against)
    else:
        run = benchmark or _scene(target, settings)
    console = open_console(stderr=json_file == STANDARD_OUTPUT)
    with status_line(console, f"{target}: measuring") as show:
        report, tables, worse = run(lambda text: show(f"{target}: {text}"))
    write_output(json_file, report.model_dump_json(indent=2) + "\n")
    for table in tables:
        console.print(table)
    for line in worse:
        console.print(line)
    if worse:
        raise typer.Exit(NOT_DOCKED)


def _comparison(
    name: str,
    overrides: dict[str, str],
    grades: Sequence[str],
    units: Sequence[int],
    plot: Path | None,
    against: Path | None,
) -> _Bench:
    from msrr_bullet.bench import speed_comparison as comparison
    from msrr_bullet.figures.plots.style import check_format

    if plot is not None:
        check_format(plot)
    variants = comparison.variants_of(name, overrides, grades, units)
    before = None if against is None else comparison.read_comparison(against)

    def run(on_progress: Callable[[str], None]) -> tuple[BaseModel, Iterable[Table], Sequence[str]]:
        report = comparison.compare_speeds(variants, on_progress, before)
        if plot is not None:
            comparison.draw_comparison(report, plot)
        slower = () if before is None else comparison.slower_than(report, before)
        return report, (comparison.comparison_table(report, before),), slower

    return run


def _profile(name: str, overrides: dict[str, str], file: Path) -> None:
    """Write where the time of one trial goes."""
    from msrr_bullet.bench.trial_profile import profile_trial
    from msrr_scenes.loading.load import load_scene

    profile_trial(load_scene(name, overrides, told_as="--set"), file)
    open_console().print(f"profile: {file}")


def _scene(name: str, overrides: dict[str, str]) -> _Bench:
    from msrr_scenes.loading.load import load_scene

    scene = load_scene(name, overrides, told_as="--set")

    def run(on_progress: Callable[[str], None]) -> tuple[BaseModel, Iterable[Table], Sequence[str]]:
        from msrr_bullet.bench.trial_speed import measure_trial_speed, trial_speed_table

        report = measure_trial_speed(scene)
        return report, (trial_speed_table(report),), ()

    return run


def _cameras(on_progress: Callable[[str], None]) -> tuple[BaseModel, Iterable[Table], Sequence[str]]:
    from msrr_bullet.bench.renderer_benchmark import benchmark_renderers, renderer_tables

    report = benchmark_renderers(observer=on_progress)
    return report, renderer_tables(report), ()


def _detection(
    photographs: Path | None, on_progress: Callable[[str], None]
) -> tuple[BaseModel, Iterable[Table], Sequence[str]]:
    from msrr_bullet.bench.detection_benchmark import benchmark_detection, detection_tables

    report = benchmark_detection(photographs=photographs, observer=on_progress)
    return report, detection_tables(report), ()
