"""The commands that study controllers: ``msrr tune`` and ``msrr reproduce``."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from typing import Annotated, Literal

import typer

from msrr_bullet.cli.console import open_console, status_line
from msrr_bullet.cli.options import (
    DEFAULT_JOBS,
    SEEDS_HELP,
    Jobs,
    check_writable,
    parse_seed_range,
    use_one_thread_per_process,
)
from msrr_scenes.errors import MsrrError, SceneError
from msrr_scenes.whole_files import write_named

#: Scene of the whole mission of ``msrr reproduce``.
_MISSION = "two_units"


def tune(
    controller: Annotated[
        str, typer.Argument(metavar="CONTROLLER", help="Registered name of the controller, such as c1.")
    ],
    part: Annotated[
        Literal["docking", "assembly"],
        typer.Option(help="Tune the close-range (docking) or the long-distance (assembly) controller."),
    ] = "docking",
    budget: Annotated[int, typer.Option(min=32, help="Number of evaluations of the objective.")] = 240,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the optimiser, the starts and the noise.")] = 0,
    out: Annotated[
        Path | None, typer.Option(help="Scene file to write.", show_default="tuned_CONTROLLER.yaml")
    ] = None,
    jobs: Jobs = DEFAULT_JOBS,
) -> None:
    """Tune a controller's gains on unicycles; write them as a scene.

    The procedure, budget, objective and settings are the same for every controller.
    """
    use_one_thread_per_process()
    from msrr_bullet.studies.tuned_controller import tuned_name, tuned_scene
    from msrr_bullet.studies.tuning import tune as run_tuning
    from msrr_bullet.sweep.spawned_pool import SpawnedPool

    path = out if out is not None else Path(f"{tuned_name(part, controller)}.yaml")
    check_writable(path, "--out")
    pool = SpawnedPool(jobs) if jobs > 1 else None
    with status_line(open_console(), f"{controller}: first generation") as show, pool or nullcontext():

        def show_generation(generation: int, cost: float) -> None:
            show(f"{controller}: generation {generation}, cost {cost:.4f}")

        mapper = pool.map if pool is not None else None
        tuned = run_tuning(controller, part, budget, seed, mapper=mapper, observer=show_generation)
    try:
        write_named(path, tuned_scene(tuned))
    except MsrrError:
        typer.echo(tuned_scene(tuned))  # it took minutes
        raise
    typer.echo(
        f"{controller}: cost {tuned.cost_shipped:.3f} as shipped, {tuned.cost_tuned:.3f} tuned, on starts and"
        f" noise that were not tuned on ({tuned.budget} evaluations). Written to {path}"
    )


def reproduce(
    plant: Annotated[
        Literal["unicycle", "bullet", "both"],
        typer.Option(help="Run on ideal unicycles, in the real loop (bullet), or both."),
    ] = "unicycle",
    seeds: Annotated[
        str | None,
        typer.Option(metavar="A:B", help=SEEDS_HELP, show_default="0:200 for unicycle, 0:100 for bullet"),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder of the report, the figures and the JSON.")] = Path(
        "runs/reproduce"
    ),
    mission: Annotated[
        str | None,
        typer.Option(help="Scene of the whole mission in the real loop.", show_default=_MISSION),
    ] = None,
    jobs: Jobs = DEFAULT_JOBS,
) -> None:
    """Reproduce the paper's experiments and write a report.

    Its figures, and the JSON that they are made from, are written beside it.
    """
    if mission is not None and plant == "unicycle":
        raise SceneError("--mission is for the real loop; give --plant bullet or --plant both as well")
    use_one_thread_per_process()
    from msrr_bullet.reproduce.run import reproduce as run_reproduction

    given = parse_seed_range(seeds) if seeds is not None else None
    with status_line(open_console(), "reproducing") as show:
        results = run_reproduction(
            out,
            unicycle=(given or range(200)) if plant != "bullet" else None,
            bullet=(given or range(100)) if plant != "unicycle" else None,
            jobs=jobs,
            mission=mission or _MISSION,
            on_progress=show,
        )
    from msrr_bullet.reproduce.report.findings import requirements
    from msrr_bullet.reproduce.report.ranking import default_controller_text, ranking_text

    for requirement in requirements(results):
        verdict = "met   " if requirement.met else "MISSED"
        typer.echo(f"{verdict} {requirement.text}: {requirement.result}")
    for text in (ranking_text(results), default_controller_text(results)):
        typer.echo(text)
    typer.echo(f"report: {out / 'report.html'}")
