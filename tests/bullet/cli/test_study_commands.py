"""The commands that study controllers: the scene that tuning writes, and the lines of a reproduction."""

from pathlib import Path
from typing import Any

import pytest

from msrr_bullet.cli.app import run
from msrr_bullet.studies.docking_studies import docking_row
from msrr_bullet.studies.model import Reproduction, Table
from msrr_bullet.studies.settings import STANDARD
from msrr_bullet.studies.tuned_controller import Tuned
from msrr_scenes.loading.load import load_scene
from msrr_scenes.specs.spec import Choice


def test_tune_writes_a_scene(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    tuned: list[str] = []

    def quick(controller: str, part, budget: int, seed: int, **_) -> Tuned:
        tuned.append(controller)
        return Tuned(
            part=part,
            controller=controller,
            params={"k_n_per_s": 1.5},
            budget=budget,
            cost_shipped=2.0,
            cost_tuned=1.0,
            seeds=(0, 40),
        )

    monkeypatch.setattr("msrr_bullet.studies.tuning.tune", quick)
    assert run(["tune", "linear", "--jobs", "1", "--budget", "64"]) == 0
    scene = load_scene(tmp_path / "tuned_linear.yaml")
    assert scene.control.docking == Choice(name="linear", params={"k_n_per_s": 1.5})
    for place in (tmp_path / "no" / "folder.yaml", tmp_path):
        assert run(["tune", "linear", "--jobs", "1", "--out", str(place)]) == 2
        assert f"--out {place}: not a file in an existing folder" in capsys.readouterr().err
    assert tuned == ["linear"], "what could not be written is not tuned first"
    assert run(["tune", "linear", "--jobs", "1", "--budget", "64", "--out", "/dev/full"]) == 2
    told = capsys.readouterr()
    assert "/dev/full: cannot be written (No space left on device)" in told.err
    assert (tmp_path / "tuned_linear.yaml").read_text() in told.out, "what was computed is not lost"


def test_reproduce_prints_the_requirements(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments: dict[str, Any] = {}
    row = docking_row(Choice(name="c1"), "C1", STANDARD, range(3))
    table = Table(phase="close", plant="unicycle", setting="standard", description="here", rows=(row,))
    results = Reproduction(versions={}, seeds={}, tables=(table,))

    def quick(out: Path, **given: Any) -> Reproduction:
        arguments.update(given, out=out)
        return results

    monkeypatch.setattr("msrr_bullet.reproduce.run.reproduce", quick)
    assert run(["reproduce", "--plant", "both", "--seeds", "3:7", "--out", str(tmp_path)]) == 0
    assert arguments["unicycle"] == arguments["bullet"] == range(3, 7)
    assert "C1, unicycle" in capsys.readouterr().out
    assert run(["reproduce", "--out", str(tmp_path)]) == 0
    assert (arguments["unicycle"], arguments["bullet"]) == (range(200), None)
    assert run(["reproduce", "--seeds", "x"]) == 2
    assert run(["reproduce", "--plant", "bullet", "--mission", "two_obstacles", "--out", str(tmp_path)]) == 0
    assert arguments["mission"] == "two_obstacles"
    assert run(["reproduce", "--mission", "two_obstacles"]) == 2, "unicycles run no scene"
