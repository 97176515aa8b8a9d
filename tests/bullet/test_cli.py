"""The command line: what it says, what it leaves, and its exit codes."""

import contextlib
import ctypes
import errno
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn

import pytest
import typer

from msrr_bullet.cli.app import run
from msrr_bullet.cli.options import parse_overrides, parse_seeds
from msrr_bullet.trial.result import TrialResult
from msrr_scenes.errors import SceneError
from msrr_scenes.loading.load import shipped_scenes

Capture = pytest.CaptureFixture[str]

#: A real trial that takes no time: the loop with a kinematic plant and no pixels, for one simulated second.
SHORT = ["--set", "plant=unicycle", "--set", "perception=parametric", "--set", "time_limit_s=1"]


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "120")


def test_help_and_version(capsys: Capture) -> None:
    assert run(["--help"]) == 0
    for command in ("dock", "sweep", "scenes", "check", "bench", "replay"):
        assert command in capsys.readouterr().out or run([command, "--help"]) == 0
    assert run(["--version"]) == 0
    assert "pybullet" in capsys.readouterr().out


def test_scenes_are_listed(capsys: Capture) -> None:
    assert run(["scenes"]) == 0
    out = capsys.readouterr().out
    for name in shipped_scenes():
        assert name in out


def test_check(capsys: Capture, tmp_path: Path) -> None:
    assert run(["check", "close_range"]) == 0
    assert "close_range: ok (2 units, 0 obstacles; a.front to b.rear" in capsys.readouterr().out
    (tmp_path / "bad.yaml").write_text("units: {}\n")
    assert run(["check", "bad.yaml", "close_range"]) == 2  # one is bad, the other is still checked
    out, err = capsys.readouterr()
    assert err.startswith("msrr: bad.yaml:1: ")
    assert "close_range: ok" in out


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["dock", "close_rang"], "did you mean 'close_range'?"),
        (["dock", "no/such.yaml"], "no/such.yaml: no such scene file"),
        (["dock", "close_range", "--set", "los.inner_deg"], "expected KEY=VALUE"),
        (["dock", "close_range", "--set", "los.iner_deg=3"], "did you mean 'inner_deg'?"),
        (["dock", "close_range", "--set", "name=a", "--set", "name=b"], "give it once"),
        (["dock", "close_range", "--seed", "-1"], "--seed"),
        (["dock", "close_range", "--seed", "one"], "--seed"),
        (["dock"], "SCENE"),
        (["dok", "close_range"], "dok"),
        (["sweep", "close_range", "--seeds", "4:4"], "0 <= A < B"),
        (["sweep", "close_range", "--seeds", "a:b"], "expected A:B"),
        (["sweep", "close_range", "--jobs", "0"], "--jobs"),
        (["sweep", "close_range", "--json", "no/such/folder.json"], "not a file in an existing folder"),
        (["bench", "close_range", "--json", "."], "not a file in an existing folder"),
        (["check", "."], "unknown scene '.'"),
        (["replay", "no/such/run"], "no/such/run"),
        (["dock", "close_range", *SHORT, "--set", "control.docking=c9"], "unknown controller 'c9'"),
        (["dock", "close_range", *SHORT, "--set", "control.docking=no.such:Law"], "no.such"),
        (["dock", "close_range", *SHORT, "--set", "control.docking.params.gian=1"], "gian"),
    ],
)
def test_bad_input_is_one_message_and_code_2(arguments: list[str], says: str, capsys: Capture) -> None:
    assert run(arguments) == 2
    out, err = capsys.readouterr()
    assert says in err
    assert "Traceback" not in err
    assert out == ""


def test_dock_leaves_a_run_folder_and_tells_belief_from_truth(tmp_path: Path, capsys: Capture) -> None:
    assert run(["dock", "close_range", "--seed", "3", *SHORT]) == 1  # one second is not enough
    out = capsys.readouterr().out
    assert "belief" in out
    assert "truth" in out
    assert "timeout, run folder runs/close_range-3-" in out
    (folder,) = (tmp_path / "runs").iterdir()
    result = TrialResult.from_json((folder / "result.json").read_text())
    assert (result.scene, result.seed, result.outcome.value) == ("close_range", 3, "timeout")
    assert (folder / "trial.mcap").stat().st_size > 0


def test_the_same_trial_goes_to_the_same_folder(tmp_path: Path) -> None:
    for _ in range(2):
        run(["dock", "close_range", *SHORT])
    run(["dock", "close_range", *SHORT, "--set", "los.inner_deg=21"])
    assert len(list((tmp_path / "runs").iterdir())) == 2


def test_sweep_writes_the_numbers(tmp_path: Path, capsys: Capture) -> None:
    arguments = ["sweep", "close_range", *SHORT, "--seeds", "0:2", "--jobs", "1"]
    assert run([*arguments, "--json", "numbers.json"]) == 0
    numbers = json.loads((tmp_path / "numbers.json").read_text())
    assert numbers["trials"] == 2
    assert numbers["outcomes"] == {"timeout": 2}
    assert set(numbers["success"]) == {"rate", "low", "high"}
    for key in ("contact_lateral_mm", "contact_yaw_deg", "seated_axial_mm", "attempts"):
        assert set(numbers[key]) == {"p50", "p95", "max"}
    assert {"min_clearance_m", "false_docks", "redraws"} <= set(numbers)
    capsys.readouterr()
    assert run([*arguments, "--json", "-"]) == 0  # the table gives way to the numbers
    again = json.loads(capsys.readouterr().out)
    assert again == {**numbers, "reused": 2}


@pytest.mark.parametrize(
    ("error", "code", "says"),
    [
        (KeyboardInterrupt(), 130, "interrupted"),
        (OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "runs/x"), 2, "No space left on device: 'runs/x'"),
        (SceneError("no good"), 2, "msrr: no good"),
        (ZeroDivisionError("oops"), 70, "an error of the program"),
    ],
)
def test_what_ends_a_command_early(
    error: BaseException, code: int, says: str, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: Any, **__: Any) -> NoReturn:
        raise error

    monkeypatch.setattr("msrr_bullet.run.run_trial", fail)
    assert run(["dock", "close_range"]) == code
    err = capsys.readouterr().err
    assert says in err
    assert ("Traceback" in err) is (code == 70)  # a mistake of ours is not hidden


@ctypes.CFUNCTYPE(None)
def interrupted_callback() -> None:
    """Python cannot raise what is raised here: it is called from C, as by a compiler."""
    signal.raise_signal(signal.SIGINT)


def stumbling() -> None:
    raise RuntimeError("no compiled object yet")


def going_on() -> None:
    for _ in range(2000):
        time.sleep(0.01)


@pytest.mark.parametrize("then", [stumbling, lambda: None, going_on])
def test_a_swallowed_interrupt_is_still_one(
    then: Callable[[], None], capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What comes next fails for want of a result, or ends as if nothing had been, or goes on for long."""

    def swallow(*_: Any, **__: Any) -> NoReturn:
        interrupted_callback()
        then()
        raise typer.Exit

    monkeypatch.setattr("msrr_bullet.run.run_trial", swallow)
    before, start = sys.unraisablehook, time.monotonic()
    assert run(["dock", "close_range"]) == 130
    assert time.monotonic() - start < 10.0
    said = capsys.readouterr().err
    assert "interrupted" in said
    assert "Traceback" not in said
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


def test_a_full_disk_is_one_message(capsys: Capture) -> None:
    if not Path("/dev/full").exists():
        pytest.skip("no /dev/full on this system")
    assert run(["sweep", "close_range", *SHORT, "--seeds", "0", "--jobs", "1", "--json", "/dev/full"]) == 2
    err = capsys.readouterr().err
    assert "No space left on device" in err
    assert "Traceback" not in err


def test_overrides_and_seeds() -> None:
    assert parse_overrides(["a.b=1", "c=x=y", "d="]) == {"a.b": "1", "c": "x=y", "d": ""}
    assert parse_overrides(None) == {}
    assert parse_seeds("3:6") == range(3, 6)
    assert parse_seeds("7") == range(7, 8)


def test_the_program_starts_without_the_simulator() -> None:
    code = (
        "import sys, msrr_bullet.cli.app as cli; cli.run(['check', 'close_range']); "
        "print([m for m in ('pybullet', 'cv2', 'fcl', 'matplotlib', 'meshcat') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"


def test_a_reader_that_goes_away_is_no_error() -> None:
    code = "import sys; from msrr_bullet.cli.app import run; sys.exit(run(['scenes']))"
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert process.stdout is not None
    assert process.stderr is not None
    process.stdout.close()
    assert process.stderr.read() == b""
    process.stderr.close()
    process.wait(timeout=30)


def test_sigterm_unwinds() -> None:
    code = (
        "import os, signal, sys, msrr_bullet.cli.app as cli, msrr_bullet.run as r\n"
        "def trial(*a, **k):\n"
        "    try:\n"
        "        os.kill(os.getpid(), signal.SIGTERM)\n"
        "        signal.pause()\n"
        "    finally:\n"
        "        print('closed', file=sys.stderr)\n"
        "r.run_trial = trial\n"
        "sys.argv = ['msrr', 'dock', 'close_range']\n"
        "cli.main()\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 128 + signal.SIGTERM
    assert "closed" in done.stderr
    assert "Traceback" not in done.stderr
