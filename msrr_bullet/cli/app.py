"""The command line: ``msrr dock | sweep | scenes | check | bench | replay | frames | plot | export | ...``.

Exit codes: 0 docked or done; 1 not docked, or a replay that differs; 2 bad input, or a file that cannot be
read or written; 70 an error of the program itself; 130 interrupted.
"""

from __future__ import annotations

import signal
import sys
from collections.abc import Sequence
from typing import Annotated, NoReturn

import typer
from rich.console import Console

from msrr_bullet.cli import bench_commands, run_commands, study_commands, trial_commands
from msrr_bullet.cli.exit_codes import BAD_INPUT, ExitCodeGroup, say
from msrr_bullet.cli.options import Overrides, parse_overrides
from msrr_scenes.errors import MsrrError
from msrr_scenes.loading.load import load_scene, scene_hash, shipped_scenes

app = typer.Typer(
    name="msrr",
    cls=ExitCodeGroup,
    help="Docking of mobile robots by what their rendered cameras see.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)


def main() -> None:
    """Entry point of the program."""
    signal.signal(signal.SIGTERM, _terminate)
    sys.exit(run(sys.argv[1:]))


def _terminate(number: int, frame: object) -> NoReturn:
    # An exception, so that every open server, process and file is closed on the way out.
    raise SystemExit(128 + number)


def run(arguments: Sequence[str]) -> int:
    """Run the command line and return its exit code; every expected error becomes one message."""
    try:
        app(list(arguments), prog_name="msrr")
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else 0
    return 0


def _version(wanted: bool) -> None:
    if wanted:
        from msrr_bullet.trial.result import package_versions

        typer.echo("\n".join(f"{name} {version}" for name, version in package_versions().items()))
        raise typer.Exit


@app.callback()
def _program(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Shows versions and exits.")
    ] = False,
) -> None:
    """Docking of mobile robots by what their rendered cameras see."""


app.command()(trial_commands.dock)
app.command()(trial_commands.sweep)


@app.command()
def scenes() -> None:
    """List the shipped scenes."""
    from msrr_bullet.cli.console_report import scenes_table

    Console().print(scenes_table(shipped_scenes()))


@app.command()
def check(
    files: Annotated[
        list[str], typer.Argument(metavar="FILE...", help="Scene files, or names of shipped scenes.")
    ],
    overrides: Overrides = None,
) -> None:
    """Check scene files; the exit code is 2 when one cannot be used."""
    from msrr_control.staging.feasibility import check_assembly

    bad = 0
    for file in files:
        try:
            loaded = load_scene(file, parse_overrides(overrides))
            check_assembly(loaded)
        except MsrrError as error:
            bad = say(str(error), BAD_INPUT)
            continue
        steps = ", then ".join(f"{step.unit}.{step.port} to {step.to}" for step in loaded.plan)
        what = f"{len(loaded.units)} units, {len(loaded.obstacles)} obstacles; {steps}"
        Console().print(
            f"{file}: ok ({what}; {scene_hash(loaded)})", highlight=False, markup=False, soft_wrap=True
        )
    raise typer.Exit(bad)


app.command()(bench_commands.bench)
app.command()(run_commands.replay)
app.command()(study_commands.tune)
app.command()(study_commands.reproduce)
app.command()(run_commands.frames)
app.command()(run_commands.plot)
app.command()(run_commands.export)
