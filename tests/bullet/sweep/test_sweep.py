"""Sweeps: numbers, resuming, interruption, and trials that bring down their program."""

import math
import os
import signal
import sqlite3
import subprocess
import sys
import time
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import pytest

from msrr_bullet.sweep.provenance import code_fingerprint
from msrr_bullet.sweep.summary import TrialFailure
from msrr_bullet.sweep.sweep import one_trial, sweep
from msrr_bullet.sweep.trial_store import StoreError, TrialStore
from msrr_bullet.trial.result import Contact, Seating, TrialResult
from msrr_scenes import load_scene, scene_hash
from msrr_scenes.errors import SceneError
from msrr_scenes.messages import Phase
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.scene import Scene

SCENE = load_scene("close_range")

#: A real trial that takes no time: the loop with a kinematic plant and no pixels, for one simulated second.
SHORT = {"plant": "unicycle", "perception": "parametric", "time_limit_s": "1"}


class Inline:
    """Runs everything at once, here."""

    def submit(self, fn: Any, /, *args: Any) -> Future[Any]:
        future: Future[Any] = Future()
        try:
            future.set_result(fn(*args))
        except Exception as error:  # noqa: BLE001 - as every executor does
            future.set_exception(error)
        return future


def made_up(scene: Scene, seed: int) -> TrialResult:
    """Dock on the first attempt with even seeds and the second with odd ones; every tenth is a false dock."""
    false_dock = seed % 10 == 9
    return TrialResult(
        scene=scene.name,
        scene_hash=scene_hash(scene),
        seed=seed,
        plant=scene.plant,
        perception=scene.perception,
        outcome=Outcome.FALSE_DOCK if false_dock else Outcome.DOCKED,
        belief="docked",
        belief_reason="made up",
        attempts=1 + seed % 2,
        duration_s=1.0,
        phase=Phase.DONE,
        contact=None
        if false_dock
        else Contact(time_s=0.5, lateral_m=1e-3 * seed, yaw_rad=math.radians(0.1 * seed)),
        seating=Seating(axial_gap_m=0.001, lateral_m=0.0, yaw_rad=0.0, seated=not false_dock),
        min_clearance_m=0.3 - 0.01 * seed,
        start_redraws=seed % 3,
    )


def test_the_numbers() -> None:
    summary = sweep(SCENE, range(20), executor=Inline(), trial=made_up)
    assert summary.trials == 20
    assert summary.outcomes == {"docked": 18, "false_dock": 2}
    assert summary.success.rate == 0.9
    assert summary.success.low < 0.9 < summary.success.high
    assert summary.contact_lateral_mm.max == pytest.approx(18.0)
    assert summary.contact_yaw_deg.max == pytest.approx(1.8)
    assert summary.seated_axial_mm.p50 == pytest.approx(1.0)
    assert summary.attempts.max == 2
    assert summary.docked_by_attempt == {1: 10, 2: 8}
    assert summary.min_clearance_m == pytest.approx(0.11)
    assert summary.false_docks == 2
    assert summary.redraws == sum(seed % 3 for seed in range(20))
    assert not summary.failures
    assert not summary.interrupted


def test_a_second_sweep_runs_only_what_is_missing(tmp_path: Path) -> None:
    store, ran = tmp_path / "deep" / "trials.sqlite", []

    def trial(scene: Scene, seed: int) -> TrialResult:
        ran.append(seed)
        return made_up(scene, seed)

    first = sweep(SCENE, range(5), store=store, executor=Inline(), trial=trial)
    told: list[tuple[int, bool]] = []
    second = sweep(
        SCENE,
        range(8),
        store=store,
        executor=Inline(),
        trial=trial,
        observer=lambda r, old: told.append((r.seed, old)),
    )
    assert ran == [0, 1, 2, 3, 4, 5, 6, 7]
    assert first.reused == 0
    assert second.reused == 5
    assert second.trials == 8
    assert sorted(told) == [(seed, seed < 5) for seed in range(8)]
    fresh = sweep(SCENE, range(8), executor=Inline(), trial=made_up)
    assert second == fresh.model_copy(update={"reused": 5})  # whether stored or run makes no difference


def test_another_scene_or_other_code_is_not_taken_from_the_store(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = tmp_path / "trials.sqlite"
    sweep(SCENE, range(3), store=store, executor=Inline(), trial=made_up)
    other = load_scene("close_range", {"cameras.onboard.noise_grey": "9"})
    assert sweep(other, range(3), store=store, executor=Inline(), trial=made_up).reused == 0
    assert sweep(SCENE, range(3), store=store, executor=Inline(), trial=made_up).reused == 3
    monkeypatch.setattr("msrr_bullet.sweep.sweep.code_fingerprint", lambda scene: "edited")
    assert sweep(SCENE, range(3), store=store, executor=Inline(), trial=made_up).reused == 0


def test_the_code_of_an_own_controller_counts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module = tmp_path / "own_law.py"
    module.write_text("class Law: ...\n")
    monkeypatch.syspath_prepend(tmp_path)
    scene = load_scene("close_range", {"control.docking": "own_law:Law"})
    before = code_fingerprint(scene)
    assert code_fingerprint(scene) == before
    module.write_text("class Law: gain = 2\n")
    assert code_fingerprint(scene) != before


def test_an_interrupted_sweep_keeps_what_it_has(tmp_path: Path) -> None:
    store = tmp_path / "trials.sqlite"
    seen = 0

    def stop_after_three(found: object, stored: bool) -> None:
        nonlocal seen
        seen += 1
        if seen == 3:
            raise KeyboardInterrupt  # as Ctrl-C does, in the thread that waits

    summary = sweep(
        SCENE, range(50), store=store, executor=Inline(), trial=made_up, observer=stop_after_three
    )
    assert summary.interrupted
    assert 3 <= summary.trials <= 5
    resumed = sweep(SCENE, range(50), store=store, executor=Inline(), trial=made_up)
    assert resumed.reused == summary.trials
    assert resumed.trials == 50


def test_a_failing_trial_is_named_and_tried_again_next_time(tmp_path: Path) -> None:
    store = tmp_path / "trials.sqlite"

    def fails_once(scene: Scene, seed: int) -> TrialResult:
        if seed == 2 and not (tmp_path / "mended").exists():
            raise ZeroDivisionError("by nothing")
        return made_up(scene, seed)

    summary = sweep(SCENE, range(4), store=store, executor=Inline(), trial=fails_once)
    assert summary.failures == (TrialFailure(seed=2, error="ZeroDivisionError: by nothing"),)
    assert summary.trials == 4
    assert summary.success.rate == 0.75  # a failure of the program is not a success, nor is it left out
    (tmp_path / "mended").touch()
    again = sweep(SCENE, range(4), store=store, executor=Inline(), trial=fails_once)
    assert (again.reused, again.failures) == (3, ())


def test_a_scene_that_no_seed_can_run_stops_the_sweep() -> None:
    def misuse(scene: Scene, seed: int) -> TrialResult:
        raise SceneError("no such controller")

    with pytest.raises(SceneError, match="no such controller"):
        sweep(SCENE, range(4), executor=Inline(), trial=misuse)


def test_a_worker_that_dies_takes_no_other_trial_with_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "deadly_trial.py").write_text(
        "import os, sys\n"
        f"sys.path.insert(0, {str(Path(__file__).parent)!r})\n"
        "from test_sweep import made_up\n"
        "def trial(scene, seed):\n"
        "    if seed == 1:\n"
        "        os._exit(7)\n"
        "    return made_up(scene, seed)\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    from deadly_trial import trial

    summary = sweep(SCENE, range(4), jobs=2, trial=trial)
    assert [f.seed for f in summary.failures] == [1]
    assert "died" in summary.failures[0].error
    assert sum(summary.outcomes.values()) == 3


def test_real_trials_in_other_processes_come_out_the_same() -> None:
    scene = load_scene("close_range", SHORT)
    here = [one_trial(scene, seed) for seed in range(3)]
    there: dict[int, TrialResult] = {}

    def keep(found: TrialResult | TrialFailure, stored: bool) -> None:
        assert isinstance(found, TrialResult), found
        there[found.seed] = found

    summary = sweep(scene, range(3), jobs=2, observer=keep)
    assert summary.outcomes == {"timeout": 3}
    assert [there[seed] for seed in range(3)] == here


def test_ctrl_c_on_the_command_line(tmp_path: Path) -> None:
    store = tmp_path / "trials.sqlite"
    overrides = [arg for key, value in SHORT.items() for arg in ("--set", f"{key}={value}")]
    command = [sys.executable, "-m", "msrr_bullet.cli", "sweep", "close_range", *overrides]
    command += ["--seeds", "0:100000", "--jobs", "1", "--store", str(store)]
    process = subprocess.Popen(
        command,
        cwd=tmp_path,
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
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to the workers as well
        out, err = process.communicate(timeout=60.0)
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
    assert process.returncode == 130, err
    assert "Traceback" not in out + err
    assert "interrupted" in err
    deadline = time.monotonic() + 10.0
    while living(process.pid) and time.monotonic() < deadline:
        time.sleep(0.1)  # the tracker of shared resources sees its parent go, then goes
    assert not living(process.pid)
    done = stored_trials(store)
    assert done >= 3
    with sqlite3.connect(store) as db:
        (code,) = db.execute("SELECT DISTINCT code FROM trials").fetchone()
    with TrialStore(store) as shelf:
        kept = shelf.get(scene_hash(load_scene("close_range", SHORT)), code, range(100_000))
    assert sorted(kept) == list(range(done))


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


def test_a_file_that_is_no_store(tmp_path: Path) -> None:
    text = tmp_path / "notes.txt"
    text.write_text("these are notes, long enough to be no database header at all\n" * 20)
    with pytest.raises(StoreError, match=r"notes\.txt"):
        sweep(SCENE, range(1), store=text, executor=Inline(), trial=made_up)
    assert "these are notes" in text.read_text()
    alien = tmp_path / "alien.sqlite"
    with sqlite3.connect(alien) as db:
        db.execute("CREATE TABLE recipes (name TEXT)")
    with pytest.raises(StoreError, match="not a store of this version"):
        sweep(SCENE, range(1), store=alien, executor=Inline(), trial=made_up)
    with pytest.raises(StoreError):
        sweep(SCENE, range(1), store=tmp_path, executor=Inline(), trial=made_up)


def test_a_full_disk_is_one_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store = tmp_path / "trials.sqlite"
    sweep(SCENE, range(1), store=store, executor=Inline(), trial=made_up)
    with sqlite3.connect(store) as db:
        pages = db.execute("PRAGMA page_count").fetchone()[0]
    real = sqlite3.connect

    def small(*args: Any, **kwargs: Any) -> sqlite3.Connection:
        db = real(*args, **kwargs)
        db.execute(f"PRAGMA max_page_count = {pages}")
        return db

    monkeypatch.setattr(sqlite3, "connect", small)
    with pytest.raises(StoreError, match="full"):
        sweep(SCENE, range(60), store=store, executor=Inline(), trial=made_up)


def test_no_jobs() -> None:
    with pytest.raises(ValueError, match="at least one job"):
        sweep(SCENE, range(1), jobs=0)
