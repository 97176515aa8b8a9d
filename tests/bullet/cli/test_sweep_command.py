"""``msrr sweep``: its output, its files and its exit codes."""

import csv
import json
import shlex
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

from msrr_bullet.cli.app import run
from msrr_bullet.sweep.summary import SweepSummary
from msrr_bullet.sweep.trial_store import StoreError, TrialStore
from msrr_bullet.sweep.trials import FinishedTrials, one_trial, run_trials
from msrr_bullet.sweep.variation import Variation
from msrr_bullet.trial.result import TrialResult
from msrr_scenes.specs.scene import Scene

Capture = pytest.CaptureFixture[str]


@pytest.mark.usefixtures("sweeps_here")
def test_a_sweep_never_writes_over_what_it_uses(
    short_trial: list[str], tmp_path: Path, capsys: Capture
) -> None:
    arguments = ["sweep", "close_range", *short_trial, "--seeds", "0:1", "--jobs", "1", "--store", "s.sqlite"]
    assert run(arguments) == 0
    stored = (tmp_path / "s.sqlite").read_bytes()
    for files in (["--json", "s.sqlite"], ["--csv", "s.sqlite"], ["--json", "a", "--csv", "a"]):
        assert run([*arguments, *files]) == 2
        assert "the command uses this file already; name another one" in capsys.readouterr().err
    assert (tmp_path / "s.sqlite").read_bytes() == stored
    assert not (tmp_path / "a").exists()


@pytest.mark.usefixtures("sweeps_here")
def test_a_file_that_cannot_be_written_costs_no_other_one(
    short_trial: list[str], tmp_path: Path, capsys: Capture
) -> None:
    arguments = ["sweep", "close_range", *short_trial, "--seeds", "0:1", "--jobs", "1", "--fresh"]
    assert run([*arguments, "--json", "/dev/full", "--csv", "trials.csv"]) == 2
    out, err = capsys.readouterr()
    assert "/dev/full: cannot be written" in err
    assert "No space left on device" in err
    assert "Traceback" not in err
    assert "--set" not in err, "what was set for the scene is not the reason"
    assert "95 % confidence intervals" in out
    assert len(list(csv.reader((tmp_path / "trials.csv").open()))) == 2
    plot = ["--vary", "as_built=careful", "--plot", "p.png"]
    assert run([*arguments, "--json", "/dev/full", *plot]) == 2
    assert "/dev/full: cannot be written" in capsys.readouterr().err
    assert (tmp_path / "p.png").is_file()


@pytest.mark.nightly
@pytest.mark.parametrize(("output", "code"), [("> /dev/full", 2), ("| true", 0)])
def test_trials_go_on_and_are_written_where_nobody_reads_of_them(
    output: str, code: int, tmp_path: Path
) -> None:
    """Each of these trials writes a line, whose reader has gone away or for which the disk has no room."""
    command = [sys.executable, "-m", "msrr_bullet", "sweep", "lost_target", "--seeds", "0:2", "--jobs", "1"]
    command += ["--set", "plant=unicycle", "--set", "perception=parametric", "--fresh", "--csv", "t.csv"]
    command += ["--set", "time_limit_s=1"]
    ended = subprocess.run(f"{shlex.join(command)} {output}", shell=True, capture_output=True, text=True)
    assert ended.returncode == code
    assert "Traceback" not in ended.stderr
    rows = list(csv.DictReader((tmp_path / "t.csv").open()))
    assert {row["seed"] for row in rows} == {"0", "1"}


@pytest.mark.usefixtures("sweeps_here")
def test_a_store_that_gets_full_costs_no_result(
    short_trial: list[str], tmp_path: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    put = TrialStore.put

    def fail_at_the_third(store: TrialStore, result: TrialResult, code: str) -> None:
        if result.seed == 2:
            raise StoreError("the disk is full")
        put(store, result, code)

    monkeypatch.setattr(TrialStore, "put", fail_at_the_third)
    arguments = ["sweep", "close_range", *short_trial, "--seeds", "0:9", "--jobs", "1"]
    assert run([*arguments, "--json", "all.json", "--csv", "trials.csv"]) == 2
    out, err = capsys.readouterr()
    assert "the disk is full" in err
    assert "95 % confidence intervals" in out
    numbers = json.loads((tmp_path / "all.json").read_text())
    assert (numbers["trials"], numbers["interrupted"]) == (3, True)
    assert len(list(csv.reader((tmp_path / "trials.csv").open()))) == 4


def test_a_store_that_cannot_be_opened_is_told_with_the_options(
    short_trial: list[str], tmp_path: Path, capsys: Capture
) -> None:
    """The message said to name another file, of which a sweep has several."""
    store = tmp_path / "runs" / "sweeps.sqlite"
    store.parent.mkdir()
    store.write_text("no database")
    assert run(["sweep", "close_range", *short_trial, "--seeds", "0:1", "--jobs", "1"]) == 2
    said = "runs/sweeps.sqlite: cannot be opened as a store of trials (file is not a database); name another"
    assert f"{said} store (--store), or none (--fresh)" in capsys.readouterr().err
    assert store.read_text() == "no database"


@pytest.mark.usefixtures("sweeps_here")
def test_sweep_writes_the_numbers(
    short_trial: list[str], tmp_path: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    arguments = ["sweep", "close_range", *short_trial, "--seeds", "0:2", "--jobs", "1"]
    assert run([*arguments, "--json", "numbers.json"]) == 0
    numbers = json.loads((tmp_path / "numbers.json").read_text())
    assert numbers["trials"] == 2
    assert numbers["outcomes"] == {"timeout": 2}
    assert set(numbers["success"]) == {"rate", "low", "high"}
    for key in ("contact_lateral_mm", "contact_yaw_deg", "seated_axial_mm", "attempts"):
        assert {"p50", "p95", "max", "p50_interval", "p95_interval"} == set(numbers["steps"][0][key])
    assert {"min_clearance_m", "false_docks", "redraws"} <= set(numbers)
    capsys.readouterr()
    assert run([*arguments, "--json", "-"]) == 0  # the table gives way to the numbers
    again = json.loads(capsys.readouterr().out)
    assert again == {**numbers, "reused": 2}
    for module in ("trials", "remote_trial"):
        monkeypatch.setattr(f"msrr_bullet.sweep.{module}.code_fingerprint", lambda scene, **_: "edited")
    assert run(arguments) == 0
    told = " ".join(capsys.readouterr().out.split())
    assert "not taken from the store, for code or packages have changed since: 2 results" in told


@pytest.mark.usefixtures("sweeps_here")
def test_sweep_writes_a_table_of_its_trials(short_trial: list[str], tmp_path: Path, capsys: Capture) -> None:
    """In the order of the seeds, from the store as well, and of what is without a result."""
    arguments = ["sweep", "close_range", *short_trial, "--seeds", "5,3", "--jobs", "1"]
    assert run([*arguments, "--csv", "trials.csv"]) == 0
    table = (tmp_path / "trials.csv").read_text()
    rows = list(csv.DictReader(table.splitlines()))
    assert [(r["seed"], r["outcome"], r["unit"], r["attempts"]) for r in rows] == [
        ("5", "timeout", "a", "1"),
        ("3", "timeout", "a", "1"),
    ]
    capsys.readouterr()
    assert run([*arguments, "--csv", "-"]) == 0
    assert capsys.readouterr().out == table
    assert (
        run([*arguments, "--fresh", "--wall-limit", "0.1", "--set", "time_limit_s=1000", "--csv", "-"]) == 2
    )
    for row in csv.DictReader(capsys.readouterr().out.splitlines()):
        assert (row["outcome"], row["duration_s"]) == ("", "")
        assert "took longer than 0.1 s" in row["reason"]


@pytest.mark.parametrize(
    "options",
    [
        ["--fresh", "--store", "trials.sqlite"],
        ["--dask", "local:1", "--jobs", "2"],
        ["--json", "-", "--csv", "-"],
    ],
)
def test_sweep_refuses_options_of_which_one_would_be_ignored(
    short_trial: list[str], options: list[str], tmp_path: Path, capsys: Capture
) -> None:
    assert run(["sweep", "close_range", *short_trial, "--seeds", "0:2", *options]) == 2
    shown = capsys.readouterr().err
    assert all(option in shown for option in options if option.startswith("--"))
    assert not (tmp_path / "runs").exists()


def test_a_sweep_shows_brackets_in_reasons(
    short_trial: list[str], monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    """They were read as markup: what stood in them vanished, and a stray [/] was a traceback."""
    reason = "law [c1] gave up [/] :warning:"

    def failing(scene: Scene, seed: int, wall_limit_s: float) -> TrialResult:
        if seed == 1:
            raise ValueError(reason)
        return one_trial(scene, seed).model_copy(update={"reason": reason})

    def in_this_process(*arguments: Any, **options: Any) -> FinishedTrials:
        with ThreadPoolExecutor(1) as executor:
            return run_trials(*arguments, **options, executor=executor, trial=failing)

    monkeypatch.setattr("msrr_bullet.sweep.trials.run_trials", in_this_process)
    arguments = ["sweep", "close_range", *short_trial, "--seeds", "0:2", "--jobs", "1", "--fresh"]
    assert run([*arguments, "--set", "name=close.fast"]) == 70
    out = capsys.readouterr().out
    assert f"seed 0: timeout, {reason}" in out
    assert f"seed 1: ValueError: {reason}" in out
    assert "close.fast, 2 trials" in out
    assert run([*arguments, "--vary", "as_built=careful,rough"]) == 70
    assert f"as_built=rough, seed 1 gave no result: ValueError: {reason}" in capsys.readouterr().err


@pytest.mark.nightly
def test_a_sweep_of_missions_counts_what_is_complete(
    line_of_three: Path, tmp_path: Path, capsys: Capture
) -> None:
    """Also from the store, and in the JSON file; a mission in which no step began tells its reason."""
    sweep = [
        "sweep",
        str(line_of_three),
        "--seeds",
        "1:3",
        "--jobs",
        "1",
        "--store",
        str(tmp_path / "s.sqlite"),
    ]
    file = tmp_path / "sweep.json"
    assert run([*sweep, "--json", str(file)]) == 0
    assert "complete: 100.0 %" in capsys.readouterr().out
    first = SweepSummary.model_validate_json(file.read_text())
    assert first.mission is not None
    assert (first.steps, first.mission.docks.outcomes) == ((), {"docked": 4})
    assert first.success.rate == 1.0
    assert run([*sweep, "--json", str(file)]) == 0
    again = SweepSummary.model_validate_json(file.read_text())
    assert again == first.model_copy(update={"reused": 2})
    capsys.readouterr()
    silent = ["--set", "radio.silences=[{from_s: 0, until_s: 60}]", "--set", "time_limit_s=3"]
    assert run([*sweep, *silent]) == 0
    shown = capsys.readouterr().out
    assert "seed 1: timeout, the time limit of 3 s is over" in shown
    assert "complete: 0.0 %" in shown


@pytest.mark.usefixtures("sweeps_here")
def test_a_sweep_at_several_values(short_trial: list[str], tmp_path: Path, capsys: Capture) -> None:
    """One table for all, numbers of each, a row for every trial with what was set, and a plot."""
    arguments = ["sweep", "close_range", *short_trial[:-2], "--seeds", "0:2", "--jobs", "1", "--fresh"]
    arguments += ["--vary", "time_limit_s=1,2", "--vary", "control.docking=c1,{name: c2}"]
    assert run([*arguments, "--json", "n.json", "--csv", "t.csv", "--plot", "p.png"]) == 0
    out = capsys.readouterr().out
    assert "at 4 combinations of time_limit_s and control.docking" in out
    assert "time_limit_s=2 control.docking={name: c2}, seed 1: timeout" in out
    chosen = [{"time_limit_s": s, "control.docking": law} for s in ("1", "2") for law in ("c1", "{name: c2}")]
    numbers = json.loads((tmp_path / "n.json").read_text())["levels"]
    assert [level["values"] for level in numbers] == chosen
    assert [level["summary"]["outcomes"] for level in numbers] == [{"timeout": 2}] * 4
    rows = list(csv.DictReader((tmp_path / "t.csv").open()))
    assert [row["set.time_limit_s"] for row in rows] == ["1"] * 4 + ["2"] * 4
    assert {row["set.plant"] for row in rows} == {"unicycle"}
    assert [row["seed"] for row in rows] == ["0", "1"] * 4
    assert (tmp_path / "p.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.usefixtures("sweeps_here")
def test_a_narrow_terminal_breaks_no_word_of_the_table(
    short_trial: list[str], capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "60")
    arguments = ["sweep", "close_range", *short_trial[:-2], "--seeds", "0:1", "--jobs", "1", "--fresh"]
    run([*arguments, "--vary", "time_limit_s=1,20"])
    lines = capsys.readouterr().out.splitlines()
    head = {word for line in lines if line.startswith("\u2503") for word in line.split()}
    assert {"time_limit_s", "docked", "lateral", "error,", "median", "[mm]", "95", "[deg]"} <= head
    assert {len(line) for line in lines if line[0] in "\u250f\u2503\u2502\u2514"} == {60}


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--plot", "p.png"], "--plot: there is nothing to plot over; give --vary as well"),
        (["--vary", "time_limit_s"], "--vary time_limit_s: expected KEY=VALUE,VALUE"),
        (["--vary", "time_limit_s="], "--vary time_limit_s=: expected KEY=VALUE,VALUE"),
        (["--vary", "time_limit_s=[1"], "--vary time_limit_s=[1: not valid YAML"),
        (["--vary", "time_limit_s=8,"], "=8,: there is no value after the last comma; give one, or leave"),
        (["--vary", "time_limit_s=,8"], "=,8: there is no value before the first comma"),
        (["--vary", "time_limit_s=8, ,9"], "=8, ,9: there is no value between two commas"),
        (["--vary", "as_built=rough", "--vary", "as_built=careful"], "as_built is varied already"),
        (["--set", "as_built=rough", "--vary", "as_built=careful"], "--set sets it to one value"),
        (
            ["--vary", "as_built=careful,bad"],
            "msrr: --vary as_built=bad: as_built: expected 'perfect'",
        ),
        (["--vary", "as_built=careful", "--plot", "p.gif"], "p.gif: no format for plots"),
        (["--vary", "as_built=careful", "--plot", "t.csv", "--csv", "t.csv"], "uses this file already"),
    ],
)
def test_values_that_cannot_be_varied_are_refused_before_any_trial(
    options: list[str], says: str, tmp_path: Path, capsys: Capture
) -> None:
    assert run(["sweep", "close_range", "--seeds", "0:2", *options]) == 2
    assert says in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


@pytest.mark.usefixtures("sweeps_here")
def test_a_sweep_at_several_values_that_is_stopped_keeps_what_it_has(
    short_trial: list[str], tmp_path: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    put, stored = TrialStore.put, list[int]()

    def fail_at_the_fourth(store: TrialStore, result: TrialResult, code: str) -> None:
        stored.append(result.seed)
        if len(stored) == 4:
            raise StoreError("the disk is full")
        put(store, result, code)

    monkeypatch.setattr(TrialStore, "put", fail_at_the_fourth)
    arguments = ["sweep", "close_range", *short_trial, "--seeds", "0:3", "--jobs", "1"]
    arguments += ["--vary", "as_built=perfect,careful,rough", "--plot", "p.png"]
    assert run([*arguments, "--json", "n.json"]) == 2
    out, err = capsys.readouterr()
    assert "the disk is full" in err
    assert "0 of 3" in out
    assert "stopped before all trials were run" in " ".join(out.split())
    found = Variation.model_validate_json((tmp_path / "n.json").read_text())
    assert [(level.summary.trials, level.summary.interrupted) for level in found.levels] == [
        (3, True),
        (1, True),
        (0, True),
    ]
    assert (tmp_path / "p.png").is_file()
