"""Sweeps on a cluster of Dask: each trial counts once, whatever happens to the workers."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import ExitStack, contextmanager, nullcontext
from pathlib import Path
from typing import Any

import pytest

from msrr_bullet.cli.app import run
from msrr_bullet.sweep.dask_cluster import Cluster, ClusterError, dask_cluster
from msrr_bullet.sweep.remote_trial import OtherCodeError
from msrr_bullet.sweep.summary import TrialFailure
from msrr_bullet.sweep.sweep import run_sweep
from msrr_bullet.sweep.trials import run_trials
from msrr_bullet.trial.result import TrialResult
from msrr_scenes import load_scene
from msrr_scenes.specs.scene import Scene
from tests.bullet.conftest import inline
from tests.bullet.sweep.conftest import made_up

LOOPBACK = ("--host", "127.0.0.1", "--no-dashboard")


@contextmanager
def running(module: str, *arguments: str) -> Iterator[subprocess.Popen[bytes]]:
    pytest.importorskip("distributed")  # an extra
    process = subprocess.Popen(
        [sys.executable, "-m", f"distributed.cli.{module}", *arguments],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        yield process
    finally:
        process.kill()
        process.wait()


def address_in(contact: Path) -> str:
    """Return the address of a scheduler, once it has written its file."""
    while not contact.exists() or not contact.read_text():
        time.sleep(0.1)
    address: str = json.loads(contact.read_text())["address"]
    return address


@pytest.mark.nightly
def test_a_worker_that_is_killed_loses_no_trial_and_repeats_none(
    short_trial: dict[str, str], tmp_path: Path
) -> None:
    scene, contact = load_scene("close_range", short_trial), tmp_path / "scheduler.json"
    seeds = range(24)
    observed: list[int] = []
    found = ("--scheduler-file", str(contact), *LOOPBACK)
    with ExitStack() as stack:
        stack.enter_context(running("dask_scheduler", "--port", "0", *found))
        address = address_in(contact)
        options = (*found, "--nthreads", "1", "--no-nanny")
        workers = [stack.enter_context(running("dask_worker", *options)) for _ in range(2)]
        with dask_cluster(address) as cluster:
            while cluster.slots() < 2:
                time.sleep(0.1)

            def observe(outcome: TrialResult | TrialFailure, stored: bool) -> None:
                observed.append(outcome.seed)
                if len(observed) == 4:
                    workers[0].kill()

            there = run_trials([(scene, seeds)], cluster.slots, executor=cluster.executor, observer=observe)
            assert cluster.slots() == 1
    assert workers[0].returncode is not None
    assert sorted(observed) == list(seeds)
    assert there.outcomes == run_trials([(scene, seeds)], jobs=2).outcomes


@pytest.mark.nightly
def test_workers_of_several_threads_are_refused(tmp_path: Path) -> None:
    contact = tmp_path / "scheduler.json"
    found = ("--scheduler-file", str(contact), *LOOPBACK)
    with ExitStack() as stack:
        stack.enter_context(running("dask_scheduler", "--port", "0", *found))
        address = address_in(contact)
        stack.enter_context(running("dask_worker", *found, "--nthreads", "2", "--no-nanny"))
        with pytest.raises(ClusterError, match="has 2 threads; start workers"):
            stack.enter_context(dask_cluster(address))


@pytest.mark.nightly
def test_ctrl_c_of_a_terminal_reaches_no_worker_of_this_machine(
    short_trial: dict[str, str], tmp_path: Path
) -> None:
    """They died of it, and the sweep waited for their trials."""
    pytest.importorskip("distributed")  # an extra
    given = [f"--set={key}={value}" for key, value in short_trial.items()]
    table = tmp_path / "trials.csv"
    command = ["msrr", "sweep", "close_range", "--seeds", "0:1000", *given, "--fresh", "--dask", "local:1"]
    sweep = subprocess.Popen(
        [sys.executable, "-c", "from msrr_bullet.cli import main; main()", *command[1:], "--csv", str(table)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        process_group=0,
        cwd=tmp_path,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    with sweep:
        time.sleep(30.0)  # trials are running by then
        os.killpg(sweep.pid, signal.SIGINT)
        _, errors = sweep.communicate(timeout=60.0)
    assert sweep.returncode == 130
    assert b"Traceback" not in errors
    assert len(table.read_text().splitlines()) > 1


def test_a_cluster_that_goes_away_costs_no_finished_trial(
    short_trial: dict[str, str],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Their table was not written, and without a store they were lost."""

    class Leaving:
        begun = 0

        def submit(self, fn: Callable[..., Any], /, *args: Any) -> Future[Any]:
            self.begun += 1
            if self.begun < 4:
                return inline.submit(fn, *args)
            gone: Future[Any] = Future()
            gone.cancel()
            return gone

    cluster = nullcontext(Cluster(Leaving(), lambda: 1))
    monkeypatch.setattr("msrr_bullet.sweep.dask_cluster.dask_cluster", lambda address: cluster)
    given = [f"--set={key}={value}" for key, value in short_trial.items()]
    table = tmp_path / "trials.csv"
    command = ["sweep", "close_range", "--seeds", "0:9", *given, "--fresh", "--dask", "tcp://cluster:8786"]
    assert run([*command, "--csv", str(table)]) == 2
    said = capsys.readouterr()
    assert "the executor has dropped a trial" in said.err
    assert "3 trials" in said.out
    assert len(table.read_text().splitlines()) == 1 + 3


def test_a_worker_with_other_code_ends_the_sweep(scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("msrr_bullet.sweep.remote_trial.code_fingerprint", lambda scene, imported: "older")
    with pytest.raises(OtherCodeError, match="has another version of msrr-bullet"):
        run_sweep(scene, range(3), executor=inline, trial=made_up)


def test_without_dask_the_message_says_what_to_install(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert run(["sweep", "close_range", "--seeds", "0:1", "--dask", "local:2"]) == 2
    assert "pip install 'msrr-bullet[dask]'" in capsys.readouterr().err
