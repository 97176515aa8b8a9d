"""The command line ``msrr``: the program, its entry point, and the commands ``scenes`` and ``check``.

The exit codes are documented in :mod:`msrr_bullet.cli.exit_codes`.
"""

from __future__ import annotations

import faulthandler
import gc
import json
import os
import re
import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer
from typer.core import TyperGroup

from msrr_bullet.cli import (
    bench_commands,
    calibrate_command,
    detect_command,
    dock_command,
    map_command,
    perceive_command,
    run_commands,
    study_commands,
    sweep_commands,
    sweep_results_commands,
    tolerance_command,
)
from msrr_bullet.cli.console import open_closed_streams, open_console
from msrr_bullet.cli.exit_codes import (
    BAD_INPUT,
    ExitCodeGroup,
    Terminated,
    flush_output,
    os_error_text,
    report_error,
    report_signal,
)
from msrr_bullet.cli.options import (
    Overrides,
    check_writable,
    naming_overrides,
    parse_overrides,
    scenes_beginning_with,
)
from msrr_perception.photographs.opencv_environment import set_opencv_environment
from msrr_scenes.errors import MsrrError
from msrr_scenes.whole_files import write_named
from msrr_scenes.wording import counted

if TYPE_CHECKING:
    from msrr_scenes.specs.scene import Scene

app = typer.Typer(
    name="msrr",
    cls=ExitCodeGroup,
    help="Docking of mobile robots by what their rendered cameras see.",
    no_args_is_help=True,
    rich_markup_mode=None,  # markup would swallow every [default: ...]
    pretty_exceptions_enable=False,
)


#: Time for which Python waits at the end for threads without a word [s].
_SILENT_S = 2.0


def main() -> None:
    """Run the program with the arguments of the process."""
    # Imports make objects that stay. By default the collector looks for garbage among them for every 700 new
    # ones, which takes a tenth of the time of a short command.
    gc.set_threshold(50_000)
    # Pydantic has plugins, for which it reads the metadata of every package that is installed. None is of use
    # here; who wants one sets this to the name of another.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    set_opencv_environment()
    open_closed_streams()
    faulthandler.enable(2, all_threads=False)  # a crash of compiled code names the line that called it
    signal.signal(signal.SIGTERM, _terminate)
    if signal.getsignal(signal.SIGHUP) is signal.SIG_DFL:  # and not of nohup, which wants it ignored
        signal.signal(signal.SIGHUP, _terminate)
    code = flush_output(run(sys.argv[1:]))
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, signal.SIG_DFL)  # from here on there is nothing to save, and no traceback
    waits = threading.Timer(_SILENT_S, _name_threads)
    waits.daemon = True
    waits.start()
    sys.exit(code)


def _name_threads() -> None:
    """Say which threads Python waits for: those that a class of a user's own has started."""
    main_thread = threading.main_thread()
    left = [each.name for each in threading.enumerate() if not each.daemon and each is not main_thread]
    if left:
        report_error(
            f"all is done, but Python waits for {', '.join(left)}, as it does for a thread of a class of "
            "your own that is not started with daemon=True; Ctrl-C ends it",
            0,
        )


def _terminate(number: int, frame: object) -> NoReturn:
    raise Terminated(number)


@cache
def program() -> TyperGroup:
    """Return the program with all its commands, which is made of their signatures once."""
    made = typer.main.get_command(app)
    assert isinstance(made, TyperGroup)
    return made


def run(arguments: Sequence[str]) -> int:
    """Run the command line and return its exit code."""
    # An empty path would be the current folder; a shell gives one for a variable that is not set.
    if any(re.fullmatch("(--[a-z-]+=)?", argument) for argument in arguments):
        return report_error("an argument is empty; give it a value, or leave the option out", BAD_INPUT)
    try:
        program()(list(arguments), prog_name="msrr")
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else 0
    except Terminated as end:
        return report_signal(end.number)
    except OSError as error:  # of the help, which is written before any command is invoked
        return report_error(os_error_text(error), BAD_INPUT)
    return 0


def _show_versions(requested: bool) -> None:
    if requested:
        from msrr_bullet.trial.versions import trial_versions

        typer.echo("\n".join(f"{name} {version}" for name, version in trial_versions().items()))
        raise typer.Exit


@app.callback()
def _program(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_show_versions, is_eager=True, help="Show versions and exit."),
    ] = False,
) -> None:
    """Docking of mobile robots by what their rendered cameras see."""


app.command()(dock_command.dock)
app.command()(sweep_commands.sweep)


@app.command()
def scenes() -> None:
    """List the shipped scenes."""
    from msrr_bullet.cli.console_report import scenes_table
    from msrr_scenes.loading.load import shipped_scenes

    open_console().print(scenes_table(shipped_scenes()))


@app.command()
def check(
    files: Annotated[
        list[str],
        typer.Argument(
            metavar="FILE...",
            help="Scene files, or names of shipped scenes.",
            autocompletion=scenes_beginning_with,
        ),
    ],
    overrides: Overrides = None,
) -> None:
    """Check scene files by building all that a trial needs.

    The exit code is 2 if one cannot be used.
    """
    from msrr_bullet.checks.camera_views import coarse_tags
    from msrr_bullet.trial.check import check_trial
    from msrr_scenes.loading.load import load_scene, scene_hash

    code, given = 0, parse_overrides(overrides)
    for file in files:
        try:
            with naming_overrides(given):
                loaded = load_scene(file, given, told_as="--set")
                check_trial(loaded)
        except MsrrError as error:
            code = report_error(str(error) if len(files) == 1 else _of_file(file, str(error)), BAD_INPUT)
            continue
        bodies = f"{counted(len(loaded.units), 'unit')}, {counted(len(loaded.obstacles), 'obstacle')}"
        typer.echo(
            f"{file}: ok ({bodies}; {_task(loaded)}; as built: {loaded.as_built}; {scene_hash(loaded)})"
        )
        for line in (*_robots(loaded), *coarse_tags(loaded)):
            typer.echo(f"  {line}")
    raise typer.Exit(code)


@app.command()
def schema(
    kind: Annotated[
        str, typer.Argument(metavar="KIND", help="Kind of file: scene, tag_map or target.")
    ] = "scene",
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="File to write.", show_default="standard output")
    ] = None,
) -> None:
    """Write the JSON schema of scenes, tag maps or target files.

    Editors complete and check such files by it. A file names its schema in its first line:
    # yaml-language-server: $schema=scene.schema.json
    """
    from msrr_scenes.loading.file_schema import file_schema

    check_writable(out, "--out")
    text = json.dumps(file_schema(kind), indent=1, ensure_ascii=False) + "\n"
    if out is None:
        typer.echo(text, nl=False)
    else:
        write_named(out, text)


def _of_file(file: str, message: str) -> str:
    """Return a message with the file in the lines whose place is an option, which is given for all files."""
    lines = message.splitlines()
    return "\n".join(f"{file}: {line}" if line.startswith("--set ") else line for line in lines)


def _task(scene: Scene) -> str:
    """Return in words what a scene asks for."""
    if scene.shape is not None:
        return "shape " + ", then ".join(map(str, scene.shape))
    if scene.coordinated:  # units drive at the same time, as far as the order of the steps lets them
        return "; ".join(map(str, scene.plan))
    return ", then ".join(map(str, scene.docks_in_order))


def _robots(scene: Scene) -> Iterator[str]:
    """Yield what each kind of robot measures, so that a mistaken unit is seen."""
    import numpy as np

    from msrr_scenes.geometry.inertial import whole_inertial

    kinds: dict[tuple[object, ...], list[str]] = {}
    for name in scene.units:
        kinds.setdefault((scene.geometry(name).urdf, scene.geometry(name).frame_map), []).append(name)
    for names in kinds.values():
        geometry = scene.geometry(names[0])
        points = np.concatenate([solid.points() for solid in geometry.solids])
        length, width, height = 1e3 * np.ptp(points, axis=0)
        mass = whole_inertial(geometry.link_tree).mass
        wheels = f", wheels {2e3 * geometry.wheel_radius:.0f} mm across, track {1e3 * geometry.track:.0f} mm"
        yield (
            f"{geometry.urdf.name}: {length:.0f} x {width:.0f} x {height:.0f} mm, {mass:.2f} kg"
            f"{wheels if geometry.drives else ''} ({', '.join(names)})"
        )


app.command()(sweep_results_commands.compare)
app.command()(sweep_results_commands.merge)
app.command()(bench_commands.bench)
app.command()(run_commands.replay)
app.command()(study_commands.tune)
app.command()(study_commands.reproduce)
app.command()(tolerance_command.tolerance)
app.command()(detect_command.detect)
app.command()(calibrate_command.calibrate)
app.command("map")(map_command.map_pictures)
app.command()(perceive_command.perceive)
app.command()(run_commands.frames)
app.command()(run_commands.film)
app.command()(run_commands.plot)
app.command()(run_commands.export)
