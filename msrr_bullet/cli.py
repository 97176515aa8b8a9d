"""The command line: ``msrr dock | sweep | scenes | check | bench | replay | frames | plot | export | ...``.

Exit codes: 0 docked or done; 1 not docked, or a replay that differs; 2 bad input, or a file that cannot be
read or written; 70 an error of the program itself; 130 interrupted.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer
from rich.console import Console

from msrr_bullet import run_commands, study_commands
from msrr_bullet.doors import BAD_INPUT, NOT_DOCKED, PROGRAM_ERROR, Doors, say
from msrr_scenes.assets import shipped_scenes
from msrr_scenes.errors import MsrrError, SceneError
from msrr_scenes.load import load_scene, scene_hash
from msrr_scenes.scene import Scene

if TYPE_CHECKING:  # loaded only by the commands that need them: msrr --help has to be quick
    from msrr_bullet.result import TrialResult
    from msrr_bullet.viewer.live import LiveViewer

#: How long the live view waits for a browser before it runs the trial all the same [s].
BROWSER_PATIENCE_S = 20.0

#: What ``msrr bench`` measures instead of a scene when it is given this name.
CAMERAS = "cameras"

app = typer.Typer(
    name="msrr",
    cls=Doors,
    help="Docking of mobile robots by what their rendered cameras see.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)

SceneName = Annotated[str, typer.Argument(metavar="SCENE", help="Name of a shipped scene, or a scene file.")]
Overrides = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Overrides a value of the scene; may be repeated."),
]
JsonFile = Annotated[
    Path | None,
    typer.Option("--json", metavar="FILE", help="Writes the numbers as JSON; - is standard output."),
]


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


def parse_overrides(pairs: Sequence[str] | None) -> dict[str, str]:
    """Turn ``KEY=VALUE`` texts into a mapping.

    Raises:
        SceneError: A text without ``=``, or a key given twice.
    """
    overrides: dict[str, str] = {}
    for pair in pairs or ():
        key, equals, value = pair.partition("=")
        if not equals or not key:
            raise SceneError(f"--set {pair}: expected KEY=VALUE, such as cameras.onboard.noise_grey=8")
        if key in overrides:
            raise SceneError(f"--set {pair}: {key} is already set to {overrides[key]!r}; give it once")
        overrides[key] = value
    return overrides


def parse_seeds(text: str) -> range:
    """Turn ``A:B`` into the seeds A .. B - 1, and ``A`` into one seed.

    Raises:
        SceneError: Anything else.
    """
    first, colon, last = text.partition(":")
    try:
        start = int(first)
        seeds = range(start, int(last) if colon else start + 1)
    except ValueError:
        raise SceneError(f"--seeds {text}: expected A:B (seeds A to B - 1) or one number") from None
    if not seeds or start < 0:
        raise SceneError(f"--seeds {text}: expected A:B with 0 <= A < B")
    return seeds


def _version(wanted: bool) -> None:
    if wanted:
        from msrr_bullet.result import package_versions

        typer.echo("\n".join(f"{name} {version}" for name, version in package_versions().items()))
        raise typer.Exit


@app.callback()
def _program(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Shows versions and exits.")
    ] = False,
) -> None:
    """Docking of mobile robots by what their rendered cameras see."""


@app.command()
def dock(
    scene: SceneName,
    seed: Annotated[int, typer.Option(min=0, help="Determines, with the scene, every bit of the trial.")] = 0,
    out: Annotated[Path | None, typer.Option(help="Run folder [default: runs/SCENE-SEED-HASH].")] = None,
    view: Annotated[bool, typer.Option("--view", help="Shows the running trial in a browser.")] = False,
    overrides: Overrides = None,
) -> None:
    """Run one trial and compare what the robot believed with what was true."""
    loaded = load_scene(scene, parse_overrides(overrides))
    folder = out if out is not None else Path("runs") / f"{loaded.name}-{seed}-{scene_hash(loaded)[:6]}"
    from msrr_bullet.progress import Progress
    from msrr_bullet.simulator import load_simulator

    load_simulator()
    from msrr_bullet.render.prepare import prepare_renderers
    from msrr_bullet.run import run_trial

    console = Console()
    prepare_renderers(loaded, console.print)
    with ExitStack() as stack:
        viewer = stack.enter_context(_shown_in_browser(loaded, console)) if view else None
        with console.status(f"{loaded.name}: building the world") as status:

            def show(progress: Progress) -> None:
                status.update(_live_line(loaded, progress))

            result = run_trial(loaded, seed, out=folder, viewer=viewer, observer=show)
        _report(console, result, folder)
        if view and sys.stdin.isatty():
            console.input("The page stays until you press Enter. ")
    raise typer.Exit(0 if result.docked else NOT_DOCKED)


@contextmanager
def _shown_in_browser(scene: Scene, console: Console) -> Iterator[LiveViewer]:
    """Open the live view and wait a while for somebody to look."""
    import webbrowser

    from msrr_bullet.viewer.live import LiveViewer

    with LiveViewer(scene, pace=1.0) as viewer:
        console.print(f"Watch the trial at {viewer.url}", highlight=False, markup=False, soft_wrap=True)
        webbrowser.open(viewer.url)
        with console.status("waiting for a browser"):
            viewer.wait_for_browser(BROWSER_PATIENCE_S)
        yield viewer


def _report(console: Console, result: TrialResult, folder: Path) -> None:
    from msrr_bullet.report import trial_table

    console.print(trial_table(result))
    console.print(f"The robot says: {result.belief_reason}", highlight=False, markup=False, soft_wrap=True)
    console.print(
        f"{result.outcome.value}, run folder {folder}", highlight=False, markup=False, soft_wrap=True
    )


def _live_line(scene: Scene, progress: Any) -> str:
    step = scene.plan[progress.step]
    where = ""
    if progress.believed is not None:
        where = f", {-1000.0 * progress.believed.x:.0f} mm from the target as it believes"
    return (
        f"{step.unit} to {step.to}: {progress.time_s:6.2f} s, attempt {progress.attempt}, "
        f"{progress.phase.value.replace('_', ' ')}{where}"
    )


@app.command()
def sweep(
    scene: SceneName,
    seeds: Annotated[str, typer.Option(metavar="A:B", help="Seeds A to B - 1.")] = "0:100",
    jobs: Annotated[int, typer.Option(min=1, help="Trials at the same time.")] = max(1, os.cpu_count() or 1),
    json_file: JsonFile = None,
    store: Annotated[Path, typer.Option(help="Keeps results, so that a stopped sweep resumes.")] = Path(
        "runs/sweeps.sqlite"
    ),
    fresh: Annotated[bool, typer.Option("--fresh", help="Uses no store: every trial is run.")] = False,
    overrides: Overrides = None,
) -> None:
    """Run many trials and report rates with their intervals."""
    # Before numpy is loaded in the workers: as many threads as trials, not as trials times cores.
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    wanted = parse_seeds(seeds)
    loaded = load_scene(scene, parse_overrides(overrides))
    _check_writable(json_file)
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    from msrr_bullet.render.prepare import prepare_renderers
    from msrr_bullet.report import sweep_table
    from msrr_bullet.sweep import sweep as run_sweep
    from msrr_bullet.sweep_summary import TrialFailure

    console = Console(stderr=json_file == Path("-"))
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    docked = 0
    with Progress(*columns, console=console) as bar:
        task = bar.add_task(loaded.name, total=len(wanted))

        def tell(found: TrialResult | TrialFailure, stored: bool) -> None:
            nonlocal docked
            if isinstance(found, TrialFailure):
                bar.console.print(f"[red]seed {found.seed}: {found.error}[/]", highlight=False)
            elif found.docked:
                docked += 1
            elif not stored:
                bar.console.print(
                    f"seed {found.seed}: {found.outcome.value}, {found.belief_reason}", highlight=False
                )
            bar.update(task, advance=1, description=f"{loaded.name}, {docked} docked")

        prepare_renderers(loaded, lambda text: bar.console.print(text, highlight=False))
        summary = run_sweep(loaded, wanted, jobs, None if fresh else store, observer=tell)
    console.print(sweep_table(summary))
    _write(json_file, summary.to_json())
    if summary.interrupted:
        raise KeyboardInterrupt
    for failure in summary.failures:
        say(f"seed {failure.seed} gave no result: {failure.error}", PROGRAM_ERROR)
    raise typer.Exit(PROGRAM_ERROR if summary.failures else 0)


@app.command()
def scenes() -> None:
    """List the shipped scenes."""
    from msrr_bullet.report import scenes_table

    Console().print(scenes_table(shipped_scenes()))


@app.command()
def check(
    files: Annotated[
        list[str], typer.Argument(metavar="FILE...", help="Scene files, or names of shipped scenes.")
    ],
    overrides: Overrides = None,
) -> None:
    """Check scene files; the exit code is 2 when one cannot be used."""
    from msrr_control.assembly_checks import check_assembly

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


@app.command()
def bench(scene: SceneName, json_file: JsonFile = None, overrides: Overrides = None) -> None:
    """Measure a trial and the naive loop beside it; with SCENE = cameras, the renderers."""
    if scene == CAMERAS:
        _bench_cameras(json_file)
        return
    loaded = load_scene(scene, parse_overrides(overrides))
    _check_writable(json_file)
    from msrr_bullet.simulator import load_simulator

    load_simulator()
    from msrr_bullet.bench import bench as run_bench
    from msrr_bullet.bench import bench_table

    console = Console(stderr=json_file == Path("-"))
    with console.status(f"{loaded.name}: measuring"):
        report = run_bench(loaded)
    console.print(bench_table(report))
    _write(json_file, report.to_json())


def _bench_cameras(json_file: Path | None) -> None:
    _check_writable(json_file)
    from msrr_bullet.simulator import load_simulator

    load_simulator()
    from msrr_bullet.bench_cameras import bench_cameras, camera_tables

    console = Console(stderr=json_file == Path("-"))
    with console.status("cameras: measuring") as status:
        report = bench_cameras(observer=lambda text: status.update(f"cameras: {text}"))
    for table in camera_tables(report):
        console.print(table)
    _write(json_file, report.to_json())


@app.command()
def replay(
    folder: Annotated[Path, typer.Argument(metavar="RUN", help="Run folder of a trial, or its log.")],
) -> None:
    """Run perception and control again from a log alone, without the simulator, and compare."""
    from msrr_bullet.replay import replay_isolated

    report = replay_isolated(folder)
    console = Console()
    for mismatch in report.mismatches:
        console.print(
            f"{mismatch.time_s:.3f} s, {mismatch.what}: "
            f"logged {mismatch.logged}, replayed {mismatch.replayed}",
            highlight=False,
            markup=False,
            soft_wrap=True,
        )
    counts = f"{report.commands} commands, {report.windows} windows, {report.estimates} estimates"
    verdict = "identical" if report.identical else "different"
    console.print(f"{folder}: {verdict} ({counts})", highlight=False, markup=False, soft_wrap=True)
    raise typer.Exit(0 if report.identical else NOT_DOCKED)


app.command()(study_commands.tune)
app.command()(study_commands.reproduce)
app.command()(run_commands.frames)
app.command()(run_commands.plot)
app.command()(run_commands.export)


def _check_writable(file: Path | None) -> None:
    """Find out before an hour of work that its result could not be written."""
    if file is not None and file != Path("-") and (file.is_dir() or not file.absolute().parent.is_dir()):
        raise SceneError(f"--json {file}: not a file in an existing folder")


def _write(file: Path | None, text: str) -> None:
    if file == Path("-"):
        sys.stdout.write(text)
    elif file is not None:
        file.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
