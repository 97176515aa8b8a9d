"""The worker pool: processes that die, and trials that come out as in this process."""

import subprocess
import sys
from collections import deque
from pathlib import Path

import pytest

from msrr_bullet.sweep.summary import TrialFailure
from msrr_bullet.sweep.sweep import sweep
from msrr_bullet.sweep.trials import one_trial
from msrr_bullet.sweep.worker_pool import SupportsSubmit, Task, TrialFunction, WorkerPool
from msrr_bullet.trial.result import TrialResult
from msrr_scenes import load_scene, scene_hash
from msrr_scenes.specs.scene import Scene


def test_every_seed_is_collected_once(scene: Scene, inline: SupportsSubmit, made_up: TrialFunction) -> None:
    collected: list[int] = []
    pool = WorkerPool(lambda: 2, inline, made_up, lambda task, outcome: collected.append(task.seed))
    pool.run(deque(Task(scene, scene_hash(scene), seed) for seed in range(7)))
    pool.close()
    assert sorted(collected) == list(range(7))


def test_a_worker_that_dies_takes_no_other_trial_with_it(
    short_trial: dict[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "deadly_trial.py").write_text(
        "import os\n"
        "from msrr_bullet.sweep.trials import one_trial\n"
        "def trial(scene, seed):\n"
        "    if seed == 1:\n"
        "        os._exit(7)\n"
        "    return one_trial(scene, seed)\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    from deadly_trial import trial

    summary = sweep(load_scene("close_range", short_trial), range(4), jobs=2, trial=trial)
    assert [f.seed for f in summary.failures] == [1]
    assert "died" in summary.failures[0].error
    assert sum(summary.outcomes.values()) == 3


def test_a_program_whose_workers_cannot_start_is_told_so() -> None:
    """Workers import the program's main module, and this one is no file."""
    program = (
        "from msrr_bullet.sweep.sweep import sweep\n"
        "from msrr_scenes import load_scene\n"
        "sweep(load_scene('close_range'), range(1000), jobs=2)\n"
    )
    ran = subprocess.run([sys.executable, "-"], input=program, capture_output=True, text=True, timeout=60)
    assert ran.returncode != 0
    assert "no process for trials can start" in ran.stderr
    assert ran.stderr.count("FileNotFoundError") <= 2, "not one for each seed"


def test_real_trials_in_other_processes_come_out_the_same(short_trial: dict[str, str]) -> None:
    scene = load_scene("close_range", short_trial)
    here = [one_trial(scene, seed) for seed in range(3)]
    there: dict[int, TrialResult] = {}

    def keep(found: TrialResult | TrialFailure, stored: bool) -> None:
        assert isinstance(found, TrialResult), found
        there[found.seed] = found

    summary = sweep(scene, range(3), jobs=2, observer=keep)
    assert summary.outcomes == {"timeout": 3}
    assert [there[seed] for seed in range(3)] == here
