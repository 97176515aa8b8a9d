"""The command ``msrr bench``."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Annotated, Protocol

import typer
from rich.console import Console
from rich.table import Table

from msrr_bullet.cli.options import JsonFile, Overrides, check_writable, parse_overrides, write_json
from msrr_scenes.errors import SceneError
from msrr_scenes.loading.load import load_scene

#: What is measured instead of a scene when it is given one of these names.
CAMERAS = "cameras"
DETECTION = "detection"

Target = Annotated[
    str,
    typer.Argument(metavar="TARGET", help="A scene, or one of: cameras (renderers), detection (settings)."),
]


class _Report(Protocol):
    def to_json(self) -> str: ...


#: Measures, telling what comes next, and returns the report and its tables.
_Bench = Callable[[Callable[[str], None]], tuple[_Report, Iterable[Table]]]


def bench(target: Target, json_file: JsonFile = None, overrides: Overrides = None) -> None:
    """Measure a trial and the naive loop beside it; or the renderers; or the detection's settings."""
    special = {CAMERAS: _cameras, DETECTION: _detection}.get(target)
    if special is not None and overrides:
        raise SceneError(f"msrr bench {target}: --set is for scenes only")
    run = special or _scene(target, parse_overrides(overrides))
    check_writable(json_file)
    from msrr_bullet.pybullet_client import load_simulator

    load_simulator()
    console = Console(stderr=json_file == Path("-"))
    with console.status(f"{target}: measuring") as status:
        report, tables = run(lambda text: status.update(f"{target}: {text}"))
    for table in tables:
        console.print(table)
    write_json(json_file, report.to_json())


def _scene(name: str, overrides: dict[str, str]) -> _Bench:
    scene = load_scene(name, overrides)

    def run(tell: Callable[[str], None]) -> tuple[_Report, Iterable[Table]]:
        from msrr_bullet.bench.trial_speed import measure_trial_speed, trial_speed_table

        report = measure_trial_speed(scene)
        return report, (trial_speed_table(report),)

    return run


def _cameras(tell: Callable[[str], None]) -> tuple[_Report, Iterable[Table]]:
    from msrr_bullet.bench.renderer_benchmark import benchmark_renderers, renderer_tables

    report = benchmark_renderers(observer=tell)
    return report, renderer_tables(report)


def _detection(tell: Callable[[str], None]) -> tuple[_Report, Iterable[Table]]:
    from msrr_bullet.bench.detection_benchmark import benchmark_detection, detection_tables

    report = benchmark_detection(observer=tell)
    return report, detection_tables(report)
