"""The arguments and options that several commands share, and the functions that read them."""

from __future__ import annotations

import errno
import os
import re
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from msrr_bullet.seeds import MAX_SEED
from msrr_bullet.wall_limit import MAX_WALL_LIMIT_S
from msrr_scenes.errors import MsrrError, SceneError
from msrr_scenes.whole_files import write_named
from msrr_scenes.wording import counted


def scenes_beginning_with(incomplete: str) -> list[str]:
    """Return the shipped scenes that a shell offers; it offers the files itself."""
    from msrr_scenes.loading.load import shipped_scenes

    return [name for name in shipped_scenes() if name.startswith(incomplete)]


SceneName = Annotated[
    str,
    typer.Argument(
        metavar="SCENE",
        help="Name of a shipped scene, or path of a scene file.",
        autocompletion=scenes_beginning_with,
    ),
]
Overrides = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Override a value of the scene; may be repeated."),
]
JsonFile = Annotated[
    Path | None,
    typer.Option("--json", metavar="FILE", help="Write the numbers as JSON to FILE; - is standard output."),
]
WallLimit = Annotated[
    float,
    typer.Option(
        "--wall-limit",
        metavar="SECONDS",
        min=0.1,
        max=MAX_WALL_LIMIT_S,
        help="Time that a trial may take on the wall clock.",
    ),
]
Run = Annotated[
    Path | None,
    typer.Argument(
        metavar="RUN",
        help="Run folder of a trial, or path of its log.",
        show_default="the newest run in runs",
    ),
]
#: Largest number of processes: no machine has more cores.
MOST_JOBS = 4096
Jobs = Annotated[int, typer.Option(min=1, max=MOST_JOBS, help="Number of processes.")]

#: Folder of the run folders, unless ``--out`` names another place.
RUNS = Path("runs")

#: What an option takes for standard output instead of a file.
STANDARD_OUTPUT = Path("-")

#: Where a list of values may lack one, and the commas that show it.
_AT_THE_END = "after the last comma"
_GAPS = {_AT_THE_END: r",\s*$", "before the first comma": r"^\s*,", "between two commas": r",\s*,"}

#: Help of ``--seeds``.
SEEDS_HELP = "Seeds A to B - 1: 0:5 is five trials, 5:6 is seed 5 alone."

#: Largest number of seeds of one command. It bounds the memory that their results take, about 2 kB each.
MAX_SEEDS = 1_000_000

#: Default number of processes: one for each core.
DEFAULT_JOBS = max(1, os.cpu_count() or 1)


def use_one_thread_per_process() -> None:
    """Keep the processes of a pool from starting a thread for each core; call it before numpy is loaded."""
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ.setdefault(name, "1")


def run_or_last(run: Path | None) -> Path:
    """Return the run that was given, or else the one in :data:`RUNS` whose log was written last.

    Raises:
        SceneError: None was given, and there is none.
    """
    if run is not None:
        return run
    from msrr_bullet.log.reader import LOG_NAME

    logs = list(RUNS.glob(f"*/{LOG_NAME}"))
    if not logs:
        raise SceneError(f"{RUNS.absolute()}: no run is here; make one with msrr dock, or name a run folder")
    return max(logs, key=lambda log: log.stat().st_mtime_ns).parent


def folder_of(run: Path) -> Path:
    """Return the folder in which a run lies, which may be given by the path of its log."""
    return run if run.is_dir() else run.parent


def parse_overrides(pairs: Sequence[str] | None, option: str = "--set") -> dict[str, str]:
    """Parse ``KEY=VALUE`` texts of an option into a mapping.

    Raises:
        SceneError: A text has no ``=``, or a key is given twice.
    """
    overrides: dict[str, str] = {}
    for pair in pairs or ():
        key, equals, value = pair.partition("=")
        if not equals or not key:
            raise SceneError(f"{option} {pair}: expected KEY=VALUE, such as cameras.onboard.noise_grey=8")
        if key in overrides:
            raise SceneError(f"{option} {pair}: {key} is already set to {overrides[key]!r}; give it once")
        overrides[key] = value
    return overrides


def parse_varied(pairs: Sequence[str] | None) -> dict[str, list[object]]:
    """Parse ``KEY=VALUE,VALUE,...`` texts into the values of each key; each value is YAML.

    Raises:
        SceneError: A text has no ``=``, its values are not valid YAML, or a key is given twice.
    """
    from msrr_scenes.loading.yaml_document import parse_document

    varied: dict[str, list[object]] = {}
    for pair in pairs or ():
        key, equals, values = pair.partition("=")
        if not equals or not key or not values:
            raise SceneError(
                f"--vary {pair}: expected KEY=VALUE,VALUE, such as cameras.onboard.latency_ms=20,80"
            )
        if key in varied:
            raise SceneError(f"--vary {pair}: {key} is varied already; name all of its values at once")
        gap = next((where for where, commas in _GAPS.items() if re.search(commas, values)), None)
        missing = SceneError(f"--vary {pair}: there is no value {gap}; give one, or leave that comma out")
        try:
            varied[key] = parse_document(f"values: [{values}]", f"--vary {pair}").data["values"]
        except SceneError as error:
            raise error if gap is None else missing from error
        if gap == _AT_THE_END:  # lists of YAML may end with a comma; other gaps that it reads are in texts
            raise missing
    return varied


@contextmanager
def naming_overrides(overrides: Mapping[str, str]) -> Iterator[None]:
    """Let the errors of a scene that do not say so name the values that were set for this run."""
    try:
        yield
    except SceneError as error:
        if not overrides or "--set" in str(error) or "--vary" in str(error):
            raise
        given = " ".join(f"--set {key}={value}" for key, value in overrides.items())
        raise SceneError(f"with {given}: {error}") from error


def parse_seeds(text: str, option: str = "--seeds") -> Sequence[int]:
    """Parse ``A:B`` into the seeds A .. B - 1, and a comma-separated list into the seeds that it names.

    Raises:
        SceneError: The text is neither, or names a seed twice. One number is refused: it could be a seed or a
            number of seeds.
    """
    if "," not in text:
        return parse_seed_range(text, option)
    form = "a list of seeds, such as 3,8,15"
    seeds = tuple(_seed(part, f"{option} {text}", form) for part in text.split(","))
    if len(set(seeds)) < len(seeds):
        raise SceneError(f"{option} {text}: a trial runs once for each seed; name every seed once")
    return seeds


def parse_seed_range(text: str, option: str = "--seeds") -> range:
    """Parse ``A:B`` into the seeds A .. B - 1.

    Raises:
        SceneError: The text is something else, or names too many seeds.
    """
    given, form = f"{option} {text}", "A:B (seeds A to B - 1), such as 0:100"
    first, colon, last = text.partition(":")
    start = _seed(first, given, form)
    if not colon:
        some = f"0:{start} for {counted(start, 'seed')} or " if start > 0 else ""
        one = f"{start}:{start + 1} for seed {start} alone"
        raise SceneError(f"{given}: a single number is ambiguous; give {some}{one}")
    seeds = range(start, _seed(last, given, form))
    if not 0 < seeds.stop - start <= MAX_SEEDS:
        raise SceneError(f"{given}: expected A:B with A < B and at most {MAX_SEEDS} seeds")
    return seeds


def _seed(part: str, given: str, form: str) -> int:
    """Parse one seed of an option that was given, and has to be of a form."""
    try:
        seed = int(part)
    except ValueError:
        raise SceneError(f"{given}: expected {form}, and not {part!r}") from None
    if not 0 <= seed <= MAX_SEED:
        raise SceneError(f"{given}: a seed is a number from 0 to {MAX_SEED}")
    return seed


def check_writable(file: Path | None, option: str = "--json", taken: Iterable[Path | None] = ()) -> None:
    """Refuse a file before the work begins if its result could not be written there.

    None, or ``-`` for standard output, is not checked. ``taken`` are the files that the command reads or
    writes as well.

    Raises:
        SceneError: The file is one of ``taken``, or cannot be written.
    """
    if file is None or file == STANDARD_OUTPUT:
        return
    if file.resolve() in {other.resolve() for other in taken if other is not None}:
        raise SceneError(f"{option} {file}: the command uses this file already; name another one")
    folder = file.resolve().parent  # that of what a link points to
    if file.is_dir() or not folder.is_dir():
        raise SceneError(f"{option} {file}: not a file in an existing folder")
    try:
        if file.is_file() or not file.exists():
            tempfile.TemporaryFile(dir=folder).close()  # the file is replaced as a whole
            if file.exists():
                file.open("r+").close()
        elif not os.access(file, os.W_OK):  # a device or a pipe, which may wait for its other end
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
    except OSError as error:
        text = f"{option} {file}: may not be written ({error.strerror}); name another place"
        raise SceneError(text) from None


def check_no_source(out: Path, images: Iterable[Path]) -> None:
    """Refuse a folder for figures from which pictures are read: a later command would read them as well.

    Raises:
        SceneError: It is one of ``images``.
    """
    if any(given.is_dir() and given.resolve() == out.resolve() for given in images):
        raise SceneError(
            f"--out {out}: pictures are read from there, and a later command would take what is drawn for "
            "one of them; name another folder"
        )


def write_output(file: Path | None, text: str) -> None:
    """Write ``text`` to a file that an option names, to standard output for ``-``, and nowhere for None."""
    if file == STANDARD_OUTPUT:
        sys.stdout.write(text)
    elif file is not None:
        write_named(file, text)


def write_outputs(outputs: Iterable[tuple[Path | None, Callable[[], str]]]) -> None:
    """Write texts as :func:`write_output` does, those to files first; one that fails costs no other one."""
    failed: MsrrError | None = None
    for file, text in sorted(outputs, key=lambda output: output[0] == STANDARD_OUTPUT):
        try:
            if file is not None:
                write_output(file, text())
        except MsrrError as error:
            failed = failed or error
    if failed is not None:
        raise failed
