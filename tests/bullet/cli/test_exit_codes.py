"""Exit codes: errors, interrupts, full disks and readers that go away end with one message."""

import contextlib
import ctypes
import errno
import io
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NoReturn

import pytest
import typer

from msrr_bullet.cli.app import run
from msrr_bullet.cli.exit_codes import BAD_INPUT, Terminated, flush_output
from msrr_scenes.errors import SceneError
from msrr_scenes.guarded import Guarded, no_result

Capture = pytest.CaptureFixture[str]


@pytest.fixture(autouse=True)
def terminable(interruptible: None) -> Iterator[None]:
    """Take interrupts, and end on SIGTERM as the command line does."""
    term = signal.signal(signal.SIGTERM, terminate)
    yield
    signal.signal(signal.SIGTERM, term)


def terminate(number: int, frame: object) -> NoReturn:
    raise Terminated(number)


@pytest.mark.parametrize(
    ("error", "code", "message"),
    [
        (KeyboardInterrupt(), 130, "interrupted"),
        (
            OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "runs/x"),
            2,
            "msrr: runs/x: No space left on device",
        ),
        (SceneError("no good"), 2, "msrr: no good"),
        (ZeroDivisionError("oops"), 70, "an error of the program"),
    ],
)
def test_what_ends_a_command_early(
    error: BaseException, code: int, message: str, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: Any, **__: Any) -> NoReturn:
        raise error

    monkeypatch.setattr("msrr_bullet.run.run_trial", fail)
    assert run(["dock", "close_range"]) == code
    err = capsys.readouterr().err
    assert message in err
    assert ("Traceback" in err) is (code == 70)  # a mistake of ours is not hidden


@ctypes.CFUNCTYPE(None, ctypes.c_int)
def interrupted_callback(number: int) -> None:
    """Python cannot raise what is raised here: it is called from C, as by a compiler."""
    signal.raise_signal(number)


def stumbling() -> None:
    raise RuntimeError("no compiled object yet")


def going_on() -> None:
    for _ in range(2000):
        time.sleep(0.01)


@pytest.mark.parametrize(
    ("number", "code", "word"), [(signal.SIGINT, 130, "interrupted"), (signal.SIGTERM, 143, "terminated")]
)
@pytest.mark.parametrize("then", [stumbling, lambda: None, going_on])
def test_a_swallowed_interrupt_is_still_one(
    then: Callable[[], None],
    number: signal.Signals,
    code: int,
    word: str,
    capsys: Capture,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """What comes next fails for want of a result, or ends as if nothing had been, or goes on for long."""

    def swallow(*_: Any, **__: Any) -> NoReturn:
        interrupted_callback(number)
        then()
        raise typer.Exit

    monkeypatch.setattr("msrr_bullet.run.run_trial", swallow)
    before, start = sys.unraisablehook, time.monotonic()
    assert run(["dock", "close_range"]) == code
    assert time.monotonic() - start < 10.0
    message = capsys.readouterr().err
    assert word in message
    assert "Traceback" not in message
    assert sys.unraisablehook is before


def test_an_interrupt_that_was_dealt_with_hides_no_mistake(
    capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    def deal_with(*_: Any, **__: Any) -> NoReturn:
        with contextlib.suppress(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        raise RuntimeError("a mistake")

    monkeypatch.setattr("msrr_bullet.run.run_trial", deal_with)
    assert run(["dock", "close_range"]) == 70
    assert "a mistake" in capsys.readouterr().err


def _need_mounts(folder: Path) -> None:
    """Skip the test where this user may not mount a disk."""
    if _with_full_folder(folder, "true").returncode:
        pytest.skip("no permission to mount a disk")  # containers often forbid it, and no other disk is full


def _with_full_folder(folder: Path, *command: str) -> subprocess.CompletedProcess[str]:
    """Run a command whose temporary files go to a disk with 4 KiB of room, which is mounted for it alone."""
    full = 'mount -t tmpfs -o size=64k none "$TMPDIR" && head -c 60K /dev/zero > "$TMPDIR/x" && exec "$@"'
    return subprocess.run(
        ["unshare", "--map-root-user", "--mount", "sh", "-c", full, "sh", *command],
        env={**os.environ, "TMPDIR": str(folder)},
        capture_output=True,
        text=True,
    )


@pytest.mark.usefixtures("undrawn_runs")
@pytest.mark.parametrize(
    "arguments",
    [
        ["dock", "two_units"],
        pytest.param(
            ["sweep", "close_range", "--seeds", "0:4", "--jobs", "2", "--store", "trials.sqlite"],
            marks=pytest.mark.nightly,
        ),
        pytest.param(["film", "run"], marks=pytest.mark.nightly),
        pytest.param(["frames", "run"], marks=pytest.mark.nightly),
        ["replay", "run"],
    ],
)
def test_a_full_folder_of_temporary_files_is_named_with_what_helps(
    arguments: list[str], short_trial: list[str], tmp_path: Path
) -> None:
    full = tmp_path / "full"
    full.mkdir()
    _need_mounts(full)
    if "run" in arguments:
        assert run(["dock", "close_range", *short_trial, "--out", "run"]) == 1
    done = _with_full_folder(full, sys.executable, "-m", "msrr_bullet", *arguments)
    assert done.returncode == 2
    assert done.stderr == (
        f"msrr: {full}: no room for temporary files (No space left on device); free some, or name"
        " another folder in the environment variable TMPDIR\n"
    )


@pytest.mark.nightly
def test_a_full_folder_of_machine_code_is_named_with_what_helps(
    short_trial: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    _need_mounts(tmp_path)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    done = _with_full_folder(
        tmp_path, sys.executable, "-m", "msrr_bullet", "dock", "close_range", *short_trial
    )
    assert done.returncode == 2
    *_, said = done.stderr.splitlines()
    assert said.startswith(f"msrr: {tmp_path}/kernels-")
    assert "no room for machine code" in said
    assert said.endswith("name another folder in the environment variable NUMBA_CACHE_DIR")


@pytest.mark.parametrize("unbuffered", ["", "1"])
@pytest.mark.parametrize("arguments", [["--help"], ["schema"]])
def test_what_there_is_no_room_for_on_standard_output_is_one_message(
    arguments: list[str], unbuffered: str
) -> None:
    """Python keeps what it could not write, and tries again at exit."""
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "msrr_bullet", *arguments],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            env={**os.environ, "PYTHONUNBUFFERED": unbuffered},
        )
    assert (done.returncode, done.stderr) == (
        2,
        f"msrr: {os.strerror(errno.ENOSPC)}; make room, or name another place\n",
    )


@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_a_reader_that_goes_away_is_no_error(unbuffered: str) -> None:
    process = subprocess.Popen(
        [sys.executable, "-m", "msrr_bullet", "scenes"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env={**os.environ, "PYTHONUNBUFFERED": unbuffered},
    )
    assert process.stdout is not None
    assert process.stderr is not None
    process.stdout.close()
    assert process.stderr.read() == b""
    process.stderr.close()
    assert process.wait(timeout=30) == 1


def test_a_standard_output_that_a_class_has_closed_is_named(
    monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    closed = io.StringIO()
    closed.close()
    monkeypatch.setattr(sys, "stdout", closed)
    assert flush_output(run(["scenes"])) == BAD_INPUT
    error = capsys.readouterr().err
    assert error.startswith("msrr: the standard output was closed before the end")
    assert error.count("\n") == 1


def test_a_link_that_leads_back_to_itself_is_bad_input(tmp_path: Path, capsys: Capture) -> None:
    (tmp_path / "loop.png").symlink_to("loop.png")
    assert run(["detect", str(tmp_path / "loop.png"), "--json", str(tmp_path / "tags.json")]) == 2
    said = capsys.readouterr().err
    assert said == f"msrr: '{tmp_path / 'loop.png'}': a link that leads back to itself; name a file\n"


def test_a_working_folder_that_was_deleted_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    """It said "No such file or directory", and not which."""
    (tmp_path / "gone").mkdir()
    monkeypatch.chdir(tmp_path / "gone")
    (tmp_path / "gone").rmdir()
    assert run(["plot"]) == 2
    assert (
        capsys.readouterr().err == "msrr: the working folder is not there any more; change to another one\n"
    )


def test_a_signal_during_a_call_of_a_user_s_class_is_no_failure_of_that_class(
    capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Terminating:
        def step(self) -> None:
            signal.raise_signal(signal.SIGTERM)

    own = Guarded("controller", "mine:Terminating", Terminating(), {"step": no_result})
    monkeypatch.setattr("msrr_bullet.run.run_trial", lambda *_, **__: own.step())
    assert run(["dock", "close_range"]) == 143
    assert capsys.readouterr().err == "msrr: terminated\n"
