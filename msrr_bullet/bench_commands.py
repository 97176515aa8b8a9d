"""The command ``msrr bench``."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console

from msrr_bullet.options import JsonFile, Overrides, SceneName, check_writable, parse_overrides, write_json
from msrr_scenes.load import load_scene

#: What ``msrr bench`` measures instead of a scene when it is given this name.
CAMERAS = "cameras"


def bench(scene: SceneName, json_file: JsonFile = None, overrides: Overrides = None) -> None:
    """Measure a trial and the naive loop beside it; with SCENE = cameras, the renderers."""
    if scene == CAMERAS:
        _bench_cameras(json_file)
        return
    loaded = load_scene(scene, parse_overrides(overrides))
    check_writable(json_file)
    from msrr_bullet.simulator import load_simulator

    load_simulator()
    from msrr_bullet.bench import bench as run_bench
    from msrr_bullet.bench import bench_table

    console = Console(stderr=json_file == Path("-"))
    with console.status(f"{loaded.name}: measuring"):
        report = run_bench(loaded)
    console.print(bench_table(report))
    write_json(json_file, report.to_json())


def _bench_cameras(json_file: Path | None) -> None:
    check_writable(json_file)
    from msrr_bullet.simulator import load_simulator

    load_simulator()
    from msrr_bullet.bench_cameras import bench_cameras, camera_tables

    console = Console(stderr=json_file == Path("-"))
    with console.status("cameras: measuring") as status:
        report = bench_cameras(observer=lambda text: status.update(f"cameras: {text}"))
    for table in camera_tables(report):
        console.print(table)
    write_json(json_file, report.to_json())
