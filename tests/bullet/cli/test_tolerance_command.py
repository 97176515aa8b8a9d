"""The command ``msrr tolerance``: its files, its second run, and what it says about bad input."""

import re
from pathlib import Path

import pytest

from msrr_bullet.cli.app import run
from msrr_bullet.run_folder import locked
from msrr_bullet.tolerance.model import Sample, StudyTrial, ToleranceStudy


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--effects", "onboard.yow_deg"], "did you mean 'onboard.yaw_deg'?"),
        (["--effects", "overhead"], "is no effect."),
        (["--grades", "carefull"], "unknown grade 'carefull'; did you mean 'careful'?"),
        (["--seeds", "12"], "a single number is ambiguous"),
        (["--seeds", "3:4"], "two seeds or more, one for each sign"),
    ],
)
def test_bad_input_is_refused_before_any_trial(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    blind = ["--set", "plant=unicycle", "--set", "perception=parametric"]
    assert run(["tolerance", "close_range", *blind, *arguments]) == 2
    assert message in " ".join(capsys.readouterr().err.split())
    assert not Path("runs").exists()


def test_a_study_that_is_interrupted_before_any_trial_names_no_store(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """It named one that was not there."""

    def interrupted(*args: object, **options: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("msrr_bullet.tolerance.study.run_study", interrupted)
    assert run(["tolerance", "close_range", "--out", str(tmp_path)]) == 130
    assert capsys.readouterr() == ("", "msrr: interrupted\n")
    (tmp_path / "trials.sqlite").touch()
    assert run(["tolerance", "close_range", "--out", str(tmp_path)]) == 130
    assert f"The trials so far are in {tmp_path / 'trials.sqlite'}; " in capsys.readouterr().out


def test_a_study_in_which_a_class_of_a_user_s_own_fails_says_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """As a sweep does; it ended with 0, and found that no size of any error holds."""
    outcomes = ["docked", "program_failed", "program_failed"]
    trials = [
        StudyTrial(seed=seed, error=None, outcome=outcome, succeeded=seed == 0, contacts={})
        for seed, outcome in enumerate(outcomes)
    ]
    study = ToleranceStudy(
        scene="close_range",
        scene_hash="",
        plant="bullet",
        perception="images",
        told="careful",
        versions={},
        seeds=(0, 1, 2),
        drawn=Sample.of(trials),
        chance_lateral=None,
        chance_yaw=None,
        grades=(),
        effects=(),
    )
    monkeypatch.setattr("msrr_bullet.tolerance.study.run_study", lambda *args, **options: study)
    assert run(["tolerance", "close_range", "--out", str(tmp_path)]) == 2
    said = "msrr: the program of a unit failed in 2 trials; the first one: as designed, seed 1\n"
    assert capsys.readouterr().err == said


def test_two_studies_in_one_folder_at_the_same_time_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with locked(tmp_path):
        assert run(["tolerance", "close_range", "--out", str(tmp_path)]) == 2
    assert "another run is under way in this folder; choose another --out" in capsys.readouterr().err


@pytest.mark.nightly
def test_a_study_with_contact_and_pixels_from_the_command_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "study"
    command = ["tolerance", "close_range", "--seeds", "0:2", "--grade-seeds", "0:1", "--grades", "careful"]
    command += ["--effects", "bracket.yaw_deg,onboard.pitch_deg,drive.track_percent", "--jobs", "1"]
    command += ["--out", str(out)]
    assert run(command) == 0
    printed = capsys.readouterr().out
    assert "bracket.yaw_deg" in printed
    assert str(out / "tolerance.html") in printed.replace("\n", "")
    study = ToleranceStudy.model_validate_json((out / "tolerance.json").read_text())
    pitch, yaw, track = study.effects  # in the order of the table
    # Over ten seeds the unit docks at every tested yaw, and not with a camera pitched by 4 degrees.
    assert yaw.fails is None
    assert pitch.fails is not None
    # How the plate of the tags is turned to the port cannot be seen; the track of the wheels is learned. Over
    # twenty seeds they come to 1.0 mm/deg and 0.14 mm/% (docs/results/tolerance.md). Two seeds are near; how
    # far two can be off is not told by what they differ, which the interval goes by.
    for effect, lateral in ((yaw, 1.0), (track, 0.14)):
        assert effect.lateral is not None
        assert effect.lateral.rms == pytest.approx(lateral, abs=0.3)
    (out / "progress.txt").unlink()
    assert run(command) == 0
    for line in (out / "progress.txt").read_text().splitlines()[1:]:
        done, stored = re.findall(r"(\d+) of \d+ trials, (\d+) from the store", line)[0]
        assert done == stored
    assert ToleranceStudy.model_validate_json((out / "tolerance.json").read_text()) == study
