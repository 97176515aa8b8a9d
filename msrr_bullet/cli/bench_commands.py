"""The command ``msrr bench``."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import Annotated, Protocol

import typer
from rich.table import Table

from msrr_bullet.cli.console import open_console, status_line
from msrr_bullet.cli.options import JsonFile, Overrides, check_writable, parse_overrides, write_json
from msrr_scenes.errors import SceneError
from msrr_scenes.loading.load import load_scene

Target = Annotated[
    str,
    typer.Argument(
        metavar="TARGET", help="A scene, or cameras (compares renderers), or detection (compares settings)."
    ),
]


class _Report(Protocol):
    def to_json(self) -> str: ...


#: Runs a benchmark, calls its argument with a text before each part, and returns the report and its tables.
_Bench = Callable[[Callable[[str], None]], tuple[_Report, Iterable[Table]]]


def bench(
    target: Target,
    json_file: JsonFile = None,
    overrides: Overrides = None,
    photographs: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Photographs and their tags.txt, for the bench of the detection."),
    ] = None,
) -> None:
    """Measure a trial and the naive loop of the same scene, or the renderers, or the detector's settings."""
    if photographs is not None and target != "detection":
        raise SceneError(f"--photographs: msrr bench {target} reads none, msrr bench detection does")
    named: dict[str, _Bench] = {"cameras": _cameras, "detection": partial(_detection, photographs)}
    benchmark = named.get(target)
    if benchmark is not None and overrides:
        raise SceneError(f"msrr bench {target}: --set applies to scenes only")
    run = benchmark or _scene(target, parse_overrides(overrides))
    check_writable(json_file)
    from msrr_bullet.pybullet_client import load_simulator

    load_simulator()
    console = open_console(stderr=json_file == Path("-"))
    with status_line(console, f"{target}: measuring") as show:
        report, tables = run(lambda text: show(f"{target}: {text}"))
    for table in tables:
        console.print(table)
    write_json(json_file, report.to_json())


def _scene(name: str, overrides: dict[str, str]) -> _Bench:
    scene = load_scene(name, overrides)

    def run(on_progress: Callable[[str], None]) -> tuple[_Report, Iterable[Table]]:
        from msrr_bullet.bench.trial_speed import measure_trial_speed, trial_speed_table

        report = measure_trial_speed(scene)
        return report, (trial_speed_table(report),)

    return run


def _cameras(on_progress: Callable[[str], None]) -> tuple[_Report, Iterable[Table]]:
    from msrr_bullet.bench.renderer_benchmark import benchmark_renderers, renderer_tables

    report = benchmark_renderers(observer=on_progress)
    return report, renderer_tables(report)


def _detection(
    photographs: Path | None, on_progress: Callable[[str], None]
) -> tuple[_Report, Iterable[Table]]:
    from msrr_bullet.bench.detection_benchmark import benchmark_detection, detection_tables

    report = benchmark_detection(photographs=photographs, observer=on_progress)
    return report, detection_tables(report)
