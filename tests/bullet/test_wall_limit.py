"""The limit on the wall clock ends what never ends, and changes nothing else."""

from __future__ import annotations

import signal
import sys
import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from types import FrameType

import pytest

from msrr_bullet.cli.app import run
from msrr_bullet.log import read_log
from msrr_bullet.run import run_trial
from msrr_bullet.sweep.sweep import run_sweep
from msrr_bullet.wall_limit import WallLimitError, within_wall_limit
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.scene import Scene
from tests.bullet.conftest import inline

Load = Callable[..., Scene]

SHORT: Mapping[str, str] = {"time_limit_s": "1"}

#: A controller that never answers, and swallows every exception that is one.
CLASS = """
import time

from msrr_scenes.messages import Twist


class Stuck:
    def __init__(self, setup): ...
    def reset(self, inputs): ...
    def step(self, inputs):
        while True:
            try:
                time.sleep(0.01)
            except Exception:
                pass
"""


@pytest.fixture
def stuck(shipped: Load, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Scene:
    (tmp_path / "stuck_on_the_clock.py").write_text(CLASS)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "stuck_on_the_clock", raising=False)  # of another folder
    return shipped("close_range", {**SHORT, "control.docking": "stuck_on_the_clock:Stuck"}, blind=True)


def test_a_controller_that_never_answers_is_ended_and_its_log_stays(stuck: Scene, tmp_path: Path) -> None:
    begun = time.monotonic()
    place = r"in controller 'stuck_on_the_clock:Stuck', stuck_on_the_clock\.py line 1\d; raise --wall-limit"
    with pytest.raises(WallLimitError, match=f"after 1 s on the wall clock, {place}"):
        run_trial(stuck, 1, out=tmp_path / "run", wall_limit_s=1.0)
    assert time.monotonic() - begun < 30.0
    assert sorted(path.name for path in (tmp_path / "run").iterdir()) == ["trial.mcap"]
    assert read_log(tmp_path / "run").header.seed == 1


def test_a_sweep_counts_what_takes_too_long_and_goes_on(stuck: Scene) -> None:
    summary = run_sweep(stuck, range(2), executor=inline, wall_limit_s=0.5)
    assert summary.trials == 2
    assert [(f.seed, f.bad_input) for f in summary.failures] == [(0, True), (1, True)]
    assert summary.outcomes == {}


def test_dock_says_it_and_ends_with_2(
    stuck: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    blind = ["--set", "plant=unicycle", "--set", "perception=parametric"]
    law = ["--set", "control.docking=stuck_on_the_clock:Stuck"]
    assert run(["dock", "close_range", *blind, *law, "--wall-limit", "0.5"]) == 2
    assert "msrr: the trial was stopped after 0.5 s on the wall clock" in capsys.readouterr().err


def test_a_trial_that_stays_below_the_limit_has_the_same_bits(shipped: Load) -> None:
    scene = shipped("close_range", SHORT, blind=True)
    free = run_trial(scene, 3)
    assert free.outcome is Outcome.TIMEOUT
    assert run_trial(scene, 3, wall_limit_s=300.0) == free


def test_without_signals_a_slow_trial_is_ended_by_its_loop(shipped: Load) -> None:
    found: list[BaseException] = []

    def in_a_thread() -> None:
        try:
            run_trial(shipped("close_range", blind=True), 1, wall_limit_s=0.05)
        except WallLimitError as error:
            found.append(error)

    thread = threading.Thread(target=in_a_thread)
    thread.start()
    thread.join()
    assert len(found) == 1


def test_the_timer_and_the_handler_of_the_program_around_are_kept() -> None:
    heard: list[int] = []

    def mine(number: int, frame: FrameType | None) -> None:
        heard.append(number)

    handler, timer = signal.getsignal(signal.SIGALRM), signal.getitimer(signal.ITIMER_REAL)
    try:
        signal.signal(signal.SIGALRM, mine)
        signal.setitimer(signal.ITIMER_REAL, 0.3)
        within_wall_limit(100.0, lambda _: time.sleep(0.1))
        assert signal.getsignal(signal.SIGALRM) is mine
        assert 0.0 < signal.getitimer(signal.ITIMER_REAL)[0] <= 0.2
        time.sleep(0.4)
        assert heard == [signal.SIGALRM]
    finally:
        signal.signal(signal.SIGALRM, handler)
        signal.setitimer(signal.ITIMER_REAL, *timer)


def test_an_error_that_compiled_code_makes_of_the_interrupt_is_the_limit() -> None:
    """As numba does where it returns a named tuple: an error of C code that is itself an ``Exception``."""

    def interrupted_in_compiled_code(_: object) -> None:
        try:
            while True:
                time.sleep(0.01)
        except BaseException as error:
            raise SystemError("returned a result with an exception set") from error

    def fail(_: object) -> None:
        raise SystemError("another one")

    with pytest.raises(WallLimitError, match=r"after 0\.2 s"):
        within_wall_limit(0.2, interrupted_in_compiled_code)
    with pytest.raises(SystemError):
        within_wall_limit(100.0, fail)


def test_an_alarm_as_the_trial_ends_leaves_nothing_behind() -> None:
    """The limit is reached within 60 us of the end: a timer or handler was left, or another error came."""
    handler, ends = signal.getsignal(signal.SIGALRM), set()
    around_s, _ = signal.getitimer(signal.ITIMER_REAL)  # of pytest, which stops a test that never ends
    for i in range(3000):
        until = time.perf_counter() + 3e-4 + 2e-8 * (i - 1500)

        def body(_: object, until: float = until) -> str:
            while time.perf_counter() < until:
                pass
            return "ended"

        try:
            ends.add(within_wall_limit(3e-4, body))
        except WallLimitError:
            ends.add("stopped")
        assert signal.getsignal(signal.SIGALRM) is handler
        assert around_s - 30.0 < signal.getitimer(signal.ITIMER_REAL)[0] <= around_s
    assert ends == {"ended", "stopped"}


@pytest.mark.parametrize("limit_s", [0.0, -1.0, float("inf"), float("nan")])
def test_a_limit_that_is_no_time_is_refused(limit_s: float) -> None:
    with pytest.raises(ValueError, match=r"expected a limit above 0 s .* or None for no limit, found"):
        within_wall_limit(limit_s, lambda _: None)
