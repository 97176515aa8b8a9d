"""``msrr dock``: its output, its files and its exit codes; a class of a user's own that fails."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from msrr_bullet.cli.app import run
from msrr_bullet.replay.log_replay import replay
from msrr_bullet.trial.result import TrialResult

Capture = pytest.CaptureFixture[str]


@pytest.mark.usefixtures("undrawn_runs")
def test_dock_leaves_a_run_folder_and_tells_belief_from_truth(
    short_trial: list[str], tmp_path: Path, capsys: Capture
) -> None:
    assert run(["dock", "close_range", "--seed", "3", *short_trial]) == 1  # one second is not enough
    out = capsys.readouterr().out
    assert "belief" in out
    assert "truth" in out
    assert "timeout, run folder runs/close_range-3-" in out
    (folder,) = (tmp_path / "runs").iterdir()
    result = TrialResult.from_json((folder / "result.json").read_text())
    assert (result.scene, result.seed, result.outcome.value) == ("close_range", 3, "timeout")
    assert (folder / "trial.mcap").stat().st_size > 0


@pytest.mark.usefixtures("undrawn_runs")
def test_the_same_trial_goes_to_the_same_folder(short_trial: list[str], tmp_path: Path) -> None:
    for _ in range(2):
        run(["dock", "close_range", *short_trial])
    run(["dock", "close_range", *short_trial, "--set", "los.inner_deg=21"])
    assert len(list((tmp_path / "runs").iterdir())) == 2


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (["control.docking=c9"], "unknown controller 'c9'"),
        (["control.docking=no.such:Law"], "no.such"),
        (["control.docking.params.gian=1"], "gian"),
    ],
)
def test_a_controller_that_cannot_be_built_is_bad_input(
    short_trial: list[str], overrides: list[str], message: str, capsys: Capture
) -> None:
    options = [part for override in overrides for part in ("--set", override)]
    assert run(["dock", "close_range", *short_trial, *options]) == 2
    out, err = capsys.readouterr()
    assert message in err
    assert "Traceback" not in err
    assert out == ""


@pytest.mark.usefixtures("undrawn_runs")
def test_dock_names_what_was_made_from_an_earlier_run(
    short_trial: list[str], tmp_path: Path, capsys: Capture
) -> None:
    arguments = ["dock", "close_range", *short_trial, "--out", "run"]
    assert run(arguments) == 1
    assert "earlier run" not in capsys.readouterr().out
    for name in ("plot.png", "trial.rrd"):
        (tmp_path / "run" / name).write_text("of before")
    (tmp_path / "run" / "notes.txt").write_text("mine")
    assert run(arguments) == 1
    said = "Made from an earlier run in this folder: plot.png, trial.rrd"
    assert capsys.readouterr().out.splitlines()[-1] == said
    assert (tmp_path / "run" / "plot.png").read_text() == "of before"


def test_an_interrupted_trial_names_what_was_made_from_an_earlier_run(
    tmp_path: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "run"
    folder.mkdir()
    (folder / "film.mp4").write_text("of before")
    os.utime(folder / "film.mp4", (0, 0))

    def interrupted(*_: object, out: Path, **__: object) -> None:
        (out / "trial.mcap").write_bytes(b"")
        raise KeyboardInterrupt

    monkeypatch.setattr("msrr_bullet.run.run_trial", interrupted)
    assert run(["dock", "close_range", "--out", str(folder)]) == 130
    assert capsys.readouterr().out.endswith("Made from an earlier run in this folder: film.mp4\n")


BROKEN = """from msrr_scenes.messages import Twist
class Law:
    def __init__(self, setup): ...
    def reset(self, inputs): ...
    def step(self, inputs):
        return Twist(1 / (inputs.now_ns // 800_000_000 - 1), 0.0)
"""


def test_a_user_s_class_in_the_current_folder_that_fails_is_bad_input(
    short_trial: list[str], tmp_path: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It was not found without PYTHONPATH, and its failure asked to be reported as ours."""
    (tmp_path / "broken_law.py").write_text(BROKEN)
    (tmp_path / "mcap.py").write_text("raise RuntimeError('not the package')\n")  # replaces nothing
    law = [*short_trial, "--set", "control.docking=broken_law:Law"]
    says = "controller 'broken_law:Law', broken_law.py line 6: step raised ZeroDivisionError"
    done = subprocess.run(
        # -P: as with the console script, the current folder is not on the path.
        [sys.executable, "-P", "-m", "msrr_bullet", "dock", "close_range", *law, "--out", "run"],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)},
    )
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert done.stderr.startswith(f"msrr: {says}")
    assert "report" not in done.stderr

    with monkeypatch.context() as patched:
        patched.setattr("msrr_bullet.replay.isolation.replay_isolated", replay)
        assert run(["replay", "run"]) == 2
    assert "the log names broken_law:Law by import path" in capsys.readouterr().err
    # A replay starts a process of its own, in which the class runs.
    assert run(["replay", "run", "--trust"]) == 0
    out, err = capsys.readouterr()
    assert "run: identical" in out
    assert err == ""
    # What changed most likely is named: the log does not hold it.
    (tmp_path / "broken_law.py").write_text(BROKEN.replace("Twist(1 /", "Twist(0.5 /"))
    assert run(["replay", "run", "--trust"]) == 1
    assert "holds no code of broken_law:Law, which may have changed since" in capsys.readouterr().out


@pytest.mark.nightly
def test_a_user_s_class_that_fails_in_a_sweep_is_bad_input(
    short_trial: list[str], tmp_path: Path, capsys: Capture
) -> None:
    """The workers of the sweep import it from the current folder, too."""
    (tmp_path / "broken_law.py").write_text(BROKEN)
    law = [*short_trial, "--set", "control.docking=broken_law:Law"]
    assert run(["sweep", "close_range", *law, "--seeds", "0:3", "--jobs", "1", "--json", "-"]) == 2
    out, err = capsys.readouterr()
    assert "the program of the unit failed in 3 of 3 trials" in err
    summary = json.loads(out)
    assert (summary["outcomes"], summary["failures"]) == ({"program_failed": 3}, [])
    assert (summary["trials"], summary["success"]["rate"]) == (3, 0.0)


@pytest.mark.nightly
def test_dock_and_replay_of_a_mission(line_of_three: Path, tmp_path: Path, capsys: Capture) -> None:
    run_folder = tmp_path / "run"
    line_of_two = ["--set", "shape={line: 2}"]
    assert run(["dock", str(line_of_three), *line_of_two, "--seed", "1", "--out", str(run_folder)]) == 0
    shown = capsys.readouterr().out
    assert "complete, run folder" in shown
    assert "all tasks are done" in shown
    assert "two or more under way" in shown
    result = TrialResult.from_json((run_folder / "result.json").read_text())
    assert result.mission is not None
    assert f"{result.mission.messages_sent} sent, {result.mission.messages_lost} lost" in shown
    assert f"{result.mission.makespan_s:.2f} s" in shown
    assert run(["replay", str(run_folder)]) == 0
    replayed = capsys.readouterr().out
    assert "identical" in replayed
    counts = re.search(r"(\d+) reports; base station: \d+ decisions, (\d+) authorities", replayed)
    assert counts is not None
    assert sum(map(int, counts.groups())) == result.mission.messages_sent
