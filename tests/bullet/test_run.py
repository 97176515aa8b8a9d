"""Run folders: what is in one is of one run, and what no run wrote is never lost."""

from __future__ import annotations

import errno
import os
import signal
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from msrr_bullet.log import read_log, topics
from msrr_bullet.run import run_trial
from msrr_bullet.run_folder import RUN_FILES, RunFolderError
from msrr_bullet.sweep.sweep import run_sweep
from msrr_bullet.trial.result import TrialResult
from msrr_bullet.trial.telemetry import Progress
from msrr_scenes.errors import MsrrError
from msrr_scenes.messages import NS_PER_S
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.scene import Scene

Load = Callable[..., Scene]

pytestmark = pytest.mark.usefixtures("undrawn_runs")

SEED = 7

SHORT = {"time_limit_s": "1"}


def contents(folder: Path) -> Mapping[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_a_folder_may_be_a_text_and_a_seed_is_a_whole_number(shipped: Load, tmp_path: Path) -> None:
    scene = shipped("close_range", SHORT, blind=True)
    assert run_trial(scene, np.int64(SEED), out=str(tmp_path / "run")).folder == tmp_path / "run"
    seen: list[Progress] = []
    seeds: list[Any] = [1.5, "1", True]  # as from a notebook, where no type is checked
    for seed in seeds:
        with pytest.raises(TypeError, match=f"a seed is an integer, found {seed!r}"):
            run_trial(scene, seed, observer=seen.append)
        with pytest.raises(TypeError, match=f"seeds are integers, such as range\\(20\\), found {seed!r}"):
            run_sweep(scene, seed)
    assert not seen, "a trial was run whose result could not be"


@pytest.mark.parametrize(("out", "error"), [("", ValueError), (5, TypeError)])
def test_a_folder_is_named(out: Any, error: type[Exception], shipped: Load) -> None:
    """The empty one was the working folder, in which a run would have been deleted."""
    with pytest.raises(error, match=r"^out is "):
        run_trial(shipped("close_range", SHORT, blind=True), SEED, out=out)
    assert not any(Path.cwd().glob("*.mcap"))


def test_the_name_of_a_scene_is_none() -> None:
    """As from a notebook, where no type is checked."""
    name: Any = "close_range"
    for use in (run_trial, lambda scene: run_sweep(scene, [0])):
        with pytest.raises(TypeError, match="expected a scene, as load_scene returns it, found str"):
            use(name)


def crash(progress: Progress) -> None:
    if progress.time_s > 0.5:
        raise ZeroDivisionError("in the middle of the run")


def test_no_verdict_of_before_lies_beside_the_log_of_a_run_that_crashed(
    shipped: Load, tmp_path: Path
) -> None:
    """A result.json that said docked lay beside the log of another run, which had crashed."""
    scene = shipped("close_range", SHORT, blind=True)
    run_trial(scene, 1, out=tmp_path)
    assert sorted(contents(tmp_path)) == sorted(RUN_FILES)
    with pytest.raises(ZeroDivisionError):
        run_trial(scene, 2, out=tmp_path, observer=crash)
    assert list(contents(tmp_path)) == ["trial.mcap"]
    assert read_log(tmp_path).header.seed == 2
    run_trial(scene, 3, out=tmp_path)  # the folder of a crashed run is still a run folder
    assert TrialResult.from_json((tmp_path / "result.json").read_text()).seed == 3


def test_a_log_that_was_killed_before_its_first_byte_is_still_one(shipped: Load, tmp_path: Path) -> None:
    (tmp_path / "trial.mcap").touch()
    run_trial(shipped("close_range", SHORT, blind=True), 1, out=tmp_path)
    assert read_log(tmp_path).complete


def test_a_run_leaves_files_of_others_alone(shipped: Load, tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    (tmp_path / "frames").mkdir()
    (tmp_path / "frames" / "best.png").write_text("mine, too")
    for seed in range(2):
        run_trial(shipped("close_range", SHORT, blind=True), seed, out=tmp_path)
    assert (tmp_path / "notes.txt").read_text() == "mine"
    assert (tmp_path / "frames" / "best.png").read_text() == "mine, too"


@pytest.mark.parametrize("names", [["picture.png"], ["result.json", "trial.mcap"], ["trial.mcap"]])
def test_a_folder_with_such_names_that_is_of_no_run_is_refused(
    names: list[str], shipped: Load, tmp_path: Path
) -> None:
    for name in names:
        (tmp_path / name).write_text("of another program")
    before = contents(tmp_path)
    with pytest.raises(RunFolderError, match=rf"{names[0]}.* choose another --out"):
        run_trial(shipped("close_range", SHORT, blind=True), 1, out=tmp_path)
    assert contents(tmp_path) == before


def test_a_name_that_is_a_folder_is_refused(shipped: Load, tmp_path: Path) -> None:
    run_trial(shipped("close_range", SHORT, blind=True), 1, out=tmp_path)
    (tmp_path / "picture.png").unlink()
    (tmp_path / "picture.png").mkdir()
    with pytest.raises(RunFolderError, match=r"picture\.png"):
        run_trial(shipped("close_range", SHORT, blind=True), 1, out=tmp_path)
    assert (tmp_path / "result.json").exists()


def test_a_link_is_replaced_and_not_written_through(shipped: Load, tmp_path: Path) -> None:
    scene, kept, out = shipped("close_range", SHORT, blind=True), tmp_path / "kept", tmp_path / "out"
    run_trial(scene, 1, out=kept)
    before = contents(kept)
    out.mkdir()
    (out / "trial.mcap").symlink_to(kept / "trial.mcap")
    run_trial(scene, 2, out=out)
    assert contents(kept) == before
    assert read_log(out).header.seed == 2


@pytest.mark.parametrize(
    "broken",
    [
        {"cameras.onboard.renderer": "none"},
        {"units.a.urdf": "no/such.urdf"},
        {"control.docking": "no.such:Law"},
    ],
    ids=["renderer", "urdf", "law"],
)
def test_a_scene_that_cannot_be_built_costs_no_run(
    broken: Mapping[str, str], shipped: Load, tmp_path: Path
) -> None:
    run_trial(shipped("close_range", SHORT, blind=True), 1, out=tmp_path)
    before = contents(tmp_path)
    with pytest.raises(MsrrError):
        run_trial(shipped("close_range", {**SHORT, **broken}), 1, out=tmp_path)
    assert contents(tmp_path) == before


@pytest.mark.parametrize("as_built", ["perfect", "careful"])
def test_a_robot_that_can_be_built_only_once_costs_no_run(
    as_built: str, shipped: Load, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It passes the check, and the trial begins; the errors of a careful unit are told before it is built."""
    (tmp_path / f"law_of_{as_built}.py").write_text(
        "built = []\n"
        "class Law:\n"
        "    def __init__(self, setup):\n"
        "        built.append(self)\n"
        "        if len(built) > 1:\n"
        "            raise ValueError('there is one already')\n"
        "    def reset(self, inputs): ...\n"
        "    def step(self, inputs): ...\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    out = tmp_path / "out"
    run_trial(shipped("close_range", SHORT, blind=True), 1, out=out)
    before = contents(out)
    once = {**SHORT, "control.docking": f"law_of_{as_built}:Law", "as_built": as_built}
    with pytest.raises(MsrrError, match="there is one already"):
        run_trial(shipped("close_range", once, blind=True), 1, out=out)
    assert contents(out) == before


def test_a_folder_that_cannot_be_made_is_said_before_the_trial(shipped: Load, tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("a file")

    def unreached(progress: Progress) -> None:
        pytest.fail("the trial runs")

    with pytest.raises(RunFolderError, match="choose another"):
        run_trial(
            shipped("close_range", SHORT, blind=True), 1, out=tmp_path / "taken" / "run", observer=unreached
        )


def test_a_page_that_finds_no_room_costs_neither_the_verdict_nor_the_log(
    shipped: Load, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The outcome of the trial was not told."""

    def full(*args: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("msrr_bullet.run._draw_run", full)
    said = r"\(No space left on device\); the trial ended as timeout, and trial\.mcap has all of it"
    with pytest.raises(RunFolderError, match=said):
        run_trial(shipped("close_range", SHORT, blind=True), SEED, out=tmp_path)
    assert read_log(tmp_path).complete
    assert (tmp_path / "result.json").is_file()


def test_ctrl_c_while_the_log_is_closed_costs_no_result(
    interruptible: None, shipped: Load, tmp_path: Path
) -> None:
    """A listener that keeps pace with the wall clock sends the last messages seconds after the verdict."""

    def interrupt(topic: str, kind: object, stamp_ns: int, data: bytes) -> None:
        if topic == topics.EVENTS and stamp_ns >= NS_PER_S and not interrupted:
            interrupted.append(stamp_ns)
            os.kill(os.getpid(), signal.SIGINT)

    interrupted: list[int] = []
    with pytest.raises(KeyboardInterrupt):
        run_trial(shipped("close_range", SHORT, blind=True), SEED, out=tmp_path, listener=interrupt)
    assert read_log(tmp_path).complete
    assert TrialResult.from_json((tmp_path / "result.json").read_text()).outcome is Outcome.TIMEOUT


def test_two_runs_into_one_folder_at_the_same_time_are_refused(shipped: Load, tmp_path: Path) -> None:
    scene = shipped("close_range", SHORT, blind=True)
    refused: list[str] = []

    def begin_another(progress: Progress) -> None:
        if not refused:
            with pytest.raises(RunFolderError, match="another run is under way") as caught:
                run_trial(scene, 2, out=tmp_path)
            refused.append(str(caught.value))

    first = run_trial(scene, 1, out=tmp_path, observer=begin_another)
    assert refused
    assert read_log(tmp_path).header.seed == 1
    assert TrialResult.from_json((tmp_path / "result.json").read_text()) == first
    assert sorted(contents(tmp_path)) == sorted(RUN_FILES)  # the lock leaves no file
    run_trial(scene, 2, out=tmp_path)
