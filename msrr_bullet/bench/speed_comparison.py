"""The cost of one scene against how it was built, and against the number of its units."""

from __future__ import annotations

import os
import platform
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path

from pydantic import BaseModel, ValidationError
from rich.table import Table

from msrr_bullet.bench.trial_speed import BenchError, TrialSpeed, measure_trial_speed
from msrr_bullet.figures.plots.style import new_figure, save, styled
from msrr_bullet.sensors.preparation import prepare_cameras
from msrr_bullet.sweep.spawned_pool import SpawnedPool
from msrr_bullet.trial.versions import package_versions
from msrr_scenes.loading.load import load_scene
from msrr_scenes.specs.scene import Scene

#: Simulated time of the trials that are compared by their number of units [s].
_LINE_S = 20.0

#: Factor by which the cost of a trial, over that of the physics within it, may exceed that of an earlier
#: comparison: beside two programs that only move memory, on two cores, it has been 1.3 times as large.
ALLOWED = 1.4

#: The same factor for the number of calls of functions, which no other program changes: room for what a
#: feature costs, and for other versions of the packages.
ALLOWED_CALLS = 1.05

#: How many runs of a variant are measured at most.
_RUNS = 3


class SpeedComparison(BaseModel, frozen=True):
    """The speed of variants of a scene, measured one after the other, each in a process of its own.

    Attributes:
        scene: Name of the scene.
        machine: Processor and number of cores.
        versions: Versions of the packages.
        variants: Speed of every variant, by the name of the variant.
    """

    scene: str
    machine: str
    versions: dict[str, str]
    variants: dict[str, TrialSpeed]


def read_comparison(path: Path) -> SpeedComparison:
    """Read a comparison as ``msrr bench`` writes it with ``--json``.

    Raises:
        BenchError: The file cannot be read, or holds no comparison.
    """
    try:
        return SpeedComparison.model_validate_json(path.read_text())
    except OSError as error:
        raise BenchError(f"{path}: cannot be read ({error.strerror})") from None
    except (UnicodeDecodeError, ValidationError):
        raise BenchError(f"{path}: no comparison; give a file of msrr bench --grade or --units") from None


def variants_of(
    name: str, overrides: Mapping[str, str], grades: Sequence[str], units: Sequence[int]
) -> dict[str, Scene]:
    """Return the variants of a scene that are to be compared.

    Args:
        name: Name or path of the scene.
        overrides: Values that replace those of the scene.
        grades: Grades of the workmanship; none keeps that of the scene.
        units: Numbers of units; none keeps the scene's. Of so many, its first ones, a base station builds a
            line, and only the first 20 s count.

    Raises:
        BenchError: The scene has fewer units, or they begin assembled.
    """
    variants: dict[str, Scene] = {}
    for grade in grades or (None,):
        graded = {"as_built": grade} if grade else {}
        options = {**dict.fromkeys(overrides, "--set"), **dict.fromkeys(graded, "--grade")}
        scene = load_scene(name, {**overrides, **graded}, told_as=options)
        for number in units or (None,):
            parts = [grade] if grade else []
            if number is not None:
                parts.append(f"{number} units")
            variants[", ".join(parts) or scene.name] = scene if number is None else _line_of(scene, number)
    return variants


def _line_of(scene: Scene, number: int) -> Scene:
    if not 2 <= number <= len(scene.units):
        raise BenchError(
            f"--units {number}: expected from 2 to {len(scene.units)}, the number of units of {scene.name}"
        )
    if scene.assembled:
        raise BenchError(
            f"--units {number}: the units of {scene.name} begin assembled; expected some that stand apart"
        )
    named = list(scene.units)[:number]
    line = {
        "units": {unit: scene.units[unit] for unit in named},
        "shape": {"line": number},
        "plan": (),
        "assembled": (),
        "faults": (),
        "radio": scene.radio or {},
        "time_limit_s": _LINE_S,
    }
    return Scene.model_validate({**dict(scene), **line})


def compare_speeds(
    variants: Mapping[str, Scene], observer: Callable[[str], None], before: SpeedComparison | None = None
) -> SpeedComparison:
    """Measure all variants, each in a process of its own, so that its memory is its own.

    Kernels are compiled here, before: a process that has compiled some is larger, and slower.

    Args:
        variants: Scenes by their names.
        observer: Called with the name of each before it is measured, and with what is compiled.
        before: Earlier comparison. With it, one run of a variant is measured instead of three, and up to two
            more if it costs more than is allowed; the run that cost least counts.

    Raises:
        BenchError: The earlier comparison has none of the variants.
    """
    scene_name = next(iter(variants.values())).name
    if before is not None:
        _common(scene_name, variants, before)
    found: dict[str, TrialSpeed] = {}
    for name, scene in variants.items():
        prepare_cameras(scene, observer)
        observer(name)
        earlier = None if before is None else before.variants.get(name)
        speeds = [_measured(scene, 1 if earlier else _RUNS)]
        while earlier and _takes_longer(speeds[-1], earlier) and len(speeds) < _RUNS:
            observer(f"{name}, again")
            speeds.append(_measured(scene, 1))
        found[name] = min(speeds, key=lambda speed: speed.times_own_physics)
    return SpeedComparison(
        scene=scene_name,
        machine=f"{_processor()}, {os.cpu_count()} cores",
        versions=package_versions(),
        variants=found,
    )


def _measured(scene: Scene, runs: int) -> TrialSpeed:
    with SpawnedPool(1) as pool:
        speed: TrialSpeed = pool.submit(measure_trial_speed, scene, naive=False, runs=runs).result()
        return speed


def _takes_longer(now: TrialSpeed, then: TrialSpeed) -> bool:
    return now.times_own_physics > ALLOWED * then.times_own_physics


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.machine()  # only Linux has that file
    names = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(names, platform.machine())


def comparison_table(found: SpeedComparison, before: SpeedComparison | None = None) -> Table:
    """Return the comparison as a table for a terminal, beside an earlier one if there is one."""
    table = Table(title=f"{found.scene}, seed 0, per simulated second", title_justify="left")
    table.add_column("")
    for name in found.variants:
        table.add_column(name, justify="right")
    for row in stage_rows(found):
        table.add_row(*row)
    table.add_section()
    for row in summary_rows(found, before):
        table.add_row(*row)
    return table


def stage_rows(found: SpeedComparison) -> list[list[str]]:
    """Return a row for every stage of the loop: its name, and its time in each variant."""
    return [
        [stage, *(f"{speed.stages_ms_per_s.get(stage, 0.0):.1f} ms" for speed in found.variants.values())]
        for stage in _stages(found)
    ]


def summary_rows(found: SpeedComparison, before: SpeedComparison | None = None) -> list[list[str]]:
    """Return rows of what all stages together cost in each variant, beside an earlier comparison, if any."""
    speeds = list(found.variants.values())
    rows = [
        ["in all", *(f"{1e3 / s.real_time_factor:.1f} ms" for s in speeds)],
        ["physics alone", *(f"{s.physics_alone_ms_per_s:.1f} ms" for s in speeds)],
        ["over physics alone", *(f"{s.times_physics_alone:.2f}" for s in speeds)],
        ["over physics within it", *(f"{s.times_own_physics:.2f}" for s in speeds)],
        ["calls of functions", *(f"{s.calls_per_s:,.0f}" for s in speeds)],
        ["real time factor", *(f"{s.real_time_factor:.1f}" for s in speeds)],
        ["units under way, on average", *(f"{s.units_under_way:.1f}" for s in speeds)],
        ["memory at its peak", *(f"{s.peak_mb:.0f} MB" for s in speeds)],
    ]
    if before is not None:
        earlier = [before.variants.get(name) for name in found.variants]
        rows.insert(4, ["before", *("-" if e is None else f"{e.times_own_physics:.2f}" for e in earlier)])
    return rows


def slower_than(found: SpeedComparison, before: SpeedComparison) -> list[str]:
    """Return what costs more than in an earlier comparison by more than its factor.

    The factor is :data:`ALLOWED` for the time over that of the physics within the trial, so that the machines
    may differ, and :data:`ALLOWED_CALLS` for the number of calls of functions.

    Raises:
        BenchError: The two have no variant in common.
    """
    slower = []
    for name in _common(found.scene, found.variants, before):
        now, then = (each.variants[name] for each in (found, before))
        costs = []
        if _takes_longer(now, then):
            costs.append(
                f"{now.times_own_physics:.2f} times physics within it, {then.times_own_physics:.2f} before"
            )
        if now.calls_per_s > ALLOWED_CALLS * then.calls_per_s:
            costs.append(f"{now.calls_per_s:,.0f} calls of functions, {then.calls_per_s:,.0f} before")
        slower += [f"{found.scene}, {name}: {cost}" for cost in costs]
    return slower


def _common(scene: str, names: Iterable[str], before: SpeedComparison) -> list[str]:
    common = [name for name in names if name in before.variants]
    if scene != before.scene or not common:
        raise BenchError(
            f"nothing in common with the comparison of {before.scene}: {', '.join(before.variants)}"
        )
    return common


def draw_comparison(found: SpeedComparison, path: Path) -> Path:
    """Draw the stages of every variant as stacked bars, and physics alone as a line, as PNG, PDF or SVG."""
    with styled():
        figure = new_figure(3.5 + 1.1 * len(found.variants), 5.0)
        axes = figure.subplots()
        names, bottom = list(found.variants), [0.0] * len(found.variants)
        for n, stage in enumerate(_stages(found)):
            colour = f"C{n}" if n < 10 else "lightgrey"  # the cycle has ten
            heights = [speed.stages_ms_per_s.get(stage, 0.0) for speed in found.variants.values()]
            axes.bar(names, heights, bottom=bottom, label=stage, width=0.6, color=colour)
            bottom = [b + h for b, h in zip(bottom, heights, strict=True)]
        for i, speed in enumerate(found.variants.values()):
            label = "_nolegend_" if i else "physics alone"
            axes.hlines(speed.physics_alone_ms_per_s, i - 0.4, i + 0.4, colors="black", label=label)
            axes.text(i, bottom[i], f"{speed.real_time_factor:.1f} x", ha="center", va="bottom")
        axes.set_ylabel("wall clock per simulated second [ms]")
        axes.set_title(f"{found.scene}\non the bars: real time factor", loc="left", fontsize="small")
        axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False, reverse=True)
        return save(figure, path)


def _stages(found: SpeedComparison) -> list[str]:
    """Return the stages of all variants, the longest first."""
    stages = {stage for speed in found.variants.values() for stage in speed.stages_ms_per_s}
    return sorted(stages, key=lambda s: -sum(v.stages_ms_per_s.get(s, 0.0) for v in found.variants.values()))
