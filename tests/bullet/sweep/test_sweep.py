"""Sweeps: resumed, interrupted, and with trials that fail."""

import gc
import json
import os
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from msrr_bullet.simulation.world import BulletWorld
from msrr_bullet.sweep.provenance import code_fingerprint
from msrr_bullet.sweep.remote_trial import local_trial
from msrr_bullet.sweep.summary import SweepSummary, TrialFailure
from msrr_bullet.sweep.sweep import run_sweep
from msrr_bullet.sweep.trial_store import TrialStore
from msrr_bullet.sweep.trials import one_trial, run_trials
from msrr_bullet.trial.result import TrialResult
from msrr_scenes import load_scene, scene_hash
from msrr_scenes.errors import ChangedFileError, PlacementError, SceneError
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.scene import Scene
from tests.bullet.conftest import inline
from tests.bullet.sweep.conftest import made_up


def test_a_second_sweep_runs_only_what_is_missing(scene: Scene, tmp_path: Path) -> None:
    store, ran = tmp_path / "deep" / "trials.sqlite", []

    def trial(scene: Scene, seed: int) -> TrialResult:
        ran.append(seed)
        return made_up(scene, seed)

    first = run_sweep(scene, range(5), store=store, executor=inline, trial=trial)
    calls: list[tuple[int, bool]] = []
    second = run_sweep(
        scene,
        range(8),
        store=store,
        executor=inline,
        trial=trial,
        observer=lambda r, old: calls.append((r.seed, old)),
    )
    assert ran == [0, 1, 2, 3, 4, 5, 6, 7]
    assert first.reused == 0
    assert second.reused == 5
    assert second.trials == 8
    assert sorted(calls) == [(seed, seed < 5) for seed in range(8)]
    fresh = run_sweep(scene, range(8), executor=inline, trial=made_up)
    assert second == fresh.model_copy(update={"reused": 5})  # whether stored or run makes no difference


def test_a_trial_of_a_sweep_leaves_no_world_in_memory() -> None:
    before = {id(thing) for thing in gc.get_objects() if isinstance(thing, BulletWorld)}
    gc.disable()  # whether the collector comes by itself, is a matter of chance
    try:
        one_trial(load_scene("close_range", {"time_limit_s": 1}), 0)
        left = [thing for thing in gc.get_objects() if isinstance(thing, BulletWorld)]
    finally:
        gc.enable()
    assert not [thing for thing in left if id(thing) not in before]


def test_a_trial_that_two_batches_ask_for_is_run_once(scene: Scene) -> None:
    ran: list[int] = []

    def trial(scene: Scene, seed: int) -> TrialResult:
        ran.append(seed)
        return made_up(scene, seed)

    finished = run_trials([(scene, [0, 1]), (scene, [1, 2, 2])], executor=inline, trial=trial)
    assert ran == [0, 1, 2]
    assert len(finished.outcomes) == 3


def test_a_seed_that_is_no_whole_number_is_refused_before_any_trial(scene: Scene) -> None:
    ran: list[object] = []
    seeds: Any = [0, 0.5]  # as from a notebook, where no type is checked
    with pytest.raises(TypeError, match="integer"):
        run_sweep(scene, seeds, executor=inline, trial=made_up, observer=lambda r, _: ran.append(r))
    assert not ran


def test_another_scene_or_other_code_is_not_taken_from_the_store(
    scene: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = tmp_path / "trials.sqlite"
    run_sweep(scene, range(3), store=store, executor=inline, trial=made_up)
    other = load_scene("close_range", {"cameras.onboard.noise_grey": "9"})
    assert run_sweep(other, range(3), store=store, executor=inline, trial=made_up).reused == 0
    assert run_sweep(scene, range(3), store=store, executor=inline, trial=made_up).reused == 3
    for module in ("trials", "remote_trial"):
        monkeypatch.setattr(f"msrr_bullet.sweep.{module}.code_fingerprint", lambda scene, **_: "edited")
    assert run_sweep(scene, range(3), store=store, executor=inline, trial=made_up).reused == 0


def test_a_program_that_failed_is_run_again(scene: Scene, tmp_path: Path) -> None:
    """It may have failed for what is mended since and is no code, such as a file that it reads."""
    store = tmp_path / "trials.sqlite"

    fails = {1}

    def failing(scene: Scene, seed: int) -> TrialResult:
        result = made_up(scene, seed)
        return result.model_copy(update={"outcome": Outcome.PROGRAM_FAILED}) if seed in fails else result

    failed = run_sweep(scene, range(3), store=store, executor=inline, trial=failing)
    assert failed.outcomes["program_failed"] == 1
    fails.clear()
    again = run_sweep(scene, range(3), store=store, executor=inline, trial=failing)
    assert again.reused == 2
    assert "program_failed" not in again.outcomes
    assert run_sweep(scene, range(3), store=store, executor=inline, trial=failing).reused == 3


def other_trial(scene: Scene, seed: int, gain: float = 1.0) -> TrialResult:
    return made_up(scene, seed)


def test_results_of_one_function_are_not_taken_for_those_of_another(scene: Scene, tmp_path: Path) -> None:
    """Nor those with one argument for those with another."""
    functions = [made_up, other_trial, partial(other_trial, gain=2.0), partial(other_trial, gain=3.0)]
    for reused in (0, 3):
        for function in functions:
            found = run_sweep(
                scene, range(3), store=tmp_path / "trials.sqlite", executor=inline, trial=function
            )
            assert found.reused == reused


def test_a_seed_without_a_start_costs_no_other_trial(scene: Scene) -> None:
    def trial(scene: Scene, seed: int) -> TrialResult:
        if seed == 0:
            raise PlacementError("none of 1000 starts")
        return made_up(scene, seed)

    found = run_sweep(scene, range(4), executor=inline, trial=trial)
    assert [(f.seed, f.bad_input, f.error) for f in found.failures] == [(0, True, "none of 1000 starts")]
    assert sum(found.outcomes.values()) == 3


def test_files_that_are_written_while_trials_run_are_noticed_where_a_process_starts(scene: Scene) -> None:
    codes = {scene_hash(scene): code_fingerprint(scene)}
    assert local_trial(made_up, codes, scene, 0) == made_up(scene, 0)
    for other in ({}, dict.fromkeys(codes, "0" * 24)):
        with pytest.raises(ChangedFileError, match=r"close_range, seed 0: a file .* was written while"):
            local_trial(made_up, other, scene, 0)


def test_many_scenes_share_one_pool_and_one_store(scene: Scene, tmp_path: Path) -> None:
    other = load_scene("close_range", {"cameras.onboard.noise_grey": "9"})
    batches = [(scene, range(3)), (other, range(2)), (scene, range(1, 5))]
    store = tmp_path / "trials.sqlite"
    first = run_trials(batches, store=store, executor=inline, trial=made_up)
    expected = {(scene_hash(scene), seed) for seed in range(5)} | {(scene_hash(other), s) for s in range(2)}
    assert first.outcomes.keys() == expected
    assert all(
        isinstance(outcome, TrialResult) and (outcome.scene_hash, outcome.seed) == key
        for key, outcome in first.outcomes.items()
    )
    stored: list[bool] = []
    again = run_trials(
        batches, store=store, executor=inline, trial=made_up, observer=lambda _, held: stored.append(held)
    )
    assert (stored, again.outcomes) == ([True] * 7, first.outcomes)


def test_an_interrupted_sweep_keeps_what_it_has(scene: Scene, tmp_path: Path) -> None:
    store = tmp_path / "trials.sqlite"
    seen = 0

    def stop_after_three(found: object, stored: bool) -> None:
        nonlocal seen
        seen += 1
        if seen == 3:
            raise KeyboardInterrupt  # as Ctrl-C does, in the thread that waits

    summary = run_sweep(
        scene, range(50), store=store, executor=inline, trial=made_up, observer=stop_after_three
    )
    assert summary.interrupted
    assert 3 <= summary.trials <= 5
    resumed = run_sweep(scene, range(50), store=store, executor=inline, trial=made_up)
    assert resumed.reused == summary.trials
    assert resumed.trials == 50


def test_ctrl_c_while_a_result_is_stored_does_not_lose_it(
    made_up_sweep: Callable[..., SweepSummary], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It was taken off the list of running trials before it was stored."""
    put, interrupted = TrialStore.put, [1]

    def interrupted_once(store: TrialStore, result: TrialResult, code: str) -> None:
        if result.seed in interrupted:
            interrupted.clear()
            raise KeyboardInterrupt
        put(store, result, code)

    monkeypatch.setattr(TrialStore, "put", interrupted_once)
    store = tmp_path / "trials.sqlite"
    summary = made_up_sweep(range(50), store=store)
    assert summary.interrupted
    assert not interrupted
    assert 2 <= summary.trials <= 4
    assert made_up_sweep(range(summary.trials), store=store).reused == summary.trials


def test_a_failing_trial_is_named_and_tried_again_next_time(scene: Scene, tmp_path: Path) -> None:
    store = tmp_path / "trials.sqlite"

    def fails_once(scene: Scene, seed: int) -> TrialResult:
        if seed == 2 and not (tmp_path / "mended").exists():
            raise ZeroDivisionError("by nothing")
        return made_up(scene, seed)

    summary = run_sweep(scene, range(4), store=store, executor=inline, trial=fails_once)
    assert summary.failures == (
        TrialFailure(
            scene=scene.name, scene_hash=scene_hash(scene), seed=2, error="ZeroDivisionError: by nothing"
        ),
    )
    assert summary.trials == 4
    assert summary.success.rate == 0.75  # a failure of the program is not a success, nor is it left out
    (tmp_path / "mended").touch()
    again = run_sweep(scene, range(4), store=store, executor=inline, trial=fails_once)
    assert (again.reused, again.failures) == (3, ())


def test_a_scene_that_no_seed_can_run_stops_the_sweep(scene: Scene) -> None:
    def misuse(scene: Scene, seed: int) -> TrialResult:
        raise SceneError("no such controller")

    with pytest.raises(SceneError, match="no such controller"):
        run_sweep(scene, range(4), executor=inline, trial=misuse)


@contextmanager
def running_sweep(overrides: dict[str, str], store: Path, jobs: int) -> Iterator[subprocess.Popen[str]]:
    """A sweep on the command line that has stored its first trials."""
    options = [arg for key, value in overrides.items() for arg in ("--set", f"{key}={value}")]
    command = [sys.executable, "-m", "msrr_bullet", "sweep", "close_range", *options]
    command += ["--seeds", "0:100000", "--jobs", str(jobs), "--store", str(store), "--json", "all.json"]
    process = subprocess.Popen(
        command,
        cwd=store.parent,
        start_new_session=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        # A shell's background jobs are deaf to Ctrl-C, and so are these tests when they run in one.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    try:
        deadline = time.monotonic() + 60.0
        while stored_trials(store) < 3:
            assert process.poll() is None, process.communicate()
            assert time.monotonic() < deadline
            time.sleep(0.1)
        yield process
    finally:
        if living(process.pid):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


@pytest.mark.parametrize(
    ("number", "code", "said"),
    [
        (signal.SIGINT, 130, ("another Ctrl-C", "interrupted")),
        pytest.param(signal.SIGTERM, 143, ("terminated",), marks=pytest.mark.nightly),
        # A session that ends sends both, with nothing between them.
        pytest.param((signal.SIGINT, signal.SIGTERM), 143, ("terminated",), marks=pytest.mark.nightly),
    ],
)
def test_signals_on_the_command_line(
    short_trial: dict[str, str],
    tmp_path: Path,
    number: int | tuple[int, ...],
    code: int,
    said: tuple[str, ...],
) -> None:
    store = tmp_path / "trials.sqlite"
    with running_sweep(short_trial, store, jobs=1) as process:
        for each in (number,) if isinstance(number, int) else number:
            os.killpg(process.pid, each)  # as a terminal and a queue of jobs do: to the workers as well
        out, err = process.communicate(timeout=60.0)
        settle(process.pid)
    assert process.returncode == code, err
    assert "Traceback" not in out + err
    assert all(words in err for words in said), err
    assert "95 % confidence intervals" in out
    done = stored_trials(store)
    assert 3 <= json.loads((tmp_path / "all.json").read_text())["trials"] <= done
    with sqlite3.connect(store) as db:
        (fingerprint,) = db.execute("SELECT DISTINCT code FROM trials").fetchone()
    with TrialStore(store) as store_file:
        kept = store_file.get(scene_hash(load_scene("close_range", short_trial)), fingerprint, range(100_000))
    assert sorted(kept) == list(range(done))


@pytest.mark.nightly
def test_workers_end_when_their_parent_is_killed(short_trial: dict[str, str], tmp_path: Path) -> None:
    """They waited for work for ever, each with a simulator in its memory."""
    with running_sweep(short_trial, tmp_path / "trials.sqlite", jobs=2) as process:
        assert len(living(process.pid)) >= 3
        process.kill()  # the parent alone
        process.wait()
        settle(process.pid)
    assert stored_trials(tmp_path / "trials.sqlite") >= 3


def settle(group: int) -> None:
    """Wait until every process of a group has ended; the last sees the others go and follows."""
    deadline = time.monotonic() + 30.0
    while living(group):
        assert time.monotonic() < deadline, living(group)
        time.sleep(0.1)


def living(group: int) -> list[str]:
    """Return the processes of a group that are more than a record waiting for its parent."""
    table = subprocess.run(
        ["ps", "-A", "-o", "pgid=,stat=,args="], capture_output=True, text=True, check=True
    )
    rows = [line.split(maxsplit=2) for line in table.stdout.splitlines()]
    return [" ".join(row) for row in rows if row[0] == str(group) and not row[1].startswith("Z")]


def stored_trials(store: Path) -> int:
    try:
        with sqlite3.connect(f"file:{store}?mode=ro", uri=True) as db:
            return int(db.execute("SELECT count(*) FROM trials").fetchone()[0])
    except sqlite3.OperationalError:
        return 0


def test_jobs_are_a_number_above_zero(scene: Scene) -> None:
    half: Any = 2.5
    with pytest.raises(TypeError, match=r"jobs is an integer, or a function that returns one, found 2\.5"):
        run_sweep(scene, range(1), jobs=half)
    with pytest.raises(ValueError, match="at least one job"):
        run_sweep(scene, range(1), jobs=0)
