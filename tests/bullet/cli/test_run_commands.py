"""Commands that evaluate a finished run, or one that was killed."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from msrr_bullet.cli.app import run
from msrr_bullet.cli.exit_codes import NOT_DOCKED
from msrr_bullet.log.mcap_recorder import McapRecorder
from msrr_bullet.log.reader import LOG_NAME, read_log
from msrr_bullet.run import run_trial
from msrr_bullet.trial.telemetry import Progress
from msrr_scenes.messages import NS_PER_S, Action
from msrr_scenes.specs.scene import Scene


@pytest.mark.usefixtures("replays_here")
def test_a_log_that_ends_early_is_not_taken_for_a_whole_one(
    short_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A check that replays a log passed on half of one; this is a third."""
    content = (short_run / LOG_NAME).read_bytes()
    (tmp_path / LOG_NAME).write_bytes(content[: len(content) // 3])
    assert run(["replay", str(tmp_path)]) == NOT_DOCKED
    found = re.search(r"identical up to (\d\.\d{3}) s, where the log ends early", capsys.readouterr().out)
    assert found
    said = f"{tmp_path / LOG_NAME}: the log ends early, at {found[1]} s\n"
    for command in (["export", "--csv"], ["frames", "--count", "1"]):
        assert run([command[0], str(tmp_path), *command[1:]]) == 0
        assert capsys.readouterr().err == said


@pytest.mark.nightly
def test_of_a_whole_log_and_in_a_film_as_well(
    short_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    content = (short_run / LOG_NAME).read_bytes()
    (tmp_path / LOG_NAME).write_bytes(content[: len(content) // 2])
    assert run(["film", str(tmp_path), "--size", "320x240", "--speed", "100"]) == 0
    assert capsys.readouterr().err.startswith(f"{tmp_path / LOG_NAME}: the log ends early, at ")
    for command in (["export", "--csv"], ["frames", "--count", "1"]):
        assert run([command[0], str(short_run), *command[1:], "--out", f"whole{command[0]}"]) == 0
        assert capsys.readouterr().err == ""
    assert run(["replay", str(short_run)]) == 0


@pytest.mark.usefixtures("undrawn_runs", "replays_here")
def test_a_trial_that_was_interrupted_is_not_taken_for_a_whole_one(
    shipped: Callable[..., Scene], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Ctrl-C leaves a log that was finished, without a verdict: a check that replays it passed."""

    def interrupt(progress: Progress) -> None:
        if progress.time_s > 1.0:
            raise KeyboardInterrupt

    scene, folder = shipped("close_range", blind=True), tmp_path / "run"
    with pytest.raises(KeyboardInterrupt):
        run_trial(scene, 1, out=folder, observer=interrupt)
    assert read_log(folder).complete
    assert run(["replay", str(folder)]) == NOT_DOCKED
    found = re.search(
        r"identical up to (\d\.\d{3}) s, where the trial was interrupted", capsys.readouterr().out
    )
    assert found
    assert run(["export", "--csv", str(folder)]) == 0
    assert capsys.readouterr().err == f"{folder / LOG_NAME}: the trial was interrupted at {found[1]} s\n"


@pytest.mark.usefixtures("replays_here")
def test_a_replay_that_ends_at_a_difference_does_not_say_that_the_trial_was_interrupted(
    short_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Every command of the log is changed, so that the replay ends long before the log does."""
    log = read_log(short_run)
    with McapRecorder(tmp_path / LOG_NAME, log.header) as recorder:
        for record in log.records(end_ns=2 * NS_PER_S):
            message = record.message
            if isinstance(message, Action):
                message = replace(message, reason="another one")
            if record.topic != "/frames":  # the recorder adds these itself
                recorder.write(record.topic, record.stamp_ns, message)
    assert run(["replay", str(tmp_path)]) == NOT_DOCKED
    *differences, more, said = capsys.readouterr().out.splitlines()
    assert len(differences) == 3
    assert all(re.search(r" s, command: reason logged another one, replayed ", d) for d in differences)
    assert more == "and 17 differences more"
    ended = re.search(r"different; compared up to (\d\.\d{3}) s \(", said)
    assert ended
    assert float(differences[-1].split(" s,")[0]) < float(ended[1]) < 2.0
