"""The worker pool: processes that die, and trials that come out as in this process."""

import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import pytest

from msrr_bullet.sweep.spawned_pool import SpawnedPool
from msrr_bullet.sweep.summary import TrialFailure
from msrr_bullet.sweep.sweep import run_sweep
from msrr_bullet.sweep.trials import one_trial
from msrr_bullet.sweep.worker_pool import TrialTask, WorkerPool
from msrr_bullet.trial.result import TrialResult
from msrr_scenes import load_scene, scene_hash
from msrr_scenes.specs.scene import Scene
from tests.bullet.conftest import inline
from tests.bullet.sweep.conftest import made_up


def test_every_seed_is_collected_once(scene: Scene) -> None:
    collected: list[int] = []
    pool = WorkerPool(lambda: 2, inline, made_up, lambda task, outcome: collected.append(task.seed))
    pool.run(deque(TrialTask(scene, scene_hash(scene), seed) for seed in range(7)))
    pool.close()
    assert sorted(collected) == list(range(7))


def test_a_worker_that_dies_takes_no_other_trial_with_it(
    short_trial: dict[str, str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    """The others come out as they do in this process; a crash of compiled code names the line."""
    (tmp_path / "deadly_trial.py").write_text(
        "import ctypes\n"
        "from msrr_bullet.sweep.trials import one_trial\n"
        "def trial(scene, seed):\n"
        "    if seed == 1:\n"
        "        ctypes.string_at(0)\n"
        "    return one_trial(scene, seed)\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    from deadly_trial import trial

    scene, there = load_scene("close_range", short_trial), dict[int, TrialResult | TrialFailure]()
    summary = run_sweep(
        scene, range(4), jobs=2, trial=trial, observer=lambda found, _: there.update({found.seed: found})
    )
    assert [f.seed for f in summary.failures] == [1]
    assert "died" in summary.failures[0].error
    assert f'"{tmp_path / "deadly_trial.py"}", line 5 in trial' in capfd.readouterr().err
    assert summary.outcomes == {"timeout": 3}
    assert [there[seed] for seed in (0, 2, 3)] == [one_trial(scene, seed) for seed in (0, 2, 3)]


@pytest.mark.usefixtures("interruptible")
@pytest.mark.parametrize(("during", "trials"), [("trial", 1), ("result", 2)])
def test_after_ctrl_c_only_the_trials_that_are_running_end(
    during: str, trials: int, short_trial: dict[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A process has its next trial already, which can no longer be cancelled, but need not be waited for."""
    (tmp_path / "slow_trial.py").write_text(
        "import pathlib, time\n"
        "from msrr_bullet.sweep.trials import one_trial\n"
        "def trial(scene, seed):\n"
        "    (pathlib.Path(__file__).parent / f'began_{seed}').touch()\n"
        "    time.sleep(0.3)\n"
        "    result = one_trial(scene, seed)\n"
        "    (pathlib.Path(__file__).parent / f'ended_{seed}').touch()\n"
        "    return result\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    from slow_trial import trial

    def press() -> None:
        while not (tmp_path / "began_0").exists():
            time.sleep(0.01)
        signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)

    pressed: list[int] = []

    def observe(found: TrialResult | TrialFailure, _: bool) -> None:
        if during == "result" and not pressed:  # the next trial has begun
            pressed.append(found.seed)
            raise KeyboardInterrupt

    if during == "trial":
        threading.Thread(target=press, daemon=True).start()
    scene = load_scene("close_range", short_trial)
    summary = run_sweep(scene, range(4), jobs=1, trial=trial, observer=observe)
    assert summary.interrupted
    assert summary.trials == len(list(tmp_path.glob("ended_*"))) == trials


class Uncancellable:
    """An executor of threads whose futures say that they are pending until they end, as those of Dask do."""

    def submit(self, fn: Callable[..., Any], /, *args: Any) -> Future[Any]:
        future: Future[Any] = Future()

        def work() -> None:
            time.sleep(0.2 * args[-1])  # by its seed
            result = fn(*args)
            if not future.cancelled():
                future.set_result(result)

        threading.Thread(target=work, daemon=True).start()
        return future


def test_after_ctrl_c_the_trials_of_an_executor_that_cancels_anything_end(scene: Scene) -> None:
    """It would drop those that run without a word."""
    seen: list[int] = []

    def observe(found: TrialResult | TrialFailure, _: bool) -> None:
        seen.append(found.seed)
        if len(seen) == 1:
            raise KeyboardInterrupt

    found = run_sweep(scene, range(9), jobs=3, executor=Uncancellable(), trial=made_up, observer=observe)
    assert found.interrupted
    assert found.trials == 4
    assert sorted({0, *seen}) == [0, 1, 2, 3]


def test_other_processes_of_the_program_are_not_those_of_a_pool() -> None:
    other = multiprocessing.get_context("spawn").Process(target=time.sleep, args=(60.0,))
    with SpawnedPool(1) as pool:
        other.start()  # after the pool was made
        try:
            pool.kill()
            assert other.is_alive()
        finally:
            other.kill()
            other.join()


@pytest.mark.nightly
def test_a_trial_that_no_exception_stops_is_killed_with_its_process(
    short_trial: dict[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "stubborn_trial.py").write_text(
        "import time\n"
        "from msrr_bullet.sweep.trials import one_trial\n"
        "def trial(scene, seed, wall_limit_s):\n"
        "    while seed == 1:\n"
        "        try:\n"
        "            time.sleep(1.0)\n"
        "        except BaseException:\n"
        "            pass\n"
        "    return one_trial(scene, seed, wall_limit_s=wall_limit_s)\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr("msrr_bullet.sweep.worker_pool._OVERDUE_S", 0.5)
    from stubborn_trial import trial

    scene = load_scene("close_range", short_trial)
    summary = run_sweep(scene, range(3), jobs=2, trial=trial, wall_limit_s=4.0)
    (failure,) = summary.failures
    assert (failure.seed, failure.bad_input) == (1, True)
    assert "not stopped by the limit of 4 s" in failure.error
    assert sum(summary.outcomes.values()) == 2


@pytest.mark.parametrize("limit_s", [-1.0, float("nan"), "3"])
def test_a_limit_that_is_none_is_refused_before_any_trial(scene: Scene, limit_s: float) -> None:
    with pytest.raises(ValueError, match="expected a limit above 0 s"):
        run_sweep(scene, range(3), executor=inline, trial=made_up, wall_limit_s=limit_s)


@pytest.mark.nightly
@pytest.mark.parametrize("interrupts", [0, 1])
def test_processes_that_do_not_end_cost_no_result(tmp_path: Path, interrupts: int) -> None:
    """A class of one's own can start a thread for which a process waits at its end; Ctrl-C may come then."""
    (tmp_path / "threaded_trial.py").write_text(
        "import threading, time\n"
        "from msrr_bullet.sweep.trials import one_trial\n"
        "def trial(scene, seed):\n"
        "    threading.Thread(target=time.sleep, args=[600.0]).start()\n"
        "    return one_trial(scene, seed)\n"
    )
    program = tmp_path / "program.py"
    program.write_text(
        "from msrr_bullet.sweep.trials import run_trials\n"
        "from msrr_scenes import load_scene\n"
        "from threaded_trial import trial\n"
        "if __name__ == '__main__':\n"
        "    given = {'plant': 'unicycle', 'perception': 'parametric', 'time_limit_s': '1'}\n"
        "    show = lambda outcome, stored: print('done', flush=True)\n"
        "    found = run_trials([(load_scene('close_range', given), range(2))], trial=trial, observer=show)\n"
        "    print(len(found.outcomes), found.interrupted)\n"
    )
    process = subprocess.Popen(
        [sys.executable, str(program)],
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    try:
        assert process.stdout is not None
        assert [process.stdout.readline() for _ in range(2)] == ["done\n"] * 2
        time.sleep(0.3)
        for _ in range(interrupts):
            process.send_signal(signal.SIGINT)
        out, _ = process.communicate(timeout=30.0)
    finally:
        process.kill()
    assert (process.returncode, out) == (0, f"2 {bool(interrupts)}\n")


@pytest.mark.nightly
def test_a_worker_that_dies_while_a_result_is_stored_ends_no_sweep(
    short_trial: dict[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The pool learns of the death before the next trial is submitted to it."""
    (tmp_path / "trial_that_dies_later.py").write_text(
        "import os, pathlib, time\n"
        "from msrr_bullet.sweep.trials import one_trial\n"
        "here = pathlib.Path(__file__).parent\n"
        "def trial(scene, seed):\n"
        "    if seed != 1:\n"
        "        return one_trial(scene, seed)\n"
        "    (here / f'runs-{os.getpid()}').touch()\n"
        "    while not (here / 'stored').exists():\n"
        "        time.sleep(0.01)\n"
        "    os._exit(7)\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    from trial_that_dies_later import trial

    def observe(found: TrialResult | TrialFailure, stored: bool) -> None:
        while not list(tmp_path.glob("runs-*")):
            time.sleep(0.01)
        (tmp_path / "stored").touch()
        for running in tmp_path.glob("runs-*"):
            process = int(running.name.partition("-")[2])
            while Path(f"/proc/{process}").exists():  # until the pool has seen the end of it
                time.sleep(0.01)
        time.sleep(0.2)

    scene = load_scene("close_range", short_trial)
    summary = run_sweep(scene, range(6), jobs=2, trial=trial, observer=observe)
    assert [f.seed for f in summary.failures] == [1]
    assert sum(summary.outcomes.values()) == 5


@pytest.mark.parametrize("busy", [False, True])
def test_ctrl_c_ends_a_pool_at_once_and_without_a_word(tmp_path: Path, busy: bool) -> None:
    """A terminal sends it to the workers as well, also to one that is still importing its modules."""
    program = tmp_path / "program.py"
    program.write_text(
        "import time\n"
        "from msrr_bullet.sweep.spawned_pool import SpawnedPool\n"
        "if __name__ == '__main__':\n"
        "    with SpawnedPool(2) as pool:\n"
        f"        {'list(pool.map(abs, range(2)))' if busy else ''}\n"
        "        results = pool.map(time.sleep, [60.0] * 6)\n"
        "        try:\n"
        "            print('started', flush=True)\n"
        "            list(results)\n"
        "        except KeyboardInterrupt:\n"
        "            print('interrupted', flush=True)\n"
        "            raise SystemExit(5)\n"
    )
    process = subprocess.Popen(
        [sys.executable, str(program)],
        start_new_session=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    try:
        assert process.stdout is not None
        assert process.stdout.readline() == "started\n"
        time.sleep(0.3)  # amid the imports of the workers, if they are new
        os.killpg(process.pid, signal.SIGINT)
        out, err = process.communicate(timeout=40.0)
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
    assert (process.returncode, out, err) == (5, "interrupted\n", "")


def test_a_program_whose_workers_cannot_start_is_told_so() -> None:
    """Workers import the program's main module, and this one is no file."""
    program = (
        "from msrr_bullet.sweep.sweep import run_sweep\n"
        "from msrr_scenes import load_scene\n"
        "run_sweep(load_scene('close_range'), range(1000), jobs=2)\n"
    )
    ran = subprocess.run([sys.executable, "-"], input=program, capture_output=True, text=True, timeout=60)
    assert ran.returncode != 0
    assert "no process for trials can start" in ran.stderr
    assert ran.stderr.count("FileNotFoundError") <= 2, "not one for each seed"
