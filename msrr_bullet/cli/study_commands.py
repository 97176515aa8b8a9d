"""The commands ``msrr tune`` and ``msrr reproduce``."""

from __future__ import annotations

import os
from concurrent.futures import ProcessPoolExecutor
from contextlib import nullcontext
from enum import StrEnum
from multiprocessing import get_context
from pathlib import Path
from typing import Annotated, Literal

import typer
from rich.console import Console

from msrr_bullet.cli.options import parse_seeds

_JOBS = max(1, os.cpu_count() or 1)

Jobs = Annotated[int, typer.Option(min=1, help="Processes.")]


class Plants(StrEnum):
    """What a reproduction runs on."""

    UNICYCLE = "unicycle"
    BULLET = "bullet"
    BOTH = "both"


class Parts(StrEnum):
    """Which of a unit's two controllers is tuned."""

    DOCKING = "docking"
    ASSEMBLY = "assembly"


def tune(
    controller: Annotated[str, typer.Argument(metavar="CONTROLLER", help="Registered name, such as c1.")],
    part: Annotated[Parts, typer.Option(help="Close-range or long-distance controller.")] = Parts.DOCKING,
    budget: Annotated[int, typer.Option(min=32, help="Evaluations of the objective.")] = 240,
    seed: Annotated[int, typer.Option(min=0, help="Of optimiser, starts and noise.")] = 0,
    out: Annotated[
        Path | None, typer.Option(help="Scene file to write [default: tuned_CONTROLLER.yaml].")
    ] = None,
    jobs: Jobs = _JOBS,
) -> None:
    """Tune a controller's gains on unicycles and write them as a scene file.

    The procedure, budget, objective and settings are the same for every controller.
    """
    _one_thread_each()
    from msrr_bullet.studies.tuned_scenes import tuned_name, tuned_scene
    from msrr_bullet.studies.tuning import tune as run_tuning

    where: Literal["docking", "assembly"] = "docking" if part is Parts.DOCKING else "assembly"
    path = out if out is not None else Path(f"{tuned_name(where, controller)}.yaml")
    console = Console()
    pool = ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) if jobs > 1 else None
    with console.status(f"{controller}: first generation") as status, pool or nullcontext():

        def tell(generation: int, cost: float) -> None:
            status.update(f"{controller}: generation {generation}, cost {cost:.4f}")

        tuned = run_tuning(
            controller, where, budget, seed, mapper=pool.map if pool is not None else None, observer=tell
        )
    path.write_text(tuned_scene(tuned), encoding="utf-8")
    console.print(
        f"{controller}: cost {tuned.cost_shipped:.3f} as shipped, {tuned.cost_tuned:.3f} tuned, on starts and"
        f" noise that were not tuned on ({tuned.budget} evaluations). Written to {path}",
        highlight=False,
        markup=False,
        soft_wrap=True,
    )


def reproduce(
    plant: Annotated[Plants, typer.Option(help="Ideal unicycles, the real loop, or both.")] = Plants.UNICYCLE,
    seeds: Annotated[
        str | None, typer.Option(metavar="A:B", help="Seeds [default: 0:200 unicycle, 0:100 bullet].")
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for report, figures and JSON.")] = Path("runs/reproduce"),
    mission: Annotated[str, typer.Option(help="Scene of the whole mission (bullet).")] = "two_units",
    jobs: Jobs = _JOBS,
) -> None:
    """Reproduce the paper's experiments: report, figures and the JSON they are made from."""
    _one_thread_each()
    from msrr_bullet.reproduce.run import reproduce as run_reproduction

    given = parse_seeds(seeds) if seeds is not None else None
    console = Console()
    with console.status("reproducing") as status:
        found = run_reproduction(
            out,
            unicycle=(given or range(200)) if plant is not Plants.BULLET else None,
            bullet=(given or range(100)) if plant is not Plants.UNICYCLE else None,
            jobs=jobs,
            mission=mission,
            tell=status.update,
        )
    from msrr_bullet.reproduce.report.findings import claims, winner_text

    for claim in claims(found):
        sign = "met   " if claim.met else "MISSED"
        console.print(f"{sign} {claim.text}: {claim.found}", highlight=False, markup=False, soft_wrap=True)
    console.print(winner_text(found), highlight=False, markup=False, soft_wrap=True)
    console.print(f"report: {out / 'report.html'}", highlight=False, markup=False, soft_wrap=True)


def _one_thread_each() -> None:
    # Before numpy is loaded in the workers: as many threads as processes, not as processes times cores.
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ.setdefault(name, "1")
